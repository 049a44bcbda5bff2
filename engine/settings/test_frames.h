#pragma once

#include <string>
#include <utility>
#include <vector>

#include "compositing/assembly.h"
#include "engine/frame_maker.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/settings_table.h"

/// Frames as tests draw them: by names and values of settings, on screens that rank 0 gets.
namespace hpr::test {

using Options = std::vector<std::pair<std::string, std::string>>;

/// Settings by their names; of two values of one the last counts. Resolved.
[[nodiscard]] inline RenderSettings settings_with(const Options& options) {
  RenderSettings settings;
  for (const auto& [name, value] : options) set_setting(settings, name, value);
  return resolve(settings, 1);
}

/// Options, and more of them behind.
[[nodiscard]] inline Options joined(Options options, const Options& more) {
  options.insert(options.end(), more.begin(), more.end());
  return options;
}

/// Collective. Brings a layer of a frame to rank 0, and adds the pixels of all its screens to `pixels` there.
template <typename Pixel>
void add_pixels(Session& session, FrameMaker& maker, const Frame& frame, TileLayer<Pixel>& layer,
                std::vector<Pixel>& pixels) {
  const std::vector<int> to_root(maker.blocks().views.size(), 0);
  session.assembler().assemble(session.comm(), layer, frame.owned, to_root);
  if (session.rank() != 0) return;
  for (std::size_t screen = 0; screen < to_root.size(); ++screen) {
    const Image<Pixel> image = to_image(layer, screen);
    pixels.insert(pixels.end(), image.pixels().begin(), image.pixels().end());
  }
}

}  // namespace hpr::test
