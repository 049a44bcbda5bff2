#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "image/image_io.h"
#include "scene/load_scene.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// Numbers that are none, in files and out of sums too large for a float: refused, or counted and replaced, and never in
// a picture.
namespace hpr::stability {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr std::array kBad{kNan, kInfinite, -kInfinite};

/// A glTF file of one triangle, three floats a vertex and attribute; `bad` stands in the attribute's second vertex.
std::string write_triangle(const TemporaryFile& file, const std::string& attribute, float bad) {
  std::vector<float> values{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1};
  const bool position = attribute == "POSITION";
  const std::size_t width = attribute == "TEXCOORD_0" ? 2 : 3;
  std::vector<float> own(values.begin() + (position ? 0 : 9), values.begin() + (position ? 9 : 18));
  own.resize(3 * width);
  own[width] = bad;
  values.insert(values.end(), own.begin(), own.end());
  Json json = Json::parse(R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]},
                 {"bufferView":1,"componentType":5126,"type":"VEC3","count":3}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":36}]})");
  json["buffers"].push_back(
      {{"uri", "data:application/octet-stream;base64," + base64(std::as_bytes(std::span(values)))},
       {"byteLength", values.size() * sizeof(float)}});
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 72}, {"byteLength", own.size() * sizeof(float)}});
  json["accessors"].push_back(
      {{"bufferView", 2}, {"componentType", 5126}, {"type", width == 2 ? "VEC2" : "VEC3"}, {"count", 3}});
  if (position) {
    json["accessors"][2]["min"] = Json::array({0, 0, 0});
    json["accessors"][2]["max"] = Json::array({1, 1, 0});
  }
  json["meshes"][0]["primitives"][0]["attributes"][attribute] = 2;
  std::ofstream(file.path()) << json.dump();
  return file.path().string();
}

StabilityFinding geometry(const TemporaryFile& file) {
  StabilityFinding let_in = make_finding("not-finite/geometry", "NaN and infinities in a glTF file's positions", 0.0,
                                         "files drawn", "nothing can stand in for a place");
  for (const float bad : kBad) {
    try {
      (void)load_scene(write_triangle(file, "POSITION", bad), {});
      ++let_in.measured;
    } catch (const Error& error) {
      if (error.code() != ExitCode::BadInput) ++let_in.measured;
    }
  }
  return let_in;
}

StabilityFinding attributes(const TemporaryFile& file, int threads) {
  StabilityFinding odd = make_finding(
      "not-finite/attributes", "the same in normals, texture coordinates and vertex colours", 0.0,
      "files miscounted, pixels without finite radiance", "each is counted, its vertex named, and replaced");
  for (const char* const attribute : {"NORMAL", "TEXCOORD_0", "COLOR_0"}) {
    for (const float bad : kBad) {
      const Scene scene = load_scene(write_triangle(file, attribute, bad), {});
      const bool named = std::ranges::any_of(scene.warnings, [&](const std::string& text) {
        return text.find(attribute) != std::string::npos && text.find("vertex 1") != std::string::npos;
      });
      odd.measured += scene.not_finite == 1 && named ? 0.0 : 1.0;
      const View view = make_view(framing_camera(scene.bounds), {64, 64}, scene.bounds);
      RaySettings settings;
      settings.threads = threads;
      odd.measured += static_cast<double>(lit_picture(scene, view, settings).counts.not_finite);
    }
  }
  return odd;
}

StabilityFinding environment(const TemporaryFile& file, int threads) {
  StabilityFinding odd = make_finding("not-finite/environment", "every seventh value of an EXR environment, 48 of 336",
                                      0.0, "values miscounted, pixels without finite radiance",
                                      "NaN becomes 0, infinity the largest half float");
  Image<Rgb> image({16, 7}, {0.5F, 0.5F, 0.5F});
  std::uint64_t planted = 0;
  std::size_t number = 0;
  for (Rgb& pixel : image.pixels()) {
    for (float* const channel : {&pixel.r, &pixel.g, &pixel.b}) {
      if (number++ % 7 == 3) *channel = kBad.at(planted++ % kBad.size());
    }
  }
  const std::vector<std::byte> sky = encode_exr(image, {});
  std::ofstream(file.path(), std::ios::binary)
      .write(reinterpret_cast<const char*>(sky.data()), static_cast<std::streamsize>(sky.size()));
  Scene scene;
  add_placed(scene, parallelogram({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}), mirror(0.9F), glm::dmat4(1.0));
  scene.environment = environment_of(read_image(file.path(), {}), "sky");
  finish_scene(scene);
  odd.measured = std::abs(static_cast<double>(scene.environment->not_finite) - static_cast<double>(planted));
  odd.measured += scene.environment->first_not_finite == 1 ? 0.0 : 1.0;
  const View view = make_view(look_at({0.3, 1.0, 1.5}, {0, 0, 0}, {0, 1, 0}, 1.2), {64, 64}, scene.bounds);
  RaySettings settings;
  settings.threads = threads;
  odd.measured += static_cast<double>(lit_picture(scene, view, settings).counts.not_finite);
  return odd;
}

/// A floor that glows, lit by 8 lights of the same radiance.
RayCounts glare(double radiance, int threads) {
  Scene scene;
  Material material = diffuse();
  material.emissive = glm::vec3(static_cast<float>(radiance));
  add_placed(scene, parallelogram({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}), material, glm::dmat4(1.0));
  for (int i = 0; i < 8; ++i) {
    Light light;
    light.type = LightType::Directional;
    light.direction = {0.0F, -1.0F, 0.0F};
    light.intensity = glm::vec3(static_cast<float>(radiance));
    scene.lights.push_back(light);
  }
  finish_scene(scene);
  View view = make_view(look_at({0.0, 1.0, 0.01}, {0, 0, 0}, {0, 1, 0}, 0.8), {130, 70}, scene.bounds);
  view.screen = {1000, 1000};
  view.block = {300, 200, 430, 270};
  return lit_picture(scene, view, only({}, threads)).counts;
}

std::vector<StabilityFinding> overflow() {
  StabilityFinding bright =
      make_finding("not-finite/overflow", "a floor of radiance 1 .. 9e37 under eight suns of the same", 0.0,
                   "pixels without finite radiance", "sums run in double: 1 + 8 / pi of it fits a float");
  bright.curve.x = "radiance";
  for (const double radiance : {1.0, 1e20, 1e30, 9e37}) {
    const auto count = static_cast<double>(glare(radiance, 1).not_finite);
    add_point(bright, radiance, count);
  }
  bright.breaks_at =
      breaking_point_if_any(9e37, 3.4e38, 0.01, [](double radiance) { return glare(radiance, 1).not_finite == 0; });

  StabilityFinding named =
      make_finding("not-finite/first-pixel", "past that, the first pixel named by 1, 2 and 3 threads", 0.0,
                   "answers that differ or are wrong", "the smallest in order of rows, whoever meets it");
  const RayCounts one = glare(3.4e38, 1);
  if (one.not_finite != std::uint64_t{130} * 70 || one.first_not_finite != ScreenPixel{0, 200, 300}) ++named.measured;
  for (const int threads : {2, 3}) named.measured += glare(3.4e38, threads) == one ? 0.0 : 1.0;
  return {bright, named};
}

std::vector<StabilityFinding> measure_not_finite(const Globals& globals) {
  const int threads = threads_of(globals);
  const TemporaryFile file;
  std::vector<StabilityFinding> all{geometry(file), attributes(file, threads), environment(file, threads)};
  for (StabilityFinding& one : overflow()) all.push_back(std::move(one));
  return all;
}

}  // namespace

StabilityCase not_finite_case() {
  return {"not-finite", "NaN and infinities in files and sums: refused or counted, never shown", measure_not_finite};
}

}  // namespace hpr::stability
