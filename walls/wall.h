#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"

/// A tiled wall as plain data. Wall space is right-handed, in metres, y up, with the wall usually in -z of its viewer;
/// pixel rectangles have their origin at the top left.
namespace hpr {

/// A host that drives windows, or only renders.
struct WallNode {
  std::string id;
  std::string host;               ///< as MPI names the processor; "localhost" and "*" match every host
  int ranks = 0;                  ///< how many are to run there; 0: free
  std::vector<std::string> gpus;  ///< ids
};

/// A place on a node's display in which one screen, or several side by side, are shown.
struct WallWindow {
  std::string id;
  std::string node;     ///< id; empty: whichever host the rank runs on
  std::string gpu;      ///< id; empty: any
  std::string display;  ///< X display, e.g. ":0.1"; empty: any
  std::string monitor;  ///< by name, e.g. "DP-1"; empty: the one `rect` is on
  int rank = -1;        ///< the rank of the job that must own it; -1: free
  Rect rect;            ///< on the display; empty: as large as its screens
  bool fullscreen = false;
};

/// A flat rectangle of lit pixels.
struct WallScreen {
  std::string id;       ///< unique, fit to be a file name
  std::string surface;  ///< id of the surface it is part of
  Size pixels;          ///< of the upright picture: width along lower_left -> lower_right
  /// Corners of the lit area in metres, in wall space.
  glm::dvec3 lower_left{0.0};
  glm::dvec3 lower_right{0.0};
  glm::dvec3 upper_left{0.0};
  std::string node;    ///< id; empty: any
  std::string window;  ///< id; empty: one of its own
  int rank = -1;       ///< the rank that must own it; -1: free
  /// Degrees (0, 90, 180, 270) by which the picture is turned clockwise when it is shown, because the panel is mounted
  /// turned. Rendering never sees it.
  int rotate = 0;
  Rect viewport;  ///< of the window, in the window's pixels, i.e. after turning
};

struct Wall {
  std::string name;
  std::vector<WallNode> nodes;
  std::vector<WallWindow> windows;
  std::vector<WallScreen> screens;  ///< never empty; grids row by row from the top, left to right
  glm::dvec3 viewer{0.0};           ///< wall space
  /// The file places the viewer: the wall is a window into the scene. Otherwise a flat wall shows what the camera sees.
  bool viewer_given = false;
  double near_m = 0.0;             ///< 0: the camera's
  double clamp_distance_m = 0.01;  ///< an eye nearer to a screen's plane is moved back to this distance
  Rgba8 gap_color{32, 32, 36, 255};
  std::uint64_t hash =
      0;  ///< XXH64 of expand_wall() but for the name: equal walls, however written or called, have equal hashes
};

/// Metres.
[[nodiscard]] double screen_width(const WallScreen& screen);
[[nodiscard]] double screen_height(const WallScreen& screen);

/// The wall with every screen's pixels times `factor`, at least 1 a side: for trying a large wall on a small machine.
/// Windows grow alike, the hash stays. Throws Error (Usage) when `factor` is not positive and finite.
[[nodiscard]] Wall scale_wall(Wall wall, double factor);

/// The wall as TOML with its grids written out screen by screen; load_wall reads it back as the same wall. Keys that
/// are valid and not acted on are left out.
[[nodiscard]] std::string expand_wall(const Wall& wall);

}  // namespace hpr
