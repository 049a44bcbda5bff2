#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "image/image.h"
#include "raster/gl.h"
#include "raster/gl_context.h"

namespace hpr {

/// The floor of a frame of keys: nothing but what GL itself needs to bring ids and depths into memory.
class BareGl {
 public:
  BareGl(GlContext& context, std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles,
         const glm::mat4& clip_from_world, Size size);

  /// One glDrawElements, glReadPixels of depths and of ids, glFinish.
  void frame();

 private:
  GlContext& context_;
  Size size_;
  GlObject program_;
  GlObject positions_;
  GlObject indices_;
  GlObject vertex_array_;
  GlObject ids_buffer_;
  GlObject depth_buffer_;
  GlObject framebuffer_;
  std::vector<std::uint32_t> ids_;
  std::vector<float> depths_;
  std::array<float, 16> matrix_{};
  GLsizei index_count_ = 0;
};

}  // namespace hpr
