#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include "image/image.h"
#include "raster/gl.h"
#include "raster/gl_context.h"
#include "raster/keys/key_readback.h"
#include "raster/keys/key_target.h"

namespace hpr {

/// The floor of a frame of keys: nothing but what GL itself needs to bring ids and depths into memory.
class BareGl {
 public:
  BareGl(GlContext& context, std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles,
         const glm::mat4& clip_from_world, Size size, KeyRoute route);

  /// One glDrawElements, whose ids and depths the route brings into memory.
  [[nodiscard]] DrawnKeys frame();

 private:
  GlContext& context_;
  Size size_;
  GlObject program_;
  GlObject positions_;
  GlObject indices_;
  GlObject vertex_array_;
  KeyTarget target_;
  std::unique_ptr<KeyReadback> readback_;
  std::array<float, 16> matrix_{};
  GLsizei index_count_ = 0;
};

}  // namespace hpr
