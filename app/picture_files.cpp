#include "app/picture_files.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "app/screens.h"
#include "core/check.h"
#include "core/file.h"
#include "image/enlarge.h"

namespace hpr {

std::string PictureFiles::aov_file() const {
  if (aovs.empty()) return {};
  return is_png() ? std::filesystem::path(picture).replace_extension(".aov.exr").string() : picture;
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
  if (!files_.picture.empty() && (!display_colors || !files_.aovs.empty())) collect(frame.radiance);
  if (!files_.raw.empty() || std::ranges::any_of(files_.aovs, needs_keys)) collect(*frame.keys);
  for (auto& [aov, layer] : frame.aovs.rgb) collect(layer);
  for (auto& [aov, layer] : frame.aovs.single) collect(layer);
}

Image<Rgb> CollectedPicture::radiance() const {
  Image<Rgb> made = join_blocks(frame_.radiance, blocks_, 0);
  return enlarged() ? enlarge(made, size_, threads_) : made;
}

std::vector<ExrLayer> CollectedPicture::exr_layers() const {
  const View& screen = blocks_.views.front();  // its blocks have one lens
  std::vector<ExrLayer> layers;
  for (const Aov aov : files_.aovs) {
    if (needs_keys(aov)) {
      layers.push_back(to_exr(aov, join_blocks(*frame_.keys, blocks_, 0), screen));
    } else if (has_rgb(aov)) {
      layers.push_back(to_exr(aov, join_blocks(frame_.aovs.rgb.at(aov), blocks_, 0)));
    } else {
      layers.push_back(to_exr(aov, join_blocks(frame_.aovs.single.at(aov), blocks_, 0)));
    }
  }
  return layers;
}

void CollectedPicture::write(const std::string& scene_name) const {
  if (!files_.raw.empty()) {
    write_file_atomically(files_.raw, std::as_bytes(join_blocks(*frame_.keys, blocks_, 0).pixels()));
  }
  if (files_.picture.empty()) return;
  if (files_.is_png()) {
    write_png(files_.picture,
              enlarged() ? to_display(radiance(), threads_, files_.exposure) : join_blocks(display_, blocks_, 0));
  }
  if (files_.is_png() && files_.aovs.empty()) return;
  const std::string exr = files_.is_png() ? files_.aov_file() : files_.picture;
  const std::vector<ExrLayer> layers = exr_layers();
  write_file_atomically(exr, encode_exr(radiance(), {{"hpr:scene", scene_name}}, layers));
}

}  // namespace hpr
