#include "walls/config/toml_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

// The parser's headers do not hold to our warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <toml++/toml.h>
#pragma GCC diagnostic pop

namespace hpr {
namespace {

TextPosition position_of(const toml::source_region& region) {
  return {static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

bool before(const TextPosition& a, const TextPosition& b) {
  return a.line != b.line ? a.line < b.line : a.column < b.column;
}

TomlValue convert(const toml::node& node) {
  using Type = TomlValue::Type;
  TomlValue value;
  value.position = position_of(node.source());
  if (const auto* const table = node.as_table()) {
    value.type = Type::Table;
    for (const auto& [key, child] : *table) {
      value.entries.push_back({std::string(key.str()), position_of(key.source()), convert(child)});
    }
    std::ranges::stable_sort(value.entries, before, &TomlEntry::position);
  } else if (const auto* const array = node.as_array()) {
    value.type = Type::Array;
    for (const auto& item : *array) value.items.push_back(convert(item));
  } else if (const auto* const text = node.as_string()) {
    value.type = Type::Text;
    value.text = text->get();
  } else if (const auto* const integer = node.as_integer()) {
    value.type = Type::Integer;
    value.integer = integer->get();
    value.real = static_cast<double>(integer->get());
  } else if (const auto* const real = node.as_floating_point()) {
    value.type = Type::Real;
    value.real = real->get();
  } else if (const auto* const boolean = node.as_boolean()) {
    value.type = Type::Boolean;
    value.boolean = boolean->get();
  } else {
    value.type = Type::Time;
  }
  return value;
}

}  // namespace

std::variant<TomlValue, TomlFailure> parse_toml(std::string_view text) {
  try {
    return convert(toml::parse(text));
  } catch (const toml::parse_error& error) {
    return TomlFailure{position_of(error.source()), std::string(error.description())};
  }
}

std::string_view describe(TomlValue::Type type) {
  using Type = TomlValue::Type;
  switch (type) {
    case Type::Table:
      return "a table";
    case Type::Array:
      return "an array";
    case Type::Text:
      return "a string";
    case Type::Integer:
      return "an integer";
    case Type::Real:
      return "a real number";
    case Type::Boolean:
      return "true or false";
    case Type::Time:
      return "a date or time";
  }
  return "a value";
}

std::string toml_quote(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (byte < 0x20 || byte == 0x7F) {
      quoted += fmt::format("\\u{:04X}", byte);
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string_view text_line(std::string_view text, int line) {
  for (; line > 1; --line) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

std::string toml_number(double value) {
  std::string text = fmt::format("{}", value);
  if (std::isfinite(value) && text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

}  // namespace hpr
