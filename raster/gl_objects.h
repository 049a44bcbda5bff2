#pragma once

#include <span>
#include <string_view>
#include <utility>

#include "raster/gl_context.h"
#include "raster/gl_functions.h"

namespace hpr {

/// One GL name, deleted in the context it came from.
class GlObject {
 public:
  using Delete = void (*)(const GlFunctions& gl, GLuint name);

  GlObject() = default;
  GlObject(GlContext& context, GLuint name, Delete free) : context_(&context), name_(name), free_(free) {}
  GlObject(GlObject&& other) noexcept
      : context_(std::exchange(other.context_, nullptr)), name_(std::exchange(other.name_, 0)), free_(other.free_) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(context_, other.context_);
    std::swap(name_, other.name_);
    std::swap(free_, other.free_);
    return *this;
  }
  GlObject(const GlObject&) = delete;
  GlObject& operator=(const GlObject&) = delete;
  ~GlObject();

  [[nodiscard]] GLuint name() const { return name_; }

 private:
  GlContext* context_ = nullptr;
  GLuint name_ = 0;
  Delete free_ = nullptr;
};

/// All of them expect the context to be current.
[[nodiscard]] GlObject make_buffer(GlContext& context);
[[nodiscard]] GlObject make_vertex_array(GlContext& context);
[[nodiscard]] GlObject make_renderbuffer(GlContext& context);
[[nodiscard]] GlObject make_framebuffer(GlContext& context);
/// Throws Error (NoDevice) with the driver's log when a shader is refused.
[[nodiscard]] GlObject make_program(GlContext& context, std::string_view vertex_source,
                                    std::string_view fragment_source);

}  // namespace hpr
