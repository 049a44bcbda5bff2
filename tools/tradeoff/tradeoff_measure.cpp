#include "tools/tradeoff/tradeoff_measure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/timing.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "image/flip.h"
#include "image/image_io.h"
#include "image/metrics.h"
#include "rt/deferred_shader.h"
#include "tools/diff/diff.h"
#include "tools/report/canvas.h"

namespace hpr {
namespace {

/// Points are drawn again until they have taken so long, or often enough.
constexpr double kLongEnoughMs = 4000.0;

/// The reference's noise shall have nothing to do with the points'.
constexpr std::uint64_t kOtherSeed = 0x5EEDULL << 32U;

/// How a frame of one screen is made.
struct Setup {
  Blocks blocks;
  FramePlan plan;
  RenderSettings settings;  ///< resolved
};

Setup set_up(Session& session, const RenderSettings& unresolved, Size size, std::uint64_t seed) {
  Setup setup;
  setup.settings = resolve(unresolved, seed);
  const RenderSettings& settings = setup.settings;
  const View view = make_view(choose_camera(settings.camera, session.scene()), size, session.scene().bounds);
  setup.blocks = cut_blocks(std::span(&view, 1), settings.frame.resolution_scale);
  setup.plan = plan_frame(session, settings.frame, setup.blocks.views);
  return setup;
}

/// Collective. The radiance of a frame of one screen as an .exr would hold it, on rank 0.
Image<Rgb> collect(Session& session, Frame& frame, const Blocks& blocks, Size size, ColorFormat colors) {
  PictureFiles files;
  files.picture = "radiance.exr";
  files.colors = colors;
  const CollectedPicture picture(session, frame, blocks, size, files);
  return session.rank() == 0 ? picture.radiance() : Image<Rgb>();
}

bool caught_by_photons_alone(const Session& session) {
  const auto is_point = [](const Light& light) { return light.radius == 0.0 && light.angular_radius_radians == 0.0F; };
  return session.requirements().photon.needed && std::ranges::any_of(session.scene().lights, is_point);
}

/// [height][width][3]
std::vector<float> values_of(const Image<Rgb>& picture) {
  std::vector<float> values;
  values.reserve(picture.pixels().size() * 3);
  for (const Rgb& pixel : picture.pixels()) values.insert(values.end(), {pixel.r, pixel.g, pixel.b});
  return values;
}

std::vector<float> display_values(std::vector<float> values, double exposure_stops) {
  const auto gain = static_cast<float>(std::exp2(exposure_stops));
  std::ranges::transform(values, values.begin(), [gain](float value) { return encode_srgb(gain * value); });
  return values;
}

/// 0 without pixels.
double mean_of(const Image<Rgb>& picture) {
  double sum = 0.0;
  for (const Rgb& pixel : picture.pixels()) sum += pixel.r + pixel.g + pixel.b;
  return picture.pixels().empty() ? 0.0 : sum / (3.0 * static_cast<double>(picture.pixels().size()));
}

ReferencePicture read_reference(const std::string& path, Size size, const Globals& globals) {
  const FloatImage file = read_image(path, globals.picture_limits());
  if (file.size != size) {
    throw Error(ExitCode::BadInput,
                fmt::format("{} has {}x{} pixels, the pictures of the sweep {}x{}", path, file.size.width,
                            file.size.height, size.width, size.height),
                fmt::format("add --size {}x{}", file.size.width, file.size.height));
  }
  ReferencePicture reference;
  reference.about.how = path;
  reference.about.relmse = std::numeric_limits<double>::quiet_NaN();
  reference.linear = file.linear;
  reference.radiance = Image<Rgb>(size);
  const auto channel_index = [&](const char* channel) {
    return static_cast<std::size_t>(std::ranges::find(file.channels, channel) - file.channels.begin());
  };
  const std::size_t r = channel_index("R");
  const std::size_t g = channel_index("G");
  const std::size_t b = channel_index("B");
  const std::size_t channels = file.channels.size();
  if (std::max({r, g, b}) == channels) {
    throw Error(ExitCode::BadInput, fmt::format("{} has no channels R, G and B", path), "name a picture in colours");
  }
  for (std::size_t i = 0; i < size.area(); ++i) {
    const float* const pixel = file.values.data() + i * channels;
    const std::array<float, 3> color{pixel[r], pixel[g], pixel[b]};
    if (!all_finite(color)) {
      throw Error(ExitCode::BadInput, fmt::format("{} has colours that are not finite", path), "mend the picture");
    }
    reference.radiance.pixels()[i] = {color[0], color[1], color[2]};
  }
  reference.about.mean = mean_of(reference.radiance);
  return reference;
}

void report_extra_samples(std::uint32_t samples, std::uint32_t asked_for) {
  if (samples <= asked_for) return;
  log::info("the truth has {} samples, of an earlier run, where {} were asked for", samples, asked_for);
}

PictureError compare(const Image<Rgb>& picture, const ReferencePicture& reference, double exposure_stops,
                     std::span<const std::string> metrics, int threads, Image<float>* flip_map) {
  std::vector<float> ours = values_of(picture);
  std::vector<float> truth = values_of(reference.radiance);
  const Size size = picture.size();
  const std::vector<float> ours_shown = display_values(ours, exposure_stops);
  const std::vector<float> truth_shown = reference.linear ? display_values(truth, exposure_stops) : truth;
  if (!reference.linear) ours = ours_shown;
  const Difference difference = compare_values(ours, truth, 3);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const auto wanted = [&](const char* metric) { return asks_for(metrics, metric); };
  PictureError error;
  error.rmse = wanted("rmse") ? difference.rmse : unknown;
  const RelativeError relative = wanted("relmse") ? relative_error(ours, truth, 3) : RelativeError{unknown, unknown};
  error.relmse = relative.trimmed;
  error.relmse_all = relative.all;
  error.psnr = wanted("psnr") ? compare_values(ours_shown, truth_shown, 3).psnr : unknown;
  error.ssim = wanted("ssim") ? ssim(ours_shown, truth_shown, size, threads) : unknown;
  error.flip = unknown;
  if (wanted("flip")) {
    FlipError flip = flip_error(ours_shown, truth_shown, size, threads);
    error.flip = flip.mean;
    *flip_map = std::move(flip.map);
  }
  error.mean = difference.mean;
  error.mean_error = difference.mean_error;
  error.worst = difference.max;
  error.worst_pixel = difference.worst;
  return error;
}

template <typename Pixel, typename Convert>
std::string png_of(const Image<Pixel>& picture, const Rect& part, const Convert& convert) {
  Image<Rgba8> cut(Size{part.width(), part.height()});
  for (int y = 0; y < part.height(); ++y) {
    for (int x = 0; x < part.width(); ++x) cut.at(x, y) = convert(picture.at(part.x0 + x, part.y0 + y));
  }
  return base64(encode_png(cut));
}

}  // namespace

std::optional<ReferencePicture> find_reference(Session& session, const RenderSettings& settings,
                                               const TradeoffMeasurement& how, const Globals& globals,
                                               const std::filesystem::path& cache) {
  const bool rendered = how.reference == "auto" || how.reference == "path" || how.reference == "passes";
  ReferencePicture reference;
  if (!rendered) {
    check_on_root(session.comm(), [&] { reference = read_reference(how.reference, how.size, globals); });
    return reference;
  }
  const bool passes = how.reference == "passes" || (how.reference == "auto" && caught_by_photons_alone(session));
  RenderSettings best = settings;
  for (const Setting& setting : all_settings()) {
    if (setting.limits_reference) reset_setting(best, setting.name);
  }
  set_setting(best, "quality", "best");
  set_setting(best, "spp", std::to_string(how.reference_spp));
  set_setting(best, "reference", passes ? "false" : "true");
  const Setup setup = set_up(session, best, how.size, globals.seed ^ kOtherSeed);

  CheckpointSettings kept;
  RunIdentity identity = identity_of(session, setup.plan, setup.blocks.views, setup.settings, false);
  kept.identity = [&] { return identity; };
  std::string name;
  for (const auto& [key, value] : identity) name += fmt::format("{}={}\n", key, value);
  kept.path = cache / fmt::format("reference-{}.checkpoint", hex16(xxh64(std::as_bytes(std::span(name)))));
  kept.at_end = true;
  kept.takes_more = true;
  kept.resume = all_gather_value(session.comm(), std::filesystem::exists(kept.path) ? 1 : 0).front() == 1;

  const bool speaks = session.rank() == 0;
  const auto draw = [&](const CheckpointSettings& checkpoint, FrameSampler& sampler) {
    Progress progress(speaks ? globals.progress : "none", "reference sample", how.reference_spp);
    return sampler.draw(setup.blocks.views, checkpoint, progress);
  };
  prepare(session, setup.plan);
  std::optional<FrameSampler> sampler(std::in_place, session, setup.plan, setup.settings.sampling, 0, false);
  try {
    if (!draw(kept, *sampler)) return std::nullopt;
  } catch (const Error& error) {
    if (!kept.resume || error.code() != ExitCode::BadInput) throw;
    if (speaks) log::warning("{}: it is rendered again", error.what());
    kept.resume = false;
    sampler.emplace(session, setup.plan, setup.settings.sampling, 0, false);
    if (!draw(kept, *sampler)) return std::nullopt;
  }
  const SampleProgress reached = sampler->sample_progress();
  if (speaks) report_extra_samples(reached.samples, how.reference_spp);
  reference.radiance = collect(session, sampler->frame(), setup.blocks, how.size, ColorFormat::Float32);
  reference.about = {.how = passes ? "passes at best" : "path tracing",
                     .spp = reached.samples,
                     .relmse = reached.relmse.value_or(std::numeric_limits<double>::quiet_NaN()),
                     .mean = mean_of(reference.radiance),
                     .cached = kept.resume && sampler->times().samples == 0};
  return reference;
}

Rect most_detail(const Image<Rgb>& picture, int side) {
  const int width = std::min(side, picture.width());
  const int height = std::min(side, picture.height());
  const auto steps = [](int extent, int part) { return part > 0 ? std::max(1, 2 * (extent - part) / part + 1) : 1; };
  Rect best{0, 0, width, height};
  double max_detail = -1.0;
  for (int row = 0; row <= steps(picture.height(), height); ++row) {
    for (int column = 0; column <= steps(picture.width(), width); ++column) {
      const int x0 = std::min(column * width / 2, picture.width() - width);
      const int y0 = std::min(row * height / 2, picture.height() - height);
      double detail = 0.0;
      for (int y = y0; y < y0 + height; ++y) {
        for (int x = x0 + 1; x < x0 + width; ++x) {
          const Rgba8 a = to_srgb(picture.at(x - 1, y));
          const Rgba8 b = to_srgb(picture.at(x, y));
          detail += std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b);
        }
      }
      if (detail > max_detail) {
        max_detail = detail;
        best = {x0, y0, x0 + width, y0 + height};
      }
    }
  }
  return best;
}

std::string crop_as_png(const Image<Rgb>& picture, const Rect& part, bool linear) {
  const auto shown = [linear](float value) { return linear ? value : decode_srgb(value); };
  return png_of(picture, part, [&](const Rgb& pixel) {
    return to_srgb({shown(pixel.r), shown(pixel.g), shown(pixel.b)});
  });
}

TradeoffPoint measure_point(Session& session, const RenderSettings& settings, const KnobValues& knobs,
                            const TradeoffMeasurement& how, const Globals& globals, const ReferencePicture& reference,
                            const Rect& crop) {
  const Setup setup = set_up(session, with_knobs(settings, knobs), how.size, globals.seed);
  prepare(session, setup.plan);
  TradeoffPoint point;
  point.knobs = knobs;
  Image<Rgb> picture;
  double spent = 0.0;
  // What the first frame of new settings makes for all that follow is not a frame's own cost: where frames are quick,
  // one goes before those that count.
  for (int frame = 0; frame <= how.frames && (frame == 0 || spent < kLongEnoughMs); ++frame) {
    if (setup.plan.lit) session.shader(setup.plan.rays).discard_photons();  // of the same sample, in the frame before
    const std::size_t sent_before = session.comm().bytes_sent();
    const Stopwatch watch;
    Progress silent("none", "sample", 0);
    FrameSampler sampler(session, setup.plan, setup.settings.sampling, 0, false);
    (void)sampler.draw(setup.blocks.views, {}, silent);  // without a checkpoint it does not stop early
    picture = collect(session, sampler.frame(), setup.blocks, how.size, setup.settings.color_format);
    const RunStats stats =
        gather_stats(session, setup.plan, sampler.times(), {watch.ms(), session.comm().bytes_sent() - sent_before});
    spent += stats.ms;
    if (frame == 0 && spent < 0.5 * kLongEnoughMs) continue;
    point.ms.push_back(stats.ms);
    point.times = stats.times;
    point.rays = stats.rays;
    point.bytes_sent = stats.bytes_sent;
    point.samples = stats.samples;
  }
  agree_on_failure(session.comm(), [&] {
    if (session.rank() != 0) return;
    Image<float> flip;
    point.error = compare(picture, reference, settings.display.exposure_stops.value_or(0.0), how.metrics,
                          session.threads(), &flip);
    point.crop_png = crop_as_png(picture, crop, true);
    if (flip.size() == picture.size()) {
      point.flip_png = png_of(flip, crop, [](float value) { return heat_color(static_cast<double>(value)); });
    }
  });
  return point;
}

}  // namespace hpr
