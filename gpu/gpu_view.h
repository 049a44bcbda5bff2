#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/error.h"
#include "scene/view.h"

namespace hpr {

/// A view as shaders read it (gpu/shaders/view.glsl).
struct GpuView {
  glm::dvec3 eye{0.0};
  std::array<glm::dvec3, 3> axes{};
  double left = 0.0;
  double right = 0.0;
  double bottom = 0.0;
  double top = 0.0;
  double near_distance = 0.0;
  double far_distance = 0.0;
  glm::dvec2 jitter{0.0};
  glm::ivec2 block{0};
  glm::uvec2 size{0};
  glm::uvec2 screen{0};
  std::uint32_t orthographic = 0;
  std::uint32_t screen_number = 0;
};
static_assert(sizeof(GpuView) == 192);

[[nodiscard]] inline GpuView as_read(const View& view) {
  HPR_CHECK(!view.points);
  GpuView read;
  read.eye = view.eye;
  read.axes = {view.axes[0], view.axes[1], view.axes[2]};
  read.left = view.left;
  read.right = view.right;
  read.bottom = view.bottom;
  read.top = view.top;
  read.near_distance = view.near_distance;
  read.far_distance = view.far_distance;
  read.jitter = view.jitter;
  read.block = {view.block.x0, view.block.y0};
  read.size = {view.size().width, view.size().height};
  read.screen = {view.screen.width, view.screen.height};
  read.orthographic = view.orthographic ? 1 : 0;
  read.screen_number = view.screen_number;
  return read;
}

}  // namespace hpr
