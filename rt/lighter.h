#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"
#include "scene/requirements.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

struct RaySettings {
  std::vector<std::string> passes = {};  ///< by name; empty: as `auto_passes` says
  bool auto_passes = true;               ///< with no names: what the scene requires; false: none
  int max_depth = 8;                     ///< mirrors in a row
  int threads = 1;

  bool operator==(const RaySettings&) const = default;
};

/// Whether a pass runs for a scene, for --explain and --stats.
struct PassPlan {
  std::string name;
  bool runs = false;
  std::string why;
};

/// Rays traced, by kind, and what had to be left out.
struct RayCounts {
  std::uint64_t primary = 0;
  std::uint64_t shadow = 0;
  std::uint64_t reflection = 0;
  std::uint64_t refraction = 0;
  std::uint64_t ambient_occlusion = 0;
  std::uint64_t photon = 0;
  std::uint64_t invalid = 0;     ///< of those above, rays Embree could not bear: they missed
  std::uint64_t not_finite = 0;  ///< pixels whose radiance was no finite number: they are black

  RayCounts& operator+=(const RayCounts& other);
  bool operator==(const RayCounts&) const = default;
};

struct PassTime {
  std::string name;  ///< a pass, or "surface" and "direct", which always run
  double ms = 0.0;   ///< summed over threads
};

[[nodiscard]] std::vector<std::string> all_pass_names();

/// Every pass, in the order they run, for a scene that requires so much. Throws Error (Usage) for a name in `settings`
/// that is no pass.
[[nodiscard]] std::vector<PassPlan> plan_passes(const Requirements& scene, const RaySettings& settings);

/// Turns keys into radiance: reconstructs the surface each key names, adds emission and direct light, then what the
/// planned passes add. A pixel's value depends on its key, its view and the scene only; threads, tile lists and ranks
/// change no bit.
class Lighter {
 public:
  /// Builds the ray scene if a planned pass needs one. The scene must outlive this. Throws Error: Usage for an unknown
  /// pass, NoDevice when Embree fails. Finding out what a scene requires looks at every texel once.
  Lighter(const Scene& scene, RaySettings settings, const Requirements& requirements);
  Lighter(const Scene& scene, const RaySettings& settings) : Lighter(scene, settings, requirements_of(scene)) {}
  ~Lighter();
  Lighter(const Lighter&) = delete;
  Lighter& operator=(const Lighter&) = delete;
  Lighter(Lighter&&) noexcept;
  Lighter& operator=(Lighter&&) noexcept;

  /// Lights the pixels of `tiles` (indices into the layout of `keys`; screen i of it is seen by views[i], of equal
  /// size) and makes them active. The background stands where a key is 0. `radiance` has the same layout; its other
  /// tiles stay as they are. Values are finite.
  void light(std::span<const View> views, const TileLayer<Key>& keys, std::span<const std::size_t> tiles,
             TileLayer<Rgb>& radiance);

  /// Of the last light().
  [[nodiscard]] const RayCounts& counts() const;
  [[nodiscard]] const std::vector<PassTime>& times() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// `--shading local`: lights `tiles` of `keys` and puts the display colour where the surface id stood, so that the
/// nearest key carries its pixel's colour. Pixels without a key stay so. Of equal depths on different ranks the larger
/// colour word wins, so coplanar surfaces may look different with another number of ranks.
void shade_local(Lighter& lighter, std::span<const View> views, TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles);

}  // namespace hpr
