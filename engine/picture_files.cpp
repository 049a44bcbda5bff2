#include "engine/picture_files.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "engine/screens.h"
#include "image/filter.h"

namespace hpr {

std::string PictureFiles::aov_file() const {
  if (aovs.empty()) return {};
  return is_png() ? std::filesystem::path(picture).replace_extension(".aov.exr").string() : picture;
}

std::string PictureFiles::explain_colors() const {
  const bool half = colors == ColorFormat::Float16;
  if (is_png() && aovs.empty()) return "colors: sent as the 8 bits a .png holds, whatever --color-format says";
  return half ? "colors: 16f (6 bytes a pixel instead of 12 on their way to rank 0, rounded to 11 bits)"
              : "colors: 8 (4 bytes a pixel instead of 12 on their way to rank 0, clamped to display colours)";
}

CollectedPicture::CollectedPicture(Session& session, Frame& frame, const Blocks& blocks, Size size, PictureFiles files)
    : frame_(frame), blocks_(blocks), size_(size), threads_(session.threads()), files_(std::move(files)) {
  HPR_CHECK(!enlarged() || (files_.raw.empty() && files_.aovs.empty()));
  const std::vector<int> to_root(blocks.views.size(), 0);
  const auto collect = [&](auto& layer) { session.assembler().assemble(session.comm(), layer, frame.owned, to_root); };
  // A PNG holds display colours, a third of the bytes of the radiance an EXR holds.
  const bool display_colors = files_.is_png() && !enlarged();
  if (display_colors) {
    display_ = to_display(frame, session.threads(), files_.exposure);
    collect(display_);
  }
  // What is shown at another size than it was made in is enlarged on rank 0 before it is rounded to display colours.
  if (enlarged() && files_.is_png()) {
    collect(frame.radiance);
  } else if (!files_.picture.empty() && (!files_.is_png() || !files_.aovs.empty())) {
    collect_radiance(session, frame);
  }
  if (!files_.raw.empty() || std::ranges::any_of(files_.aovs, needs_keys)) collect(*frame.keys);
  for (auto& [aov, layer] : frame.aovs.rgb) collect(layer);
  for (auto& [aov, layer] : frame.aovs.single) collect(layer);
}

Image<Rgb> CollectedPicture::radiance() const {
  Image<Rgb> made = join_blocks(frame_.radiance, blocks_, 0);
  return enlarged() ? enlarge(made, size_, threads_) : made;
}

namespace {

/// Brings `radiance` to rank 0 by way of another kind of pixel; every rank's tiles go through it, rank 0's too.
template <typename Sent, typename Encode, typename Decode>
void collect_as(Session& session, TileLayer<Rgb>& radiance, std::span<const std::size_t> owned,
                std::span<const int> shown_by, const Encode& encode, const Decode& decode) {
  TileLayer<Sent> sent(radiance.layout());
  parallel_for(session.threads(), owned.size(), [&](std::size_t i) {
    std::ranges::transform(std::as_const(radiance).tile(owned[i]), sent.tile(owned[i]).begin(), encode);
    sent.set_active(owned[i]);
  });
  session.assembler().assemble(session.comm(), sent, owned, shown_by);
  if (session.rank() != 0) return;
  parallel_for(session.threads(), sent.tiles(), [&](std::size_t tile) {
    if (!sent.active(tile)) return;
    std::ranges::transform(std::as_const(sent).tile(tile), radiance.tile(tile).begin(), decode);
    radiance.set_active(tile);
  });
}

}  // namespace

void CollectedPicture::collect_radiance(Session& session, Frame& frame) const {
  const std::vector<int> to_root(blocks_.views.size(), 0);
  const auto half = [](Rgb color) { return to_half(color); };
  const auto whole = [](RgbHalf color) { return from_half(color); };
  switch (files_.colors) {
    case ColorFormat::Float32:
      session.assembler().assemble(session.comm(), frame.radiance, frame.owned, to_root);
      break;
    case ColorFormat::Float16:
      collect_as<RgbHalf>(session, frame.radiance, frame.owned, to_root, half, whole);
      break;
    case ColorFormat::Srgb8:
      collect_as<Rgba8>(session, frame.radiance, frame.owned, to_root, to_srgb, from_srgb);
      break;
  }
}

std::vector<ExrLayer> exr_layers(const Frame& frame, const Blocks& blocks, std::size_t screen,
                                 std::span<const Aov> aovs) {
  // All blocks of a screen have one lens.
  const auto block = std::ranges::find(blocks.screen_of, screen) - blocks.screen_of.begin();
  const View& view = blocks.views.at(static_cast<std::size_t>(block));
  std::vector<ExrLayer> layers;
  for (const Aov aov : aovs) {
    if (needs_keys(aov)) {
      layers.push_back(to_exr(aov, join_blocks(*frame.keys, blocks, screen), view));
    } else if (has_rgb(aov)) {
      layers.push_back(to_exr(aov, join_blocks(frame.aovs.rgb.at(aov), blocks, screen)));
    } else {
      layers.push_back(to_exr(aov, join_blocks(frame.aovs.single.at(aov), blocks, screen)));
    }
  }
  return layers;
}

void CollectedPicture::write(const std::string& scene_name) const {
  const trace::Span span("write picture");
  if (!files_.picture.empty()) write_picture(scene_name);
  // What goes with a picture is not to cost it.
  if (!files_.raw.empty()) {
    write_file_atomically(files_.raw, std::as_bytes(join_blocks(*frame_.keys, blocks_, 0).pixels()));
  }
}

void CollectedPicture::write_picture(const std::string& scene_name) const {
  if (files_.is_png()) {
    write_png(files_.picture,
              enlarged() ? to_display(radiance(), threads_, files_.exposure) : join_blocks(display_, blocks_, 0));
  }
  if (files_.is_png() && files_.aovs.empty()) return;
  const std::string exr = files_.is_png() ? files_.aov_file() : files_.picture;
  const std::vector<ExrLayer> layers = exr_layers(frame_, blocks_, 0, files_.aovs);
  write_file_atomically(exr, encode_exr(radiance(), {{"hpr:scene", scene_name}}, layers));
}

}  // namespace hpr
