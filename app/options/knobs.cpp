#include "app/options/knobs.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <vector>

#include "core/error.h"
#include "core/names.h"

namespace hpr {
namespace {

constexpr std::array kKnobs{
    Knob{"quality", "draft, good, best", "all of the below that are not given", "all of the below that are not given"},
    Knob{"spp", "1, 2, 3 ...; until:60s; until:relmse=1e-3", "time in proportion",
         "noise: its squared error falls as 1 / spp, faster where it is only edges"},
    Knob{
        "adaptive", "false, true", "a tenth of the time for as many samples, in more rounds of fewer pixels",
        "false: noise of the pixels whose samples differ most; true: a little of the mean, as pixels that look calm by "
        "chance get fewer samples"},
    Knob{
        "denoise", "false, true", "a sixth to one and a quarter times as much again of a frame's first 16 samples",
        "false: noise, and steps at outlines; true: detail of light finer than a pixel or two, less with more samples"},
    Knob{"passes", "auto, all, none, or a list of shadow, reflection, refraction, photon, gather, ambient-occlusion",
         "the rays of each pass", "the light a pass carries is missing, or there where it is blocked"},
    Knob{"indirect", "false, true",
         "photons wherever light meets rough surfaces, and a gather at every point; in the open under an even sky a "
         "ray at every point instead",
         "false: light that rough surfaces scatter on to others: a quarter of what a closed room shows"},
    Knob{"photons", "0 to 1000000000 a sample", "time in proportion, past the frame's pixels without use",
         "fewer photons gather from further away: caustics and indirect light blur; 0 leaves them out"},
    Knob{"photon-radius", "0 (from the photons' density) or metres", "nothing, but for gathers that meet more photons",
         "wide: caustics blur, corners darken; narrow: noise. It shrinks from sample to sample"},
    Knob{"resolution-scale", "0.1 to 1", "time in proportion to its square, but for what triangles take",
         "detail smaller than the pixels that are left, edges first"},
    Knob{"half-resolution", "none, or a list of photon, ambient-occlusion, reflection, refraction, shadow",
         "four times the points of those passes", "detail of that light where neighbours see the like"},
    Knob{"max-depth", "1 to 64", "rays between mirrors and through glass", "what is seen by more bounces is black"},
    Knob{"glossy-cutoff", "0 to 1: a roughness", "a ray for every smoother surface in view, and what it meets",
         "rougher surfaces reflect lights only, not the scene"},
    Knob{"light-samples", "1 to 4096 a point", "shadow rays in proportion", "noise in soft shadows"},
    Knob{"depth-format", "32f, 24, 16", "8, 7 or 6 bytes of a key sent between ranks",
         "order of surfaces closer than a step of depth; then the lower surface is seen"},
    Knob{"color-format", "32f, 16f, 8", "12, 6 or 4 bytes of a colour sent to where an .exr is written",
         "16f: 11 bits of a colour; 8: what a display shows"},
    Knob{"embree-quality", "low, medium, high", "time to build the ray scene, at the start",
         "low: rays take longer; no bit of a picture"},
    Knob{"deterministic", "on, off",
         "10 to 56 % of the rays a second where a processor has wider instructions than AVX2",
         "off: the same bits on machines of different instruction sets"},
    Knob{"filter", "box, triangle, gaussian, b-spline, mitchell", "nothing",
         "sharpness for smoothness, and the noise of wide filters"},
    Knob{"primary", "raster, rays, auto", "rasterising many triangles, or rays through many pixels",
         "at edges, 0.0025 to 0.045 % of pixels see another surface"},
    Knob{"shading", "deferred, local", "rays for what later turns out to be hidden",
         "local: colours of 8 bits are composited, and coplanar surfaces of different ranks show the brighter one"},
    Knob{"data", "replicated, partitioned",
         "partitioned: time and messages, as rays travel; replicated: the memory of a whole ray scene on each rank",
         "nothing: no bit of a picture"},
    Knob{"no-terminator-fix", "false, true", "nothing",
         "true: smooth surfaces of few triangles show their triangles where light grazes them"},
    Knob{"reference", "false, true", "path tracing in place of the passes: many more samples for the same noise",
         "false: what the passes leave out, caught by photons of some width"},
    Knob{"codec", "raw, lz4, zstd, jpeg, auto", "time to encode and decode, against time on the link",
         "jpeg: see --codec-quality; the others only what --codec-error allows", true},
    Knob{"codec-quality", "1 to 100", "bytes", "low: blocks and ringing at edges, colours first", true},
    Knob{"codec-error", "0 to 255 levels of 255, written 3 or 3/255", "0: up to twice the bytes of an error of 2",
         "so many levels at most, in every pixel and channel, whatever the codec", true},
};

}  // namespace

std::span<const Knob> all_knobs() {
  return kKnobs;
}

const Knob& find_knob(const std::string& name) {
  const auto found = std::ranges::find(kKnobs, name, &Knob::name);
  if (found != kKnobs.end() && !found->on_the_way) return *found;
  if (found != kKnobs.end()) {
    throw Error(ExitCode::Usage, fmt::format("'{}' changes no picture before it is sent", name),
                "hpr bench codec SCENE measures what it costs and loses");
  }
  std::vector<std::string> choices;
  for (const Knob& knob : kKnobs) {
    if (!knob.on_the_way) choices.emplace_back(knob.name);
  }
  throw Error(ExitCode::Usage, fmt::format("there is no knob '{}'", printable(name)), unknown_name_hint(name, choices));
}

void set_knob(RenderOptions& options, const std::string& knob, const std::string& value) {
  std::string written = value;
  std::ranges::replace(written, '+', ',');
  (void)find_knob(knob);
  try {
    set_option(options, knob, written);
  } catch (const CLI::ParseError& error) {
    throw Error(ExitCode::Usage, fmt::format("--vary {}={}: {}", knob, printable(value), error.what()),
                fmt::format("it takes {}", find_knob(knob).range));
  }
}

std::string knobs_text() {
  std::string text =
      "Settings that trade speed for accuracy, options of `hpr render` and `hpr wall run` alike.\n"
      "`hpr tradeoff SCENE --vary KNOB=V,V,...` measures what they cost and lose for a scene;\n"
      "for those of pictures on their way to displays (`hpr wall run`) `hpr bench codec SCENE` does.\n";
  for (const Knob& knob : kKnobs) {
    text +=
        fmt::format("\n--{}\n  takes  {}\n  costs  {}\n  loses  {}\n", knob.name, knob.range, knob.costs, knob.loses);
  }
  return text;
}

std::string knobs_markdown() {
  std::string text = "| Option | takes | costs | loses |\n|---|---|---|---|\n";
  for (const Knob& knob : kKnobs) {
    text += fmt::format("| `--{}` | {} | {} | {} |\n", knob.name, knob.range, knob.costs, knob.loses);
  }
  return text;
}

}  // namespace hpr
