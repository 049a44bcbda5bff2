#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/balance.h"
#include "engine/aov.h"
#include "image/key.h"
#include "rt/ray_settings.h"

namespace hpr {

enum class Shading {
  Deferred,  ///< keys are composited, then whoever owns a pixel lights it: no ray is spent on what is hidden
  Local,     ///< each rank lights what it drew, and colours are composited: the classic order
};
inline constexpr std::array<std::string_view, 2> kShadingNames{"deferred", "local"};

/// What makes the keys.
enum class Primary {
  Raster,  ///< OpenGL
  Rays,    ///< Embree, one ray through each pixel's centre; other surfaces are seen at some edges
  Auto,    ///< see choose_primary()
};
inline constexpr std::array<std::string_view, 3> kPrimaryNames{"raster", "rays", "auto"};

/// What a rank holds of the scene.
enum class SceneData {
  Replicated,   ///< all of it
  Partitioned,  ///< what it draws; rays travel
  Paged,        ///< the same, of which some comes from the disk as it is used, where it is too large for memory
};

inline constexpr std::array<std::string_view, 3> kDataNames{"replicated", "partitioned", "paged"};

/// How a frame is made; every choice gives the same picture, but for local shading: it has 8 bits a channel, and
/// coplanar surfaces of different ranks show the brighter colour.
struct FrameSettings {
  std::optional<Distribution> distribution;  ///< none: chosen by plan_frame
  Balance balance = Balance::Demand;
  int groups = 0;        ///< of Hybrid; 0: by view, else default_groups
  std::string strategy;  ///< empty: chosen by plan_frame
  Primary primary = Primary::Auto;
  DepthFormat depth_format = DepthFormat::Float32;  ///< fewer bits with Raster, which Auto then is
  Shading shading = Shading::Deferred;
  RaySettings rays;
  SceneData data = SceneData::Replicated;
  bool indirect_is_chosen = false;  ///< whether rays.gather says who brings indirect light; else plan_frame finds out
  bool keys_by_device = true;       ///< where there is a device that can make them
  bool light_by_device = true;      ///< where there is a device that can
  bool single_picture = false;      ///< whether nothing but one sample of one picture is drawn
  bool photons_fit_frame = false;   ///< no more photons a sample than the frame's pixels show
  double resolution_scale = 1.0;    ///< of the screens' pixels: the frame is made of so many a side, and enlarged
  double verify_percent = 0.0;      ///< of the tiles that are drawn again and compared; see engine/verification.h
  std::vector<Aov> aovs;            ///< with deferred shading only

  /// Whether ranks hold parts of the scene.
  [[nodiscard]] bool in_parts() const { return data != SceneData::Replicated; }
};

}  // namespace hpr
