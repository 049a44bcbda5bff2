#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "walls/config/toml_document.h"

namespace hpr {

/// Something wrong or odd in a wall file.
struct WallFinding {
  bool error = true;  ///< false: a warning
  TextPlace place;
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

  void error(TextPlace place, std::string_view what, std::string hint) { add(true, place, what, std::move(hint)); }
  void warning(TextPlace place, std::string_view what, std::string hint) { add(false, place, what, std::move(hint)); }
  /// Notes a valid key nobody acts on; all of them end in one warning.
  void ignore(TextPlace place, const std::string& key);

  [[nodiscard]] bool any_errors() const;
  /// In the order of the text.
  [[nodiscard]] std::vector<WallFinding> take();

 private:
  void add(bool error, TextPlace place, std::string_view what, std::string hint);
  [[nodiscard]] std::string where(TextPlace place) const;

  std::string name_;
  std::string_view text_;
  std::vector<std::string> overrides_;
  WallText kind_;
  std::vector<WallFinding> findings_;
  TextPlace first_ignored_;
  std::vector<std::string> ignored_;
};

}  // namespace hpr
