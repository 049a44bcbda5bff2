#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "image/tiles.h"
#include "raster/raster_speed.h"
#include "rt/ray_settings.h"
#include "scene/load_scene.h"
#include "scene/requirements.h"
#include "scene/scene.h"

namespace hpr {

class Assembler;
class Compositor;
class GlContext;
class DeferredShader;
class LoadBalance;
class PrimaryRays;
class Rasterizer;
class RayScene;
class GpuDevice;
class GpuPrimaryRays;
class RayForwarding;
class TileGather;
struct SceneChunks;

/// The backend by which a device makes keys, see GpuPrimaryRays; OpenGL is then used only where it is asked for.
inline constexpr std::string_view kVulkan = "vulkan";

/// What a session uses of the machine that each of its ranks runs on.
struct SessionSettings {
  std::string backend = "auto";  ///< OpenGL by it, see GlOptions; or kVulkan. "auto": keys and light by GPUs too
  int device = -1;               ///< of Vulkan with kVulkan, else of EGL; -1: by local rank
  int threads = 0;               ///< of one rank; 0: the machine's cores divided among the ranks of a host
};

/// What stays resident while frames follow one another: the scene, the GL context, geometry on the GPU, the ray scene,
/// the frame's memory. One per rank; construction is collective.
class Session {
 public:
  /// `load` runs on rank 0 alone. Starts OpenGL where the settings name a backend of it or a device, and GPUs where
  /// they leave the choice and all ranks have one.
  Session(Communicator& comm, const SessionSettings& settings, const std::function<LoadedScene()>& load);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Collective. Another scene in this one's place; when it cannot be loaded, this one stays.
  void load(const std::function<LoadedScene()>& load);
  /// Collective. Changes the scene, alike on every rank. What was made of the old scene is made again when it is
  /// needed.
  void change_scene(const std::function<void(Scene&)>& change);
  /// Collective, before a frame: gives back the memory of textures that were not used for long, where they may come
  /// again and are more than a host may hold.
  void forget_unused_texels() {
    if (scene_.texel_store) scene_.texel_store->forget_unused();
  }

  [[nodiscard]] CountingCommunicator& comm() { return comm_; }
  [[nodiscard]] int rank() const { return comm_.rank(); }
  [[nodiscard]] int ranks() const { return comm_.size(); }
  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const Requirements& requirements() const { return requirements_; }
  [[nodiscard]] int threads() const { return host_.threads; }
  [[nodiscard]] const std::string& host() const { return host_.host; }
  /// The ranks of this host.
  [[nodiscard]] int host_ranks() const { return host_.ranks; }
  /// Collective. Starts OpenGL where it does not run yet, which costs more than a small picture by rays. Compares the
  /// ranks' rasterisers and names those that differ. Throws Error (NoDevice) on all ranks where one has no OpenGL.
  void start_gl();
  /// Collective. Whether the CPU of any rank does OpenGL's work; starts OpenGL only where a rank may have a GPU.
  [[nodiscard]] bool draws_by_software();
  /// How fast OpenGL draws on this rank; after start_gl().
  [[nodiscard]] RasterSpeed measure_raster();
  /// Renderer, version and device of OpenGL, for people.
  [[nodiscard]] std::string gl_description() const;
  /// By which route this rank's OpenGL, once started, has its keys read.
  [[nodiscard]] std::string_view key_route() const;
  /// The GPU that OpenGL draws by on this rank, with its host; empty: none does.
  [[nodiscard]] std::string gpu() const;
  [[nodiscard]] Assembler& assembler() { return *assembler_; }
  /// What composites where groups follow the view.
  [[nodiscard]] TileGather& tile_gather() { return *tile_gather_; }
  /// What ranks know of each other's work.
  [[nodiscard]] LoadBalance& balance() { return *balance_; }

  /// The chunks of the scene's surfaces that have keys; made when first asked for, kept until the scene changes.
  [[nodiscard]] const SceneChunks& scene_chunks();
  /// Calls `draw` with `objects`; where this rank's part of the scene is in pages, once for each page with those of
  /// them that it has, while the scene has their triangles. What travelling rays need is made before (partition_rays).
  void draw_pages(std::span<const SurfaceRange> objects,
                  const std::function<void(std::span<const SurfaceRange>)>& draw);
  /// The rasteriser that holds `objects`; kept until other objects are asked for. After start_gl().
  [[nodiscard]] Rasterizer& rasterizer(std::span<const SurfaceRange> objects);
  /// One for triangles that other ranks send, of this session's scene; holds none before they are loaded.
  [[nodiscard]] Rasterizer& receiving_rasterizer();
  /// The primary rays through `objects`; kept until other objects, another way of building, or another part of the
  /// scene are asked for. Collective where `settings` have a part, as shader() is.
  [[nodiscard]] PrimaryRays& primary_rays(std::span<const SurfaceRange> objects, const RaySettings& settings);
  /// Whether this rank's device can make keys in place of primary_rays(): not scenes in parts.
  [[nodiscard]] bool has_gpu_of_keys() const;
  /// That device, with `objects` on it.
  [[nodiscard]] GpuPrimaryRays& gpu_primary_rays(std::span<const SurfaceRange> objects);
  /// Whether there is a device that keys and light may be made by.
  [[nodiscard]] bool has_device() const { return gpu_ != nullptr; }
  /// Names of that device and its driver; empty: there is none.
  [[nodiscard]] std::string device_and_driver() const;
  /// Both, and why it is used; where GPUs are not used though there are some, why: "none (...)".
  /// Else empty.
  [[nodiscard]] std::string device_description() const;
  /// Why no device lights by these settings; empty: one does (shader()).
  [[nodiscard]] std::string refusal_of_light(const RaySettings& settings) const;
  /// Those of all ranks' objects, beside the ones above where these hold fewer; kept until the scene changes. Not where
  /// rays meet a part of the scene.
  [[nodiscard]] Rasterizer& whole_rasterizer();
  [[nodiscard]] PrimaryRays& whole_primary_rays(const RaySettings& settings);
  /// Embree's scene of all surfaces that cover what is behind them, for all who trace on this rank; built when first
  /// asked for. Asking for one built in another way ends it, and the shader and primary rays that use it.
  [[nodiscard]] const RayScene& ray_scene(const RayBuild& build);
  /// Collective. Makes what travelling rays need, where `settings` have a part.
  void partition_rays(const RaySettings& settings);
  /// What brings rays to other ranks; null where none travel.
  [[nodiscard]] RayForwarding* forwarding() { return forwarding_.get(); }
  /// The shader of these settings; kept until others are asked for.
  [[nodiscard]] DeferredShader& shader(const RaySettings& settings);
  /// The communicator of a group this rank belongs to; kept until another group is asked for. Collective over the
  /// group. What it sends counts in comm() too.
  [[nodiscard]] Communicator& group(std::span<const int> members);
  /// The strategy of this name with its scratch memory, for that group; kept until another one is asked for.
  [[nodiscard]] Compositor& compositor(const std::string& strategy, std::span<const int> members);
  /// A cleared layer of keys of this layout, reused from frame to frame. With a strategy that merges in place, the
  /// ranks of one host see the layers of their group's members. Collective. All ranks throw alike where one has no
  /// memory for it.
  [[nodiscard]] TileLayer<Key>& keys(const FrameLayout& layout, const std::string& strategy,
                                     std::span<const int> members);
  /// `count` cleared layers of keys that are not composited, reused from frame to frame.
  [[nodiscard]] std::span<TileLayer<Key>> round_keys(const FrameLayout& layout, std::size_t count);

 private:
  void start_vulkan();
  void find_device();
  void compare_devices();
  [[nodiscard]] std::string refusal_of_scene() const;
  void compare_rasterizers();
  void warn_of_scene() const;
  /// Ends what was made with a group that has other members.
  void leave_other_group(std::span<const int> members);
  /// Ends what was made of the scene.
  void release_scene();
  /// Ends what rays meet where it was built in another way.
  void build_rays_by(const RayBuild& build);
  void release_rays();
  [[nodiscard]] std::vector<SurfaceRange> covering_part() const;
  [[nodiscard]] PrimaryRays& primary_rays_of_page();
  [[nodiscard]] std::unique_ptr<RayScene> build_ray_scene(std::span<const SurfaceRange> objects) const;
  [[nodiscard]] TileLayer<Key> shared_layer(const FrameLayout& layout, const std::string& strategy,
                                            std::span<const int> members);

  /// The part of its host that this rank may use.
  struct HostResources {
    std::string host;
    int local_rank = 0;  ///< among the ranks of this host
    int ranks = 1;       ///< of this host
    int threads = 1;
  };
  [[nodiscard]] static HostResources find_host_resources(Communicator& comm, int threads);

  struct Group {
    std::vector<int> members;
    std::unique_ptr<Communicator> comm;
  };

  CountingCommunicator comm_;
  SessionSettings settings_;
  HostResources host_;
  Scene scene_;
  Requirements requirements_;
  std::unique_ptr<GpuDevice> gpu_;  ///< null: none makes keys or light
  std::string no_device_;           ///< why none does though there is one
  std::uint64_t device_bytes_ = 0;  ///< of its memory for this rank, on the rank that has least of it
  std::unique_ptr<GlContext> gl_;   ///< null before start_gl()
  std::vector<SurfaceRange> objects_;
  std::unique_ptr<Rasterizer> rasterizer_;
  std::unique_ptr<Rasterizer> whole_rasterizer_;
  std::unique_ptr<Rasterizer> receiving_rasterizer_;
  RayBuild ray_build_;                             ///< of the ray scenes and primary rays below
  std::optional<std::vector<SurfaceRange>> part_;  ///< the part of the scene they hold; see RaySettings::part
  std::vector<int> holders_;                       ///< see RaySettings::holders
  std::unique_ptr<RayForwarding> forwarding_;      ///< where there is a part
  std::unique_ptr<RayScene> ray_scene_;
  std::optional<std::size_t> page_;  ///< whose triangles the scene has
  std::vector<SurfaceRange> traced_objects_;
  std::unique_ptr<RayScene> traced_part_;  ///< of primary_rays_; none where ray_scene_ is
  std::unique_ptr<PrimaryRays> primary_rays_;
  std::unique_ptr<PrimaryRays> whole_primary_rays_;
  std::unique_ptr<GpuPrimaryRays> gpu_primary_rays_;
  std::optional<RaySettings> ray_settings_;
  std::unique_ptr<DeferredShader> shader_;
  Group group_;
  std::string strategy_;
  std::unique_ptr<Compositor> compositor_;
  std::unique_ptr<Assembler> assembler_;
  std::unique_ptr<TileGather> tile_gather_;
  std::unique_ptr<LoadBalance> balance_;
  std::unique_ptr<SceneChunks> scene_chunks_;
  TileLayer<Key> keys_;
  std::vector<TileLayer<Key>> round_keys_;
  bool keys_shared_ = false;       ///< whether they were meant to be
  std::vector<int> keys_members_;  ///< the group `keys_` was made for
};

}  // namespace hpr
