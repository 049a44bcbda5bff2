#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace hpr {

/// Where something stands in a text, both from 1; 0: nowhere.
struct TextPosition {
  int line = 0;
  int column = 0;
  int option = 0;  ///< from 1: not in the text, but in this override of it
};

struct TomlEntry;

/// A value of a TOML document with its place: plain data, so that only one file sees the parser.
struct TomlValue {
  enum class Type { Table, Array, Text, Integer, Real, Boolean, Time };

  Type type = Type::Table;
  TextPosition position;
  std::string text;
  std::int64_t integer = 0;
  double real = 0.0;  ///< also set for an Integer
  bool boolean = false;
  std::vector<TomlValue> items;    ///< of an Array
  std::vector<TomlEntry> entries;  ///< of a Table, in the order of the text
};

struct TomlEntry {
  std::string key;
  TextPosition position;  ///< of the key
  TomlValue value;
};

/// Why a text is no TOML.
struct TomlFailure {
  TextPosition position;
  std::string what;
};

[[nodiscard]] std::variant<TomlValue, TomlFailure> parse_toml(std::string_view text);

/// "a table", "a string" ...: for messages.
[[nodiscard]] std::string_view describe(TomlValue::Type type);

/// `text` as a TOML string with its quotes.
[[nodiscard]] std::string toml_quote(std::string_view text);

/// Line `line` (from 1) of `text` without its line break; empty where `text` has fewer.
[[nodiscard]] std::string_view text_line(std::string_view text, int line);

/// The shortest TOML float that reads back as the same bits.
[[nodiscard]] std::string toml_number(double value);

}  // namespace hpr
