#include "raster/key_target.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "scene/view.h"

namespace hpr {

KeyTarget::KeyTarget(GlContext& context) : context_(context), framebuffer_(make_framebuffer(context)) {}

void KeyTarget::grow(Size needed) {
  if (needed.width <= size_.width && needed.height <= size_.height) return;
  // In steps, so that a moving view does not make a new one every frame.
  const auto step_up = [](int pixels) { return std::min((pixels + 255) / 256 * 256, kRasterLimit); };
  const Size size{std::max(size_.width, step_up(needed.width)), std::max(size_.height, step_up(needed.height))};
  const GlFunctions& gl = context_.gl();
  // The old ones go first: both at once would double the peak.
  words_buffer_ = GlObject();
  depth_buffer_ = GlObject();
  size_ = {};
  words_buffer_ = make_renderbuffer(context_);
  depth_buffer_ = make_renderbuffer(context_);
  gl.NamedRenderbufferStorage(words_buffer_.name(), GL_R32UI, size.width, size.height);
  gl.NamedRenderbufferStorage(depth_buffer_.name(), GL_DEPTH_COMPONENT32F, size.width, size.height);
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, words_buffer_.name());
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_buffer_.name());
  check_gl(gl, fmt::format("making a framebuffer of {}x{} pixels", size.width, size.height));
  if (gl.CheckNamedFramebufferStatus(framebuffer_.name(), GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw Error(ExitCode::NoDevice, "the graphics driver cannot draw 32-bit words with 32-bit float depth");
  }
  size_ = size;
}

void KeyTarget::begin(Size view, const Rect& part) {
  grow({part.x1, view.height - part.y0});
  const GlFunctions& gl = context_.gl();
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
  gl.Viewport(0, 0, view.width, view.height);
  gl.Enable(GL_SCISSOR_TEST);
  gl.Scissor(part.x0, view.height - part.y1, part.width(), part.height());
  constexpr GLuint kNoWord[4] = {0, 0, 0, 0};
  constexpr GLfloat kFarthest = 0.0F;
  gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  gl.DepthMask(GL_TRUE);
  gl.ClearBufferuiv(GL_COLOR, 0, kNoWord);
  gl.ClearBufferfv(GL_DEPTH, 0, &kFarthest);
}

void KeyTarget::read(Size view, const Rect& pixels) {
  const GlFunctions& gl = context_.gl();
  depths_.resize(std::max(depths_.size(), pixels.area()));
  words_.resize(depths_.size());
  // In the formats they are stored in: any conversion costs 4 to 20 times as much.
  gl.PixelStorei(GL_PACK_ALIGNMENT, 4);
  gl.PixelStorei(GL_PACK_ROW_LENGTH, 0);
  const int y = view.height - pixels.y1;
  gl.ReadPixels(pixels.x0, y, pixels.width(), pixels.height(), GL_DEPTH_COMPONENT, GL_FLOAT, depths_.data());
  gl.ReadPixels(pixels.x0, y, pixels.width(), pixels.height(), GL_RED_INTEGER, GL_UNSIGNED_INT, words_.data());
}

}  // namespace hpr
