#include "scene/load_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/text.h"
#include "scene/generators/generators.h"
#include "scene/points_lines.h"
#include "scene/studio.h"
#include "scene/view.h"

namespace hpr {
namespace {

constexpr std::string_view kGenerated = "gen:";

std::vector<SceneImporter> all_importers() {
#define HPR_IMPORTER(name) name##_importer(),
  return {HPR_SCENE_IMPORTERS(HPR_IMPORTER)};
#undef HPR_IMPORTER
}

/// The extension of a file name in small letters, with its dot.
std::string extension_of(const std::string& name) {
  std::string extension = std::filesystem::path(name).extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return extension;
}

/// The importer that has the file's extension, else the first, whose errors say what can be read.
SceneImporter importer_for(const std::string& source) {
  const std::vector<SceneImporter> importers = all_importers();
  const std::string extension = extension_of(source);
  const auto found = std::ranges::find_if(importers, [&](const SceneImporter& importer) {
    return std::ranges::find(importer.extensions, extension) != importer.extensions.end();
  });
  return found == importers.end() ? importers.front() : *found;
}

/// Throws Error (Usage) for a choice that a generated scene does not give.
void check_generated(const std::string& source, const SceneChoice& choice) {
  const auto refuse = [&](std::string_view kind, const std::string& wanted, std::string_view hint) {
    throw Error(ExitCode::Usage, fmt::format("{} has no {} '{}'", printable(source), kind, printable(wanted)),
                std::string(hint));
  };
  if (!choice.scene.empty() && choice.scene != "0") refuse("scene", choice.scene, "it is one scene, 0");
  if (!choice.variant.empty()) refuse("variant", choice.variant, "it has none at all: leave --variant out");
}

constexpr float kMaxRadiance = 1e12F;  ///< radiance a user may ask for
constexpr float kMaxHalf = 65504.0F;

/// Three numbers with commas between; none for anything else.
std::optional<std::array<float, 3>> three_numbers(std::string_view text) {
  std::array<float, 3> numbers{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, numbers[i]);
    if (error != std::errc()) return std::nullopt;
    at = rest;
  }
  return at == end ? std::optional(numbers) : std::nullopt;
}

float cleaned(float value) {
  if (!(value > 0.0F)) return 0.0F;
  return std::isfinite(value) ? value : kMaxHalf;
}

/// Where the channels R, G, B of a picture stand; grey pictures have the same one three times.
std::array<std::size_t, 3> color_channels(const FloatImage& picture, const std::string& name) {
  const auto find = [&](std::string_view channel) {
    return static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin());
  };
  const std::size_t none = picture.channels.size();
  const std::array<std::size_t, 3> rgb{find("R"), find("G"), find("B")};
  if (std::ranges::count(rgb, none) == 0) return rgb;
  const std::size_t grey = find("Y");
  if (grey < none || none <= 2) return {grey % none, grey % none, grey % none};
  throw Error(ExitCode::BadInput, fmt::format("{}: the picture has no channels R, G and B", name),
              "convert it to a picture with red, green and blue");
}

}  // namespace

LoadedScene load_unshaped_scene(const std::string& source, const SceneLimits& limits, const SceneChoice& choice,
                                bool in_parts) {
  if (!source.starts_with(kGenerated)) return importer_for(source).load(source, limits, choice, in_parts);
  check_generated(source, choice);
  Scene scene = generate_scene(std::string_view(source).substr(kGenerated.size()));
  if (const std::uint64_t bytes = memory_of(scene); bytes > limits.memory_bytes) {
    throw Error(ExitCode::Limit,
                fmt::format("{}: needs {} bytes, more than the limit of {}", source, bytes, limits.memory_bytes),
                "choose a smaller scene, or raise --limit-mem");
  }
  LoadedScene loaded(std::move(scene));
  loaded.in_parts = in_parts;
  loaded.memory_limit = limits.memory_bytes;
  return loaded;
}

Scene load_scene(const std::string& source, const SceneLimits& limits, const SceneChoice& choice) {
  Scene scene = load_unshaped_scene(source, limits, choice).scene;
  if (!has_points_or_lines(scene)) return scene;
  const Camera camera = scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front();
  const View view = make_view(camera, kDefaultPictureSize, scene.bounds);
  shape_points_and_lines(scene, {}, std::span(&view, 1), limits.memory_bytes);
  return scene;
}

std::vector<std::filesystem::path> files_of_scene(const std::string& source, const SceneLimits& limits) {
  if (source.starts_with(kGenerated)) return {};
  std::vector<std::filesystem::path> files{source};
  const std::vector<std::filesystem::path> beside = importer_for(source).files_beside(source, limits);
  files.insert(files.end(), beside.begin(), beside.end());
  return files;
}

std::optional<Rgb> parse_radiance(const std::string& text) {
  const auto numbers = three_numbers(text);
  if (!numbers) return std::nullopt;
  for (const float radiance : *numbers) {
    if (radiance >= 0.0F && radiance <= kMaxRadiance) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is no radiance", printable(text)),
                "give three numbers from 0 to 1e12");
  }
  return Rgb{(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

Environment load_environment(const std::string& text, const ImageLimits& limits) {
  if (const auto radiance = parse_radiance(text)) return {Image<Rgb>({1, 1}, *radiance)};
  if (text == kStudioName) return make_studio();
  const std::string extension = extension_of(text);
  if (extension != ".hdr" && extension != ".exr" && extension != ".png" && extension != ".jpg" &&
      extension != ".jpeg") {
    throw Error(ExitCode::Usage, fmt::format("'{}' is no environment", printable(text)),
                "name a .hdr, .exr, .png or .jpg picture, give a radiance as R,G,B, or write studio or none");
  }
  return environment_of(read_image(text, limits), printable(text));
}

Environment environment_of(const FloatImage& picture, const std::string& name) {
  const std::array<std::size_t, 3> rgb = color_channels(picture, name);
  Environment environment{Image<Rgb>(picture.size)};
  const auto value = [&](std::size_t pixel, std::size_t channel) {
    const float stored = picture.values[pixel * picture.channels.size() + rgb[channel]];
    if (!std::isfinite(stored) && environment.not_finite++ == 0) environment.first_not_finite = pixel;
    if (picture.linear) return cleaned(stored);
    return srgb_to_linear(static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(stored, 0.0F, 1.0F))));
  };
  const std::span<Rgb> pixels = environment.image.pixels();
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = {value(i, 0), value(i, 1), value(i, 2)};
  return environment;
}

}  // namespace hpr
