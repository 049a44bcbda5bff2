#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include "core/bytes.h"
#include "core/file.h"
#include "core/text.h"
#include "image/image_io.h"
#include "walls/config/wall_draft.h"
#include "walls/geometry/curved.h"
#include "walls/geometry/warping.h"

namespace hpr {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{2} << 30U;

/// Reads one of a warp's files; what is wrong with it is a finding of its key.
class WarpReader {
 public:
  WarpReader(const TomlValue& table, std::filesystem::path folder, Findings& findings)
      : reader_(table, "warp", findings), folder_(std::move(folder)), findings_(findings) {}

  void read(WallScreen& screen) {
    ScreenWarp& warp = screen.warp;
    with_file("mesh", warp.mesh, [&](const std::string& file) { read_mesh(file, screen); });
    with_file("blend", warp.blend, [&](const std::string& file) { warp.light = read_levels("blend", file, screen); });
    with_file("black", warp.black, [&](const std::string& file) { warp.floor = read_levels("black", file, screen); });
    if (!reader_.has("mesh") && !reader_.has("blend") && !reader_.has("black")) {
      findings_.error(reader_.position(), "warp names no file",
                      R"(write warp = { mesh = "a.pfm", blend = "a_alpha.png", black = "a_beta.png" }, or some of it)");
    }
    reader_.finish();
  }

 private:
  template <typename Read>
  void with_file(std::string_view key, WarpFile& file, const Read& read) {
    const auto path = reader_.text(key);
    if (!path) return;
    if (path->empty()) return reader_.error(key, "is \"\"", "name a file, beside the wall file unless it says where");
    const std::string found = (folder_ / *path).lexically_normal().string();
    try {
      bytes_ = read_file(found, kMaxFileBytes);
      file = {*path, xxh64(bytes_)};
      read(found);
    } catch (const Error& error) {
      reader_.error(key, fmt::format("cannot be used: {}", error.what()), error.hint());
    }
    bytes_.clear();
  }

  void read_mesh(const std::string& file, WallScreen& screen) {
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    std::string extension = std::filesystem::path(file).extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    if (extension == ".pfm") {
      screen.warp.points = std::make_shared<const PositionMap>(parse_position_map(bytes_, file));
      compare_shape("mesh", screen.warp.points->size(), screen);
    } else if (extension == ".csv") {
      screen.warp.grid = std::make_shared<const WarpMesh>(parse_warp_csv(text, file));
    } else if (extension == ".obj") {
      screen.warp.grid = std::make_shared<const WarpMesh>(parse_warp_obj(text, file));
    } else {
      reader_.error("mesh", fmt::format("is \"{}\", of no known kind", printable(screen.warp.mesh.path)),
                    ".pfm is a map of positions in metres, .csv and .obj are meshes of the flat picture");
    }
  }

  /// Levels as they stand in the file; the same for all channels where it is gray.
  std::shared_ptr<const Image<Rgb>> read_levels(std::string_view key, const std::string& file,
                                                const WallScreen& screen) {
    const FloatImage image = read_image(file, {});
    const std::size_t channels = image.channels.size();
    const bool gray = channels < 3;
    Image<Rgb> levels(image.size);
    for (std::size_t i = 0; i < levels.pixels().size(); ++i) {
      const float* const values = &image.values[i * channels];
      const Rgb level = gray ? Rgb{values[0], values[0], values[0]} : Rgb{values[0], values[1], values[2]};
      for (const float value : {level.r, level.g, level.b}) {
        if (value >= 0.0F && value <= 1.0F) continue;
        reader_.error(key, fmt::format("holds {}", value), "it is a factor from 0 to 1; a PNG holds nothing else");
        return nullptr;
      }
      levels.pixels()[i] = level;
    }
    compare_shape(key, image.size, screen);
    return std::make_shared<const Image<Rgb>>(std::move(levels));
  }

  /// A file of another shape than the picture is likely to be another screen's.
  void compare_shape(std::string_view key, Size size, const WallScreen& screen) {
    constexpr double kMaxRatio = 0.02;
    if (screen.pixels.area() == 0 || std::min(size.width, size.height) < 64) return;
    const double own = static_cast<double>(screen.pixels.width) / screen.pixels.height;
    const double its = static_cast<double>(size.width) / size.height;
    if (std::abs(its / own - 1.0) <= kMaxRatio) return;
    findings_.warning(reader_.position(key),
                      fmt::format("'{}' of warp has {} x {} pixels, another shape than the screen's {} x {}", key,
                                  size.width, size.height, screen.pixels.width, screen.pixels.height),
                      "it is stretched over the whole upright picture; check that it is this screen's");
  }

  TableReader reader_;
  std::filesystem::path folder_;
  Findings& findings_;
  std::vector<std::byte> bytes_;  ///< of the file at hand
};

/// What the viewer's eye makes of a position map: of its points, and of cells of four neighbours.
struct MapCheck {
  std::size_t points = 0;
  std::size_t hidden = 0;  ///< of them: behind the eye, or too far aside
  std::size_t folded = 0;  ///< cells seen from behind
  std::size_t straight = 0;
};

class MapChecker {
 public:
  explicit MapChecker(const PixelPoints& points) : points_(points), map_(points.map->points()) {}

  MapCheck check() {
    for (int y = 0; y < map_.height(); ++y) {
      for (int x = 0; x < map_.width(); ++x) check_cell(x, y);
    }
    return check_;
  }

 private:
  [[nodiscard]] bool lit(int x, int y) const { return is_finite(map_.at(x, y)); }

  [[nodiscard]] std::optional<glm::dvec2> seen(int x, int y) const {
    return lit(x, y) ? points_.seen(glm::dvec3(map_.at(x, y))) : std::nullopt;
  }

  void check_cell(int x, int y) {
    if (!lit(x, y)) return;
    ++check_.points;
    const auto here = seen(x, y);
    if (!here) ++check_.hidden;
    if (!here || x + 1 == map_.width() || y + 1 == map_.height()) return;
    const auto beside = seen(x + 1, y);
    const auto below = seen(x, y + 1);
    if (!beside || !below) return;
    const glm::dvec2 right = *beside - *here;
    const glm::dvec2 down = *below - *here;
    const double area = right.x * down.y - right.y * down.x;  // negative: rows go down, columns to the right
    if (area < 0.0) ++check_.straight;
    if (area > 0.0) ++check_.folded;
  }

  const PixelPoints& points_;
  const Image<glm::vec3>& map_;
  MapCheck check_;
};

}  // namespace

void read_warp(TableReader& screen_reader, const std::filesystem::path& folder, WallScreen& screen) {
  const TomlValue* const table = screen_reader.table("warp");
  if (table == nullptr) return;
  WarpReader(*table, folder, screen_reader.findings()).read(screen);
}

void check_position_maps(const WallDraft& draft, Findings& findings) {
  for (const DraftScreen& draft_screen : draft.screens) {
    const WallScreen& screen = draft_screen.screen;
    if (!screen.warp.points || !draft_screen.has_corners) continue;
    if (draft.viewers.empty() || !draft.viewers.front().placed) {
      findings.error(draft_screen.warp_position,
                     fmt::format("screen \"{}\" has a position map, and no viewer a place", screen.id),
                     "add [[viewers]] with position_m = [x, y, z]: what a point shows is what the eye sees through it");
      continue;
    }
    if (screen.viewer >= draft.viewers.size()) continue;
    const WallViewer& viewer = draft.viewers[screen.viewer].viewer;
    const PixelPoints points = pixel_points(screen, viewer.position + viewer.eye_offset);
    const MapCheck check = MapChecker(points).check();
    if (check.hidden == check.points) {
      findings.error(draft_screen.warp_position,
                     fmt::format("all points of screen \"{}\" lie behind the viewer's eye, or 85 degrees and more off "
                                 "its normal",
                                 screen.id),
                     "check position_m, corners_m and the map: all are metres (not millimetres) of one space, and "
                     "corners_m face the viewer");
    } else if (check.hidden > 0) {
      findings.warning(draft_screen.warp_position,
                       fmt::format("{} of {} points of screen \"{}\" lie behind the viewer's eye, or 85 degrees and "
                                   "more off its normal",
                                   check.hidden, check.points, screen.id),
                       "these pixels stay dark; turn corners_m towards the middle of what the screen lights");
    }
    if (check.folded > check.straight) {
      findings.warning(
          draft_screen.warp_position,
          fmt::format("the points of screen \"{}\" are in mirror image as the viewer sees them", screen.id),
          "rows of a PFM go from the bottom to the top; ignore this where a mirror is in the light's way");
    } else if (check.folded > 0) {
      findings.warning(draft_screen.warp_position,
                       fmt::format("the points of screen \"{}\" fold over, in {} of {} cells, as the viewer sees them",
                                   screen.id, check.folded, check.folded + check.straight),
                       "places that are lit twice show the scene twice; is the map smooth?");
    }
  }
}

}  // namespace hpr
