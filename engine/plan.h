#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/balance.h"
#include "engine/aov.h"
#include "engine/balance/view_grouping.h"
#include "engine/display/drawn_by.h"
#include "engine/frame_settings.h"
#include "image/tiles.h"
#include "rt/ray_settings.h"

namespace hpr {

class Session;
struct View;

/// Who does what in a frame; computed alike on every rank.
struct FramePlan {
  Distribution distribution = Distribution::SortFirst;
  bool distribution_is_predicted = false;  ///< see choose_again()
  int groups = 1;
  std::string strategy;
  Primary primary = Primary::Raster;  ///< never Auto
  bool keys_on_device = false;        ///< rays by the session's gpu_primary_rays()
  DepthFormat depth_format = DepthFormat::Float32;
  Shading shading = Shading::Deferred;
  RaySettings rays;
  std::vector<Aov> aovs;        ///< that are asked for
  std::vector<Aov> layers;      ///< that are made: those, and what the picture itself has beside its radiance
  double verify_percent = 0.0;  ///< of the tiles; see engine/verification.h
  bool lit = true;              ///< false: only the keys are wanted, no light is spent on them
  FrameLayout layout;
  Balance balance = Balance::Demand;
  Assignment mine;                             ///< this rank's part
  std::vector<std::vector<ScreenRect>> areas;  ///< of each group; none where groups follow the view
  std::optional<ViewGrouping> by_view;         ///< where groups follow the view: who draws which part of the objects
  std::optional<DrawnBy> drawn_by;             ///< where ranks are shown
  std::vector<std::size_t> tiles;              ///< of this rank's group, or that it draws into, ascending
  std::vector<std::string> explained;          ///< one line per decision, with its reason
  std::size_t explained_distribution = 0;      ///< how many of them, the first ones, say who draws what

  /// Whether the picture has an alpha other than 1.
  [[nodiscard]] bool is_transparent() const { return rays.background.kind == Background::Kind::Transparent; }
};

/// A screen for each view.
[[nodiscard]] FrameLayout layout_of(std::span<const View> views);

/// Collective. Starts OpenGL where the frame is drawn by it, or that is left to whether it has a GPU.
[[nodiscard]] FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views);

/// Collective, between frames of a plan whose distribution is predicted: chooses anew, by what the frames before took
/// and what `views` show.
void choose_again(Session& session, const FrameSettings& settings, std::span<const View> views, FramePlan& plan);

/// What decides whether OpenGL or rays make the keys of a frame: nothing that a clock says, nor how many ranks share
/// the work, so that the same picture has the same bits however it is made. Equal on all ranks.
struct KeyWork {
  std::uint64_t triangles = 0;         ///< of all instances
  std::uint64_t own_triangles = 0;     ///< of meshes, each once however many instances it has
  std::uint64_t pixels = 0;            ///< of all views
  bool software_gl = false;            ///< whether any rank draws by its CPU
  bool ray_scene_is_for_keys = false;  ///< whether no pass traces rays, so that keys alone pay for Embree's scene
  bool single_picture = false;         ///< whether that scene serves a single sample of a single picture
  bool rounds_depth = false;           ///< whether depths have fewer than 32 bits, as OpenGL alone draws them
};

struct PrimaryChoice {
  Primary primary = Primary::Raster;  ///< never Auto
  std::string why;
  bool on_device = false;  ///< see FramePlan::keys_on_device
};

/// What Primary::Auto stands for. On a GPU OpenGL makes the keys. On a CPU it takes a time for each triangle and rays
/// take as long for each pixel, so that rays make them where a frame has no more pixels than triangles; small pictures
/// too, for which OpenGL would have to start (docs/decisions/0016-keys-by-rays-or-by-opengl.md).
[[nodiscard]] PrimaryChoice choose_primary(const KeyWork& work);

/// From so much of open sky on rays bring indirect light: with less noise than photons in the same time where spheres
/// hang in the open, and with more in a room with a hole (docs/decisions/0009-even-skies-are-gathered.md).
inline constexpr double kOpenSky = 0.5;

}  // namespace hpr
