#include "engine/output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "cluster/transport/collectives.h"
#include "compositing/assembly.h"
#include "core/error.h"
#include "core/file.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/peak_memory.h"
#include "core/timing.h"
#include "engine/frame.h"
#include "engine/frame_settings.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "image/filter.h"
#include "image/image_io.h"
#include "raster/rasterizer.h"
#include "rt/passes/pass_list.h"
#include "scene/pages/part_pages.h"

namespace hpr {
namespace {

/// The slowest rank's time.
double slowest(Communicator& comm, double ms) {
  return std::ranges::max(all_gather_value(comm, ms));
}

}  // namespace

Blocks cut_blocks(std::span<const View> screens, double scale) {
  Blocks blocks;
  const std::vector<View> made = at_resolution(screens, scale);
  for (std::size_t screen = 0; screen < screens.size(); ++screen) {
    blocks.made.push_back({made[screen].screen, made[screen].block});
    blocks.shown.push_back({screens[screen].screen, screens[screen].block});
    for (const View& block : split_into_blocks(made[screen], kRasterLimit)) {
      blocks.views.push_back(block);
      blocks.screen_of.push_back(screen);
    }
  }
  return blocks;
}

namespace {

/// Per block the rank that shows its screen.
std::vector<int> block_owners(const Blocks& blocks, std::span<const int> shown_by) {
  std::vector<int> owners;
  for (const std::size_t screen : blocks.screen_of) owners.push_back(shown_by[screen]);
  return owners;
}

void to_display(std::span<const Rgb> radiance, std::span<const float> alpha, std::span<Rgba8> display,
                const DisplayTransform& transform, AlphaUse use) {
  std::ranges::transform(radiance, alpha, display.begin(),
                         [&](const Rgb& color, float covered) { return to_display(color, covered, transform, use); });
}

/// Converts a picture to display colours. `alpha`: of a transparent one.
Image<Rgba8> to_display(const Image<Rgb>& radiance, const std::optional<Image<float>>& alpha, int threads,
                        const DisplayTransform& transform, AlphaUse use) {
  Image<Rgba8> display(radiance.size());
  parallel_for(threads, static_cast<std::size_t>(radiance.height()), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    if (alpha) {
      to_display(radiance.row(y), alpha->row(y), display.row(y), transform, use);
    } else {
      to_display(radiance.row(y), display.row(y), transform);
    }
  });
  return display;
}

/// Converts a frame's tiles to display colours.
TileLayer<Rgba8> to_display(const Frame& frame, int threads, const DisplayTransform& transform, AlphaUse use) {
  const TileLayer<float>* const alpha = frame.alpha();
  TileLayer<Rgba8> display(frame.radiance.layout());
  for (const std::size_t tile : frame.owned) display.set_active(tile);
  parallel_for(threads, frame.owned.size(), [&](std::size_t i) {
    const std::size_t tile = frame.owned[i];
    if (alpha != nullptr) {
      to_display(frame.radiance.tile(tile), alpha->tile(tile), display.tile(tile), transform, use);
    } else {
      to_display(frame.radiance.tile(tile), display.tile(tile), transform);
    }
  });
  return display;
}

/// One value a pixel, by the filter of colours.
Image<float> enlarge(const Image<float>& values, const PicturePart& made, const PicturePart& shown, int threads) {
  Image<Rgb> grey(values.size());
  std::ranges::transform(values.pixels(), grey.pixels().begin(), [](float value) { return Rgb{value, value, value}; });
  const Image<Rgb> large = enlarge(grey, made, shown, threads);
  Image<float> result(large.size());
  std::ranges::transform(large.pixels(), result.pixels().begin(), &Rgb::r);
  return result;
}

}  // namespace

namespace {

BalanceReport gather_balance(Communicator& comm, Balance balance, const FrameWork& mine) {
  BalanceReport report{.balance = balance};
  std::vector<double> keys;
  std::vector<double> light;
  std::vector<double> both;
  for (const FrameWork& work : all_gather_value(comm, mine)) {
    keys.push_back(work.keys_ms);
    light.push_back(work.light_ms);
    both.push_back(work.keys_ms + work.light_ms);
    report.lent += work.lent;
  }
  report.keys = slowest_over_mean(keys);
  report.light = slowest_over_mean(light);
  report.slowest_over_mean = slowest_over_mean(both);
  return report;
}

}  // namespace

RunStats gather_stats(Session& session, const FramePlan& plan, const FrameTimes& times, const FrameCost& cost) {
  CountingCommunicator& comm = session.comm();
  RunStats stats;
  stats.ranks = comm.size();
  stats.plan = plan.explained;
  stats.passes = plan_passes(session.requirements(), plan.rays);
  stats.ms = slowest(comm, cost.ms);
  stats.times.push_back({plan.primary == Primary::Rays ? "primary-rays" : "raster", slowest(comm, times.primary_ms)});
  for (const PrimaryRayStats& traced : all_gather_value(comm, times.primary)) {
    stats.rays.primary += traced.rays;
    stats.rays.invalid += traced.invalid;
  }
  for (const RasterStats& drawn : all_gather_value(comm, times.raster)) stats.raster.join(drawn);
  if (plan.distribution == Distribution::SortMiddle)
    stats.times.push_back({"exchange-chunks", slowest(comm, times.chunk_exchange_ms)});
  stats.times.push_back({"composite", slowest(comm, times.composite_ms + times.move_ms)});
  // The shader adds up what its threads took; a frame waits for them side by side.
  for (const PassTime& pass : times.passes) {
    stats.times.push_back({pass.name, slowest(comm, pass.ms / session.threads()), pass.pass});
  }
  for (const RayCounts& counts : all_gather_value(comm, times.rays)) stats.rays += counts;
  if (stats.rays.not_finite > 0 && comm.rank() == 0) {
    const ScreenPixel& first = stats.rays.first_not_finite;
    log::warning("{} samples of pixels had no finite radiance and are black, the first in pixel {},{} of screen {}",
                 stats.rays.not_finite, first.x, first.y, first.screen);
  }
  stats.balance = gather_balance(comm, plan.balance, times.work);
  if (plan.verify_percent > 0.0) stats.verify = {plan.verify_percent, times.verified};
  stats.samples = times.samples;
  stats.samples_in_all = times.samples;
  for (const std::size_t sent : all_gather_value(comm, cost.bytes_sent)) stats.bytes_sent += sent;
  stats.memory_peak_bytes = all_gather_value(comm, peak_memory_bytes());
  if (const PartPages* const pages = session.scene().part_pages.get()) {
    stats.page_loads = all_gather_value(comm, pages->loads());
  }
  return stats;
}

namespace {

int scaled(int side, double scale) {
  return std::max(static_cast<int>(std::lround(side * scale)), 1);
}

/// Of `made` pixels of a side the first and one past the last that show some of `shown` ones.
std::pair<int, int> scaled_part(int first, int end, int shown, int made) {
  const auto at = [&](int edge) { return static_cast<int>(std::lround(static_cast<double>(edge) * made / shown)); };
  return {at(first), at(end)};
}

/// Those, and what enlarging takes of those before and after.
std::pair<int, int> enlarged_part(int first, int end, int shown, int made) {
  if (made == shown) return {first, end};
  const auto [made_first, made_end] = scaled_part(first, end, shown, made);
  return {std::max(made_first - 1, 0), std::min(made_end + 1, made)};
}

}  // namespace

std::vector<View> at_resolution(std::span<const View> screens, double scale) {
  std::vector<View> made(screens.begin(), screens.end());
  for (View& view : made) {
    const Size shown = view.screen;
    view.screen = {scaled(shown.width, scale), scaled(shown.height, scale)};
    const auto scaled_rect = [&](const Rect& rect, auto& part) {
      const auto [x0, x1] = part(rect.x0, rect.x1, shown.width, view.screen.width);
      const auto [y0, y1] = part(rect.y0, rect.y1, shown.height, view.screen.height);
      return Rect{x0, y0, x1, y1};
    };
    view.block = scaled_rect(view.block, enlarged_part);
    if (view.joined_part) view.joined_part->pixels = scaled_rect(view.joined_part->pixels, scaled_part);
  }
  return made;
}

namespace {

/// The first block of a screen; all of them have one lens and the size the screen was made in.
const View& first_block(const Blocks& blocks, std::size_t screen) {
  const auto block = std::ranges::find(blocks.screen_of, screen) - blocks.screen_of.begin();
  return blocks.views.at(static_cast<std::size_t>(block));
}

}  // namespace

std::vector<Image<Rgba8>> bring_to_screens(Session& session, Frame& frame, const Blocks& blocks,
                                           const Showing& showing) {
  const trace::Span span("bring to screens");
  const std::size_t screens = showing.sizes.size();
  bool as_made = true;
  for (std::size_t screen = 0; screen < screens; ++screen) {
    const Rect& pixels = blocks.shown[screen].pixels;
    HPR_CHECK((showing.sizes[screen] == Size{pixels.width(), pixels.height()}));
    as_made = as_made && blocks.made[screen].whole == blocks.shown[screen].whole;
  }
  const std::vector<int> owners = block_owners(blocks, showing.shown_by);
  TileLayer<Rgba8> display;  // a third of the bytes of the radiance, but no light to filter
  if (as_made) {
    display = to_display(frame, session.threads(), showing.transform, showing.alpha);
    session.assembler().assemble(session.comm(), display, frame.owned, owners);
  } else {
    session.assembler().assemble(session.comm(), frame.radiance, frame.owned, owners);
    if (frame.is_transparent) {
      session.assembler().assemble(session.comm(), frame.aovs.single.at(Aov::Coverage), frame.owned, owners);
    }
  }
  std::vector<Image<Rgba8>> pictures(screens);
  for (std::size_t screen = 0; screen < screens; ++screen) {
    if (showing.shown_by[screen] != session.rank()) continue;
    if (as_made) {
      pictures[screen] = join_blocks(display, blocks, screen, session.threads());
    } else {
      const PicturePart& made = blocks.made[screen];
      const PicturePart& shown = blocks.shown[screen];
      const int threads = session.threads();
      const Image<Rgb> radiance = enlarge(join_blocks(frame.radiance, blocks, screen), made, shown, threads);
      std::optional<Image<float>> alpha;
      if (frame.is_transparent) alpha = enlarge(join_blocks(*frame.alpha(), blocks, screen), made, shown, threads);
      pictures[screen] = to_display(radiance, alpha, session.threads(), showing.transform, showing.alpha);
    }
  }
  return pictures;
}

std::string advice_on(const Image<Rgba8>& picture) {
  constexpr double kTooMuch = 0.9;
  const auto share_of = [&](const auto& is) {
    // Once so many are otherwise that it is not too much, no more need be counted.
    const auto enough = static_cast<std::size_t>((1.0 - kTooMuch) * static_cast<double>(picture.size().area()));
    std::size_t there = 0;
    std::size_t others = 0;
    for (const Rgba8& color : picture.pixels()) {
      if (color.a == 0) continue;
      ++there;
      if (!is(color) && ++others > enough) return 0.0;
    }
    if (there > 0) return static_cast<double>(there - others) / static_cast<double>(there);
    return static_cast<double>(std::ranges::count_if(picture.pixels(), is)) /
           static_cast<double>(picture.size().area());
  };
  const double black = share_of([&](const Rgba8& color) { return (color.r | color.g | color.b) <= 1; });
  if (black > kTooMuch) {
    return fmt::format(
        "{:.0f} % of the picture is black: --environment studio adds light, --exposure auto brightens, --eye and --at "
        "look elsewhere; --explain says what lights the scene",
        100.0 * black);
  }
  const double clipped = share_of([&](const Rgba8& color) { return std::max({color.r, color.g, color.b}) == 255; });
  if (clipped > kTooMuch) {
    return fmt::format(
        "{:.0f} % of the picture is clipped: --exposure auto or fewer stops darken it, --tone neutral "
        "keeps bright colours apart",
        100.0 * clipped);
  }
  return {};
}

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
  if (files_.is_png()) transform_ = transform_for(session, frame, blocks.views, files_.display);
  if (display_colors) {
    display_ = to_display(frame, session.threads(), *transform_, AlphaUse::Straight);
    collect(display_);
  }
  // What is shown at another size than it was made in is enlarged on rank 0 before it is rounded to display colours.
  if (enlarged() && files_.is_png()) {
    collect(frame.radiance);
  } else if (files_.has_exr()) {
    collect_radiance(session, frame);
  }
  if (!files_.raw.empty() || std::ranges::any_of(files_.aovs, needs_keys)) collect(*frame.keys);
  for (auto& [aov, layer] : frame.aovs.rgb) collect(layer);
  const bool only_display = files_.picture.empty() || (display_colors && files_.aovs.empty());
  for (auto& [aov, layer] : frame.aovs.single) {
    if (!only_display) collect(layer);
  }
}

Image<Rgb> CollectedPicture::radiance() const {
  Image<Rgb> made = join_blocks(frame_.radiance, blocks_, 0);
  return enlarged() ? enlarge(made, size_, threads_) : made;
}

std::optional<Image<float>> CollectedPicture::alpha() const {
  if (!frame_.is_transparent) return std::nullopt;
  Image<float> made = join_blocks(*frame_.alpha(), blocks_, 0);
  return enlarged() ? enlarge(made, blocks_.made[0], blocks_.shown[0], threads_) : made;
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

namespace {

/// OpenEXR's alpha: the colours are multiplied by it.
ExrLayer alpha_layer(const Image<float>& alpha) {
  return {{"A"}, {alpha.pixels().begin(), alpha.pixels().end()}, {}};
}

}  // namespace

std::vector<ExrLayer> exr_layers(const Frame& frame, const Blocks& blocks, std::size_t screen,
                                 std::span<const Aov> aovs) {
  const View& view = first_block(blocks, screen);
  std::vector<ExrLayer> layers;
  if (frame.is_transparent) layers.push_back(alpha_layer(join_blocks(*frame.alpha(), blocks, screen)));
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
    const Image<Rgba8> colors = enlarged() ? to_display(radiance(), alpha(), threads_, *transform_, AlphaUse::Straight)
                                           : join_blocks(display_, blocks_, 0);
    write_png(files_.picture, colors, texts_of(*transform_));
    const std::string advice = transform_->shows.empty() ? advice_on(colors) : std::string();
    if (!advice.empty()) log::warning("{}", advice);
  }
  if (files_.is_png() && files_.aovs.empty()) return;
  const std::string exr = files_.is_png() ? files_.aov_file() : files_.picture;
  std::vector<ExrLayer> layers;
  if (!enlarged()) {
    layers = exr_layers(frame_, blocks_, 0, files_.aovs);
  } else if (frame_.is_transparent) {
    layers.push_back(alpha_layer(*alpha()));
  }
  write_file_atomically(exr, encode_exr(radiance(), {{"hpr:scene", scene_name}}, layers));
}

}  // namespace hpr
