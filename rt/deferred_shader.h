#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"
#include "rt/passes/pass_id.h"
#include "rt/ray_counts.h"
#include "rt/ray_settings.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/ray_scene.h"
#include "scene/requirements.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

class Communicator;
class RayScene;
class RayForwarding;
class TileShader;
struct ShadingInputs;

/// Makes what lights in the CPU's stead, see rt/tile_shader.h; null where that is to be the CPU.
using MakeTileShader = std::function<std::unique_ptr<TileShader>(const ShadingInputs& inputs)>;

/// Layers that shading writes, all of one layout; null where not wanted.
struct LightOutput {
  TileLayer<Rgb>* radiance = nullptr;
  std::array<TileLayer<Rgb>*, kComponents> components{};
  TileLayer<Rgb>* normal = nullptr;      ///< unit length, world, on the viewer's side; 0 where nothing is seen
  TileLayer<Rgb>* albedo = nullptr;      ///< base colour of the first surface
  TileLayer<float>* cost = nullptr;      ///< rays traced for the pixel
  TileLayer<float>* coverage = nullptr;  ///< fraction of the pixel that surfaces cover
};

/// One of several samples of a frame that are shaded together.
struct ShadedSample {
  std::span<const View> views;  ///< those of the samples differ by their jitter only
  const TileLayer<Key>* keys = nullptr;
  LightOutput output;
  SampleNumber number;
  const PixelMask* wanted = nullptr;  ///< pixels that are shaded; null: all. What is stored elsewhere means nothing
};

/// Rows of a tile that are shaded at once, maybe for the rank that has the tile.
struct ShadedPart {
  std::size_t tile = 0;
  int first_row = 0;          ///< of the tile
  int end_row = kTileSide;    ///< past the last
  const Key* keys = nullptr;  ///< sample after sample those of the whole tile; null: they stand in the samples
  std::span<const std::uint8_t> wanted = {};  ///< where keys are not null: the tile's mask, in place of the samples'
};
/// Called by any thread: what it is to shade next; none once all is drawn.
using NextPart = std::function<std::optional<ShadedPart>()>;

/// Turns keys into radiance: reconstructs the surface each key names, adds emission and direct light, then what the
/// planned passes add. A pixel's value depends on its key, its view and the scene only; threads, tile lists and ranks
/// change no bit.
class DeferredShader {
 public:
  /// Where rays through the surfaces that cover all behind them come from (covering_surfaces); called once, and only if
  /// a planned pass needs them. They outlive the shader.
  using RaySource = std::function<const RayScene&()>;

  /// Builds a ray scene of its own if a planned pass needs one and there is no `rays`. The scene must outlive this, and
  /// so must `forwarding`, by which rays reach what is not in `settings.part`: then shade() and this constructor are
  /// collective. Throws Error: Usage for an unknown pass, NoDevice when Embree fails. Finding out what a scene requires
  /// reads every texel once.
  /// `make_device`: called once; what it makes lights what it can.
  DeferredShader(const Scene& scene, RaySettings settings, const Requirements& requirements, const RaySource& rays = {},
                 RayForwarding* forwarding = nullptr, const MakeTileShader& make_device = {});
  DeferredShader(const Scene& scene, const RaySettings& settings)
      : DeferredShader(scene, settings, requirements_of(scene)) {}
  ~DeferredShader();
  DeferredShader(const DeferredShader&) = delete;
  DeferredShader& operator=(const DeferredShader&) = delete;
  DeferredShader(DeferredShader&&) noexcept;
  DeferredShader& operator=(DeferredShader&&) noexcept;

  /// Collective over `comm`, whose ranks shade parts of one frame with equal settings: traces the photons of the sample
  /// that is shaded next, if a planned pass needs any, every rank its share. Without this call shade() traces all of
  /// them itself; pictures are equal. False on all ranks where `is_overtaken`, which any thread asks, on any of them
  /// before it was done: the sample is not to be shaded then.
  bool trace_photons(Communicator& comm, const SampleNumber& number = {},
                     const std::function<bool()>& is_overtaken = {});

  /// Discards the photon maps of the last sample, so that shading it once more takes as long as the first time.
  void discard_photons();

  /// Shades the pixels of `tiles` (indices into the layout of `keys`; screen i of it is seen by views[i], of equal
  /// size) and makes them active in all layers of `output`, whose other tiles stay as they are. The background stands
  /// where a key is 0. Values are finite.
  void shade(std::span<const View> views, const TileLayer<Key>& keys, std::span<const std::size_t> tiles,
             const LightOutput& output, const SampleNumber& number = {});

  /// Shades several samples of one frame together; in less time than one by one where what they share stays in the
  /// cache, and with the same bits. Not where shades_one_by_one().
  /// `is_overtaken`: asked before each tile, by any thread; once it is true the tiles that are left mean nothing.
  void shade(std::span<const ShadedSample> samples, std::span<const std::size_t> tiles,
             const std::function<bool()>& is_overtaken = {});
  /// Shades parts of tiles as `next` hands them out; pixels go to the samples' output, where the caller has made the
  /// tiles active that it needs so. Not where is_whole().
  void shade(std::span<const ShadedSample> samples, const NextPart& next);
  /// Whether a list of tiles must be shaded as a whole: the reference, and rays that travel.
  [[nodiscard]] bool is_whole() const;
  /// Whether no part may be less than a tile: filters look about in it.
  [[nodiscard]] bool shades_whole_tiles() const;
  /// Of the last shade(): what each tile or part took, in no order; nothing of the reference.
  [[nodiscard]] std::span<const TileCost> costs() const;
  /// Whether samples must be shaded one by one: with photons, the reference, or half-resolution passes.
  [[nodiscard]] bool shades_one_by_one() const;

  /// The rays traced by the last shade(), and the time its steps took.
  [[nodiscard]] const RayCounts& counts() const;
  [[nodiscard]] const std::vector<PassTime>& times() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// `--shading local`: shades `tiles` of `keys` and puts the display colour where the surface id stood, so that the
/// nearest key carries its pixel's colour. Pixels without a key stay so. Of equal depths on different ranks the larger
/// colour word wins, so coplanar surfaces may show another color with another number of ranks.
void shade_local(DeferredShader& shader, std::span<const View> views, TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, const SampleNumber& number = {});

/// The pixels that shade_local leaves without a colour, once no rank has a key for them: of `tiles`, those of `keys`
/// without one get in `output`, its radiance and its coverage, what is there (background, environment, surfaces that
/// cover in part); the others keep theirs. Collective where shade() is.
void shade_empty(DeferredShader& shader, std::span<const View> views, const TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, const LightOutput& output, const SampleNumber& number = {});

}  // namespace hpr
