#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/geometry/warp.h"

/// A tiled wall as plain data. Wall space is right-handed, in metres, y up, with the wall usually in -z of its viewer;
/// pixel rectangles have their origin at the top left.
namespace hpr {

/// A host that drives windows, or only renders.
struct WallNode {
  std::string id;
  std::string host;               ///< as MPI names the processor; "localhost" and "*" match every host
  int ranks = 0;                  ///< how many are to run there; 0: free
  std::vector<std::string> gpus;  ///< ids

  bool operator==(const WallNode&) const = default;
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

  bool operator==(const WallWindow&) const = default;
};

/// How a panel is mounted besides being turned: the picture is sent to it as in a mirror.
enum class Mirror { None, Horizontal, Vertical };

/// Whose picture a screen shows. Both: one picture without stereo, else both eyes' as StereoMode says.
enum class Eye { Both, Left, Right };

/// How screens for both eyes carry two pictures. Passive, and screens for one eye: an output for each eye.
enum class StereoMode { None, Passive, SideBySide, TopBottom, Anaglyph };

/// What makes panels look alike, each red, green, blue. In linear light a panel is sent black + (1 - black) * gain *
/// light, and of its sRGB level, in [0, 1], the power 1 / gamma.
struct PanelColor {
  glm::dvec3 gamma{1.0};
  glm::dvec3 gain{1.0};
  glm::dvec3 black{0.0};

  bool operator==(const PanelColor&) const = default;
};

/// Fades a screen's light towards its edges, where others overlap it. Widths in metres; automatic ones are what
/// overlaps.
struct EdgeBlend {
  bool automatic = false;
  double left = 0.0;
  double right = 0.0;
  double bottom = 0.0;
  double top = 0.0;
  double gamma = 1.0;  ///< power of the ramp, as BlendWeights has it; 1: straight in linear light

  [[nodiscard]] bool any() const { return automatic || left > 0.0 || right > 0.0 || bottom > 0.0 || top > 0.0; }
  bool operator==(const EdgeBlend&) const = default;
};

/// A flat rectangle of lit pixels, or what a warp makes of it.
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
  Mirror mirror = Mirror::None;  ///< of what is sent to the panel, after turning
  Eye eye = Eye::Both;
  std::size_t viewer = 0;  ///< index into Wall::viewers
  PanelColor color;
  EdgeBlend blend;
  ScreenWarp warp;
  Rect viewport;  ///< of the window, in the window's pixels, i.e. after turning

  bool operator==(const WallScreen&) const = default;
};

/// Where a viewer's head is learned from while the wall runs.
struct WallTracker {
  enum class Kind { None, File, Udp };
  enum class Lost { Freeze, Rest };  ///< stay where last seen, or go to the viewer's position in the wall file

  Kind kind = Kind::None;
  std::string path;                   ///< File: as written in the wall file
  std::string file;                   ///< File: as found from here
  double rate_hz = 60.0;              ///< File: frames per second of the recording's time
  std::string address = "127.0.0.1";  ///< Udp: an address of this host; "0.0.0.0": all
  int port = 0;                       ///< Udp
  int lost_after_ms = 200;            ///< Udp: without a datagram
  Lost lost_then = Lost::Freeze;

  bool operator==(const WallTracker&) const = default;
};

/// Somebody who looks at screens. Eyes lie on the head's right axis, half of ipd_m to each side of eye_offset_m.
struct WallViewer {
  std::string id;
  glm::dvec3 position{0.0};  ///< of the head, wall space; where it rests when it is tracked
  /// The file places the viewer: the wall is a window into the scene. Otherwise a flat wall shows what the camera sees.
  bool has_position = false;
  double ipd_m = 0.0;              ///< between the pupils
  glm::dvec3 eye_offset{0.0};      ///< of the eyes' middle from the head's position, in the head's axes
  double near_m = 0.0;             ///< 0: the camera's
  double clamp_distance_m = 0.01;  ///< an eye nearer to a screen's plane is moved back to this distance
  WallTracker tracker;

  bool operator==(const WallViewer&) const = default;
};

/// An operator's scaled copy of a surface, made from the screens' finished pictures.
struct WallMonitor {
  std::string id;       ///< unique among monitors and screens
  std::string surface;  ///< id
  Size pixels;

  bool operator==(const WallMonitor&) const = default;
};

struct Wall {
  std::string name;
  std::vector<WallNode> nodes;
  std::vector<WallWindow> windows;
  std::vector<WallScreen> screens;    ///< never empty; grids row by row from the top, left to right
  std::vector<WallScreen> elsewhere;  ///< of the same wall, shown by other processes: their light may overlap
  /// Never empty. The first stands at the camera's eye when it rests, and wall axes are the camera's.
  std::vector<WallViewer> viewers{WallViewer{}};
  StereoMode stereo = StereoMode::None;
  std::vector<WallMonitor> monitors;
  Rgba8 gap_color{32, 32, 36, 255};
  std::uint64_t hash = 0;  ///< XXH64 of expand_wall() but for the name: equal walls, however written or called, have
                           ///< equal hashes, as far as the files they name are equal

  bool operator==(const Wall&) const = default;
};

/// "none", "passive", ...: in wall files, in the enumeration's order.
[[nodiscard]] const std::vector<std::string>& stereo_names();
[[nodiscard]] const std::vector<std::string>& eye_names();
[[nodiscard]] const std::vector<std::string>& mirror_names();

/// Pixels of what is sent to the screen's panel: sides swap where it is mounted turned by a right angle.
[[nodiscard]] Size panel_pixels(const WallScreen& screen);

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
