#pragma once

#include <tinyxml2.h>

#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/json.h"
#include "walls/config/import/importer.h"

/// What importers share.
namespace hpr {

/// Throws Error (BadInput): "name:line: what", with that line of the text. Line 0: none is known.
[[noreturn]] void throw_in_file(std::string_view text, const std::string& name, int line, std::string_view what,
                                std::string hint);

/// The id of the wall's node of this host; made when there is none. One more rank runs there.
[[nodiscard]] std::string node_of_host(Wall& wall, const std::string& host);

/// A window of another system: a place in a grid of equal ones.
struct ForeignTile {
  int column = 0;
  int row = 0;          ///< from the top
  std::string node;     ///< id
  std::string display;  ///< X display; empty: any
  int x = 0;            ///< on it, pixels
  int y = 0;
  bool fullscreen = false;
  bool placed = true;  ///< x and y are known
};

/// A grid measured in pixels.
struct ForeignGrid {
  std::string surface = "wall";
  int columns = 1;  ///< of windows
  int rows = 1;
  Size panel;            ///< pixels of one panel
  Size panels{1, 1};     ///< panels a window spans
  int gap_x_pixels = 0;  ///< between panels; negative: they overlap
  int gap_y_pixels = 0;
  double pitch_m = 0.0;
  double left_m = 0.0;  ///< of the grid's left edge
};

/// Metres.
[[nodiscard]] double grid_width(const ForeignGrid& grid);

/// Adds windows and screens, gaps in metres by the pitch. A place named by no tile gets a screen without a window and a
/// remark. Tiles lie inside the grid, no two at one place.
void add_grid(const ForeignGrid& grid, const std::vector<ForeignTile>& tiles, ImportedWall& into);

/// Says that metres are pixels times the pitch.
[[nodiscard]] std::string pitch_remark(const ImportSettings& settings);

/// Moves the upper left corner by up to a thousandth of the height, so that corners written with few digits are square.
void square_corners(WallScreen& screen);

/// Another system's JSON, read key by key; everything wrong is an Error (BadInput) that names the value's path, and the
/// line of what is no JSON.
class JsonFile {
 public:
  JsonFile(std::string_view text, std::string name);

  [[nodiscard]] const Json& root() const { return root_; }
  /// The elements of the array under `key` of `object`, which is at `path`; none when it is absent.
  [[nodiscard]] const std::vector<Json>& array(const Json& object, const std::string& path, const char* key) const;
  [[nodiscard]] std::string text(const Json& object, const std::string& path, const char* key,
                                 const std::string& otherwise) const;
  [[nodiscard]] bool boolean(const Json& object, const std::string& path, const char* key) const;
  /// Within [low, high]; absent: `otherwise`, or an error without one.
  [[nodiscard]] int integer(const Json& object, const std::string& path, const char* key, int low, int high,
                            std::optional<int> otherwise = std::nullopt) const;
  [[nodiscard]] double real(const Json& object, const std::string& path, const char* key, double low, double high,
                            std::optional<double> otherwise = std::nullopt) const;
  /// `value`, or an error where it is no object.
  [[nodiscard]] const Json& object(const Json& value, const std::string& path) const;

  [[noreturn]] void fail(const std::string& path, std::string_view what, std::string hint) const;

 private:
  std::string name_;
  Json root_;
};

/// Another system's XML, read attribute by attribute; everything wrong is an Error (BadInput) with its line.
class XmlFile {
 public:
  /// `text` must outlive this.
  XmlFile(std::string_view text, std::string name);

  /// The outermost element, which must be called so.
  [[nodiscard]] const tinyxml2::XMLElement& root(const char* called) const;
  [[nodiscard]] const tinyxml2::XMLElement& child(const tinyxml2::XMLElement& parent, const char* called) const;
  [[nodiscard]] static std::vector<const tinyxml2::XMLElement*> children(const tinyxml2::XMLElement& parent,
                                                                         const char* called);

  /// Empty when absent.
  [[nodiscard]] static std::string text(const tinyxml2::XMLElement& element, const char* attribute);
  /// Within [low, high]; absent: `otherwise`, or an error without one.
  [[nodiscard]] int integer(const tinyxml2::XMLElement& element, const char* attribute, int low, int high,
                            std::optional<int> otherwise = std::nullopt) const;
  /// Three finite numbers; none when absent.
  [[nodiscard]] std::optional<glm::dvec3> point(const tinyxml2::XMLElement& element, const char* attribute) const;

  [[noreturn]] void fail(const tinyxml2::XMLElement& element, std::string_view what, std::string hint) const;

 private:
  std::string_view text_;
  std::string name_;
  tinyxml2::XMLDocument document_;
};

}  // namespace hpr
