#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "image/key.h"
#include "raster/draw_list.h"
#include "raster/gl.h"
#include "raster/keys/key_readback.h"
#include "raster/keys/key_target.h"
#include "scene/view.h"

namespace hpr {

/// Draws lists of commands by one context; what it drew is read into memory.
class KeyDrawer {
 public:
  /// `vertices` and `indices`: of Geometry, buffers of that context or of one it shares buffers with. All outlive this.
  KeyDrawer(GlContext& context, const GlObject& vertices, const GlObject& indices, KeyRoute route);

  [[nodiscard]] GlContext& context() { return context_; }
  /// Other contexts of those that share buffers have filled the buffers anew.
  void refresh() { stale_ = true; }

  /// Makes its context current on this thread, for whatever comes next.
  void begin(DepthFormat format);
  /// Has the list's pixels cleared and the list drawn.
  void start(const View& view, const DrawList& list);
  /// Returns once it is drawn. Throws Error (Hang) after kGlWaitLimit, as finish() does.
  void wait();
  /// The keys of the pixels of that list, which stay until the next start().
  [[nodiscard]] DrawnKeys finish(const View& view, const DrawList& list);

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
  std::unique_ptr<KeyReadback> readback_;
  std::optional<GlFence> drawn_;  ///< of the list
  bool stale_ = false;
};

/// Fills a buffer of the current context.
template <typename T>
void upload(const GlFunctions& gl, const GlObject& buffer, const std::vector<T>& data, GLenum usage) {
  gl.NamedBufferData(buffer.name(), static_cast<GLsizeiptr>(data.size() * sizeof(T)), data.data(), usage);
}

}  // namespace hpr
