#include "raster/keys/key_target.h"

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
  words_ = GlObject();
  depths_ = GlObject();
  size_ = {};
  words_ = make_texture(context_);
  depths_ = make_texture(context_);
  gl.TextureStorage2D(words_.name(), 1, GL_R32UI, size.width, size.height);
  gl.TextureStorage2D(depths_.name(), 1, GL_DEPTH_COMPONENT32F, size.width, size.height);
  gl.NamedFramebufferTexture(framebuffer_.name(), GL_COLOR_ATTACHMENT0, words_.name(), 0);
  gl.NamedFramebufferTexture(framebuffer_.name(), GL_DEPTH_ATTACHMENT, depths_.name(), 0);
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
  constexpr GLfloat kFarDepth = 0.0F;
  gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  gl.DepthMask(GL_TRUE);
  gl.ClearBufferuiv(GL_COLOR, 0, kNoWord);
  gl.ClearBufferfv(GL_DEPTH, 0, &kFarDepth);
}

}  // namespace hpr
