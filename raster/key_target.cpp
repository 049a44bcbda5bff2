#include "raster/key_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "core/error.h"
#include "core/parallel.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// A rectangle of GL's rows.
struct Rows {
  const float* depths;
  const std::uint32_t* words;
  Rect pixels;

  /// The index of pixel (x, y) of the screen.
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(pixels.y1 - 1 - y) * static_cast<std::size_t>(pixels.width()) +
           static_cast<std::size_t>(x - pixels.x0);
  }
};

bool any_drawn(const Rows& rows, const Rect& rect) {
  const auto width = static_cast<std::size_t>(rect.width());
  for (int y = rect.y0; y < rect.y1; ++y) {
    const float* const depth = rows.depths + rows.index(rect.x0, y);
    std::uint32_t bits = 0;
    for (std::size_t x = 0; x < width; ++x) bits |= std::bit_cast<std::uint32_t>(depth[x]);
    if (bits != 0) return true;
  }
  return false;
}

Key joined(float depth, std::uint32_t word) {
  return Key{std::bit_cast<std::uint32_t>(depth)} << 32U | word;
}

/// Into a tile that holds nothing yet: no comparison, and its memory is not read before it is written.
void store_row(const float* depths, const std::uint32_t* words, std::size_t count, Key* keys) {
  for (std::size_t x = 0; x < count; ++x) keys[x] = joined(depths[x], words[x]);
}

void merge_row(const float* depths, const std::uint32_t* words, std::size_t count, Key* keys) {
  for (std::size_t x = 0; x < count; ++x) keys[x] = std::max(keys[x], joined(depths[x], words[x]));
}

}  // namespace

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
  constexpr GLfloat kFarDepth = 0.0F;
  gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  gl.DepthMask(GL_TRUE);
  gl.ClearBufferuiv(GL_COLOR, 0, kNoWord);
  gl.ClearBufferfv(GL_DEPTH, 0, &kFarDepth);
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

void pack_keys(std::span<const KeyHalves> drawn, const Rect& pixels, std::size_t screen, TileLayer<Key>& layer,
               int threads) {
  if (pixels.empty()) return;
  for (const KeyHalves& halves : drawn) {
    HPR_CHECK(halves.depths.size() >= pixels.area() && halves.words.size() >= pixels.area());
  }
  const int first_column = pixels.x0 / kTileSide;
  const int first_row = pixels.y0 / kTileSide;
  const int columns = (pixels.x1 - 1) / kTileSide - first_column + 1;
  const int rows = (pixels.y1 - 1) / kTileSide - first_row + 1;

  parallel_for(threads, static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), [&](std::size_t i) {
    const int x0 = (first_column + static_cast<int>(i) % columns) * kTileSide;
    const int y0 = (first_row + static_cast<int>(i) / columns) * kTileSide;
    const Rect rect = intersection(pixels, {x0, y0, x0 + kTileSide, y0 + kTileSide});
    const std::size_t tile = layer.layout().tile_at(screen, x0, y0);
    Key* const keys = layer.tile(tile).data();
    for (const KeyHalves& halves : drawn) {
      const Rows from_rows{halves.depths.data(), halves.words.data(), pixels};
      if (!any_drawn(from_rows, rect)) continue;
      const auto write_row = layer.active(tile) ? merge_row : store_row;
      for (int y = rect.y0; y < rect.y1; ++y) {
        const std::size_t from = from_rows.index(rect.x0, y);
        write_row(from_rows.depths + from, from_rows.words + from, static_cast<std::size_t>(rect.width()),
                  keys + std::ptrdiff_t{kTileSide} * (y - y0) + (rect.x0 - x0));
      }
      layer.set_active(tile);
    }
  });
}

}  // namespace hpr
