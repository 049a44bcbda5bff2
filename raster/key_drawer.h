#pragma once

#include <vector>

#include "image/key.h"
#include "raster/draw_list.h"
#include "raster/gl.h"
#include "raster/key_target.h"
#include "scene/view.h"

namespace hpr {

/// Draws lists of commands by one context; what it drew is read into memory.
class KeyDrawer {
 public:
  /// `vertices` and `indices`: of Geometry, buffers of that context or of one it shares buffers with. All outlive this.
  KeyDrawer(GlContext& context, const GlObject& vertices, const GlObject& indices);

  [[nodiscard]] GlContext& context() { return context_; }
  /// Other contexts of those that share buffers have filled the buffers anew.
  void refresh() { stale_ = true; }

  /// Makes its context current on this thread, for whatever comes next.
  void begin(DepthFormat format);
  /// Clears the list's pixels and draws the list, to the end.
  void draw(const View& view, const DrawList& list);
  /// The list's pixels; see KeyTarget.
  void read(const View& view, const DrawList& list) { target_.read(view.size(), list.pixels); }
  [[nodiscard]] const KeyTarget& target() const { return target_; }

 private:
  void describe_vertices();
  void set_state() const;

  GlContext& context_;
  const GlObject& vertices_;
  const GlObject& indices_;
  DepthFormat format_ = DepthFormat::Float32;
  GlObject program_;
  GlObject records_;
  GlObject commands_;
  GlObject vertex_array_;
  KeyTarget target_;
  bool stale_ = false;
};

/// Fills a buffer of the current context.
template <typename T>
void upload(const GlFunctions& gl, const GlObject& buffer, const std::vector<T>& data, GLenum usage) {
  gl.NamedBufferData(buffer.name(), static_cast<GLsizeiptr>(data.size() * sizeof(T)), data.data(), usage);
}

}  // namespace hpr
