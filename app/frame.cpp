#include "app/frame.h"

#include "core/stopwatch.h"

// The frame loop: the place to start reading. A frame flows one way,
//
//     scene ──> cluster ──> raster ──> compositing ──> rt ──> walls
//
// and each step below is one of its arrows. What the scene is and who does what stand in the Session and the FramePlan
// (app/plan.cpp); the last arrow, tiles to screens, is taken by whoever shows the frame (app/output.cpp).
namespace hpr {

void prepare(Session& session, const FramePlan& plan) {
  if (!plan.mine.area.empty()) (void)session.rasterizer(plan.mine.objects);
  if (plan.lit || plan.shading == Shading::Local) (void)session.lighter(plan.rays);
  if (plan.mine.group.size() > 1) (void)session.group(plan.mine.group);
}

void rasterize(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys) {
  Rasterizer& rasterizer = session.rasterizer(plan.mine.objects);
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    std::vector<Rect> parts;
    for (const ScreenRect& rect : plan.mine.area) {
      if (rect.screen == screen) parts.push_back(rect.pixels);
    }
    if (!parts.empty()) rasterizer.draw(views[screen], screen, parts, keys);
  }
}

namespace {

/// Merges the group's layers; returns the tiles this rank ends up owning.
std::vector<std::size_t> composite(Session& session, const FramePlan& plan, TileLayer<Key>& keys) {
  if (plan.mine.group.size() == 1) return plan.tiles;
  Compositor& compositor = session.compositor(plan.strategy, plan.mine.group);
  return compositor.composite(session.group(plan.mine.group), keys, plan.tiles).tiles;
}

/// The colours of keys that already carry them.
void unpack_colors(const TileLayer<Key>& keys, std::span<const std::size_t> tiles, Rgb background,
                   TileLayer<Rgb>& radiance) {
  for (const std::size_t tile : tiles) {
    const auto from = keys.tile(tile);
    const auto to = radiance.tile(tile);
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Rgba8 color = from_word(key_rgba(from[i]));
      to[i] = from[i] == kNoKey ? background
                                : Rgb{srgb_to_linear(color.r), srgb_to_linear(color.g), srgb_to_linear(color.b)};
    }
    radiance.set_active(tile);
  }
}

}  // namespace

Frame make_frame(Session& session, const FramePlan& plan, std::span<const View> views, FrameTimes* times) {
  FrameTimes taken;
  Stopwatch watch;
  TileLayer<Key>& keys = session.keys(plan.layout, plan.strategy, plan.mine.group);
  rasterize(session, plan, views, keys);
  taken.raster_ms = watch.ms();

  if (plan.shading == Shading::Local) shade_local(session.lighter(plan.rays), views, keys, plan.tiles);

  watch.restart();
  Frame frame{&keys, TileLayer<Rgb>(plan.layout), composite(session, plan, keys)};
  taken.composite_ms = watch.ms();

  if (plan.shading == Shading::Local) {
    unpack_colors(keys, frame.owned, session.scene().background, frame.radiance);
  } else if (plan.lit) {
    session.lighter(plan.rays).light(views, keys, frame.owned, frame.radiance);
  }
  if (times != nullptr) *times = taken;
  return frame;
}

}  // namespace hpr
