#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/reference/path_tracer.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"

namespace hpr {

/// What all paths share.
struct PathScene {
  const Scene& scene;
  const RayScene& rays;
  const LightSet& lights;
  RaySpace space;
  Surfaces surfaces;
  PathSettings settings;
  bool has_coverage = false;  ///< some material lets rays pass by its alpha
};

/// A path on its way from the eye: the ray it goes next, and what must be known of the place it comes from.
struct Path {
  glm::dvec3 origin{0.0};  ///< world
  glm::dvec3 direction{0.0, 0.0, -1.0};
  glm::dvec3 throughput{1.0};  ///< what of the radiance met reaches the pixel
  glm::dvec3 followed{1.0};    ///< the part of throughput that came by lobes the passes follow
  glm::dvec3 from{0.0};        ///< where it was scattered last, and the normal (light_normal) lights were chosen by
  glm::dvec3 from_normal{0.0};
  double pdf = 0.0;        ///< of the direction it was sent in, per solid angle; 0: the only one
  double squeeze = 1.0;    ///< the part of throughput that is radiance squeezed by refraction, not energy lost
  double travelled = 0.0;  ///< metres before its origin: from the eye to the near plane
  double reach = 0.0;      ///< metres
  Media media;             ///< that the ray goes through
  Sampler sampler;
  std::uint32_t pixel = 0;
  int segments = 1;  ///< including the one ahead
  int passed = 0;    ///< surfaces since the last scattering, by chance
  Passed last;       ///< of those
};

/// Light on its way to a path's surface, if nothing stands between.
struct ShadowRay {
  glm::dvec3 origin{0.0};  ///< world
  glm::dvec3 direction{0.0};
  double reach = 0.0;        ///< metres
  glm::dvec3 radiance{0.0};  ///< what reaches the pixel
  std::uint32_t pixel = 0;
  int passed = 0;  ///< surfaces, by their coverage
  Passed last;     ///< of those
};

/// The paths of some pixels, all in step: each step traces the rays of every path sorted by the lobe that sent them,
/// adds the light found, and leaves one ray or none for each path. So there are never more rays in flight than pixels.
class PathWave {
 public:
  explicit PathWave(const PathScene& shared) : shared_(shared) {}

  /// Starts with black pixels and no paths.
  void start(const View& view, std::size_t pixels);
  void add(const Path& path);
  /// Until every path has ended.
  void run();

  [[nodiscard]] const glm::dvec3& radiance(std::size_t pixel) const { return radiance_[pixel]; }
  [[nodiscard]] PathCounts& counts() { return counts_; }

 private:
  /// In this order rays are traced: neighbours in a packet go about the same way. Those of the eye go first.
  static constexpr std::size_t kKinds = 1 + kLobes.size();
  static std::size_t kind_of(Lobe lobe) { return 1 + static_cast<std::size_t>(lobe); }

  void trace_paths();
  void arrive(Path& path, std::size_t kind, const Passed& met);
  /// Of the batch's rays. Where some materials let rays pass, met_ says what each has passed, and then what it met.
  void find_hits();
  void miss(const Path& path);
  void add_emission(const Path& path, const SurfacePoint& point, std::uint32_t surface, const glm::dvec3& emission);
  void scatter(Path& path, const SurfacePoint& point, const MaterialPoint& material);
  void ask_light(Path& path, const SurfacePoint& point, const MaterialPoint& material, const Bsdf& bsdf,
                 const std::array<double, kLobes.size()>& chances);
  bool survives(Path& path);
  void trace_shadows();
  void pass_covers();

  const PathScene& shared_;
  const View* view_ = nullptr;
  std::array<std::vector<Path>, kKinds> paths_;
  std::array<std::vector<Path>, kKinds> next_;
  std::vector<ShadowRay> shadows_;
  std::vector<glm::dvec3> radiance_;
  PathCounts counts_;
  RayBatch batch_;
  std::vector<std::uint32_t> hits_;
  std::vector<Passed> met_;  ///< by the same rays; only where some materials let rays pass
  std::vector<std::uint8_t> blocked_;
  WorldTriangle triangle_;
};

}  // namespace hpr
