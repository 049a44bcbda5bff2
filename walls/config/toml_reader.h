#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "image/image.h"
#include "walls/config/toml_document.h"

namespace hpr {

/// Something wrong or odd in a wall file.
struct WallFinding {
  bool error = true;  ///< false: a warning
  TextPosition position;
  std::string what;  ///< with its place: "wall.toml:14:10: ..."
  std::string line;  ///< the offending line; empty when there is none
  std::string hint;
};

/// Where the text of a wall comes from.
enum class WallText : std::uint8_t {
  File,
  Expansion,  ///< of a shorthand: nobody has seen its lines
};

/// Collects findings about one text.
class Findings {
 public:
  /// `overrides` are named where a place is in one of them.
  Findings(std::string name, std::string_view text, std::vector<std::string> overrides = {},
           WallText kind = WallText::File)
      : name_(std::move(name)), text_(text), overrides_(std::move(overrides)), kind_(kind) {}

  void error(TextPosition position, std::string_view what, std::string hint) {
    add(true, position, what, std::move(hint));
  }
  void warning(TextPosition position, std::string_view what, std::string hint) {
    add(false, position, what, std::move(hint));
  }
  /// Notes a valid key nobody acts on; all of them end in one warning.
  void ignore(TextPosition position, const std::string& key);

  [[nodiscard]] bool any_errors() const;
  /// In the order of the text.
  [[nodiscard]] std::vector<WallFinding> take();

 private:
  void add(bool error, TextPosition position, std::string_view what, std::string hint);
  [[nodiscard]] std::string where(TextPosition position) const;

  std::string name_;
  std::string_view text_;
  std::vector<std::string> overrides_;
  WallText kind_;
  std::vector<WallFinding> findings_;
  TextPosition first_ignored_;
  std::vector<std::string> ignored_;
};

/// Farther than any wall: keeps squares and quotients of coordinates finite.
inline constexpr double kMaxMeters = 1e6;
/// The largest position on a display, on both sides of its origin, and the largest size there, in pixels.
inline constexpr int kMaxPixelPosition = 1 << 20;

/// Whether `text` may name something: 1 to 64 letters, digits, dots, dashes and underscores, of which dot and dash do
/// not come first.
[[nodiscard]] bool is_id(std::string_view text);

/// Reads one table key by key. What is wrong goes into the findings, and the key counts as absent; asking for a key
/// makes it a known one, so that finish() can report the keys nobody asked for.
class TableReader {
 public:
  /// `what` names the table in messages, e.g. "window". `table` must outlive this.
  TableReader(const TomlValue& table, std::string what, Findings& findings)
      : table_(table), what_(std::move(what)), findings_(findings) {}

  [[nodiscard]] const std::string& what() const { return what_; }
  [[nodiscard]] Findings& findings() const { return findings_; }
  [[nodiscard]] TextPosition position() const { return table_.position; }
  /// The position of the key's value; where it is absent that of the table.
  [[nodiscard]] TextPosition position(std::string_view key) const;
  /// The value whatever its type; null when absent.
  [[nodiscard]] const TomlValue* find(std::string_view key);
  [[nodiscard]] bool has(std::string_view key) { return find(key) != nullptr; }
  /// Finds the value of a key that has to be there; its absence is an error, and null is returned.
  const TomlValue* require(std::string_view key, std::string_view example);

  [[nodiscard]] std::optional<std::string> text(std::string_view key);
  /// A text of which is_id() holds.
  [[nodiscard]] std::optional<std::string> id(std::string_view key);
  /// One of `names`: its index.
  [[nodiscard]] std::optional<std::size_t> choice(std::string_view key, const std::vector<std::string>& names);
  [[nodiscard]] std::optional<bool> boolean(std::string_view key);
  [[nodiscard]] std::optional<int> integer(std::string_view key, int low, int high);
  /// Finite, in (low, high].
  [[nodiscard]] std::optional<double> real(std::string_view key, double low, double high);
  /// Finite, in [low, high].
  [[nodiscard]] std::optional<double> real_from(std::string_view key, double low, double high);
  [[nodiscard]] std::optional<glm::dvec3> point(std::string_view key);
  /// `count` finite numbers of at most `limit` in size.
  [[nodiscard]] std::optional<std::vector<double>> reals(std::string_view key, std::size_t count, double limit);
  [[nodiscard]] std::optional<std::vector<int>> integers(std::string_view key, std::size_t count, int low, int high);
  [[nodiscard]] std::optional<std::vector<std::string>> texts(std::string_view key);
  /// [x, y, width, height] with a positive size.
  [[nodiscard]] std::optional<Rect> rect(std::string_view key);
  [[nodiscard]] const TomlValue* table(std::string_view key);
  /// The tables of an array; empty when absent.
  [[nodiscard]] std::vector<const TomlValue*> tables(std::string_view key);

  /// Keys that are valid and not acted on.
  void ignore(std::initializer_list<std::string_view> keys);
  void error(std::string_view key, std::string_view problem, std::string hint);
  /// Reports unknown keys; call once, when all known ones were asked for.
  void finish();

 private:
  const TomlValue* typed(std::string_view key, TomlValue::Type type);
  void wrong_type(const TomlValue& value, std::string_view key, std::string_view wanted);
  [[nodiscard]] std::optional<double> number(std::string_view key);
  bool check_count(const TomlValue& value, std::string_view key, std::size_t count, std::string_view of);

  const TomlValue& table_;
  std::string what_;
  Findings& findings_;
  std::vector<std::string> known_;
};

}  // namespace hpr
