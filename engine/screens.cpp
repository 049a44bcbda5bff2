#include "engine/screens.h"

#include "core/timing.h"
#include "image/filter.h"

namespace hpr {
namespace {

/// The screen's size as the frame was made.
Size made_size(const Blocks& blocks, std::size_t screen) {
  const auto block = std::ranges::find(blocks.screen_of, screen) - blocks.screen_of.begin();
  return blocks.views.at(static_cast<std::size_t>(block)).screen;
}

}  // namespace

std::vector<Image<Rgba8>> bring_to_screens(Session& session, Frame& frame, const Blocks& blocks,
                                           const Showing& showing) {
  const trace::Span span("bring to screens");
  const std::size_t screens = showing.sizes.size();
  bool as_made = true;
  for (std::size_t screen = 0; screen < screens; ++screen) {
    as_made = as_made && made_size(blocks, screen) == showing.sizes[screen];
  }
  const std::vector<int> owners = block_owners(blocks, showing.shown_by);
  TileLayer<Rgba8> display;  // a third of the bytes of the radiance, but no light to filter
  if (as_made) {
    display = to_display(frame, session.threads(), showing.exposure_stops);
    session.assembler().assemble(session.comm(), display, frame.owned, owners);
  } else {
    session.assembler().assemble(session.comm(), frame.radiance, frame.owned, owners);
  }
  std::vector<Image<Rgba8>> pictures(screens);
  for (std::size_t screen = 0; screen < screens; ++screen) {
    if (showing.shown_by[screen] != session.rank()) continue;
    if (as_made) {
      pictures[screen] = join_blocks(display, blocks, screen);
    } else {
      const Image<Rgb> small = join_blocks(frame.radiance, blocks, screen);
      pictures[screen] = to_display(enlarge(small, showing.sizes[screen], session.threads()), session.threads(),
                                    showing.exposure_stops);
    }
  }
  return pictures;
}

}  // namespace hpr
