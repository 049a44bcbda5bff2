#include "walls/config/toml_reader.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/text.h"

namespace hpr {

bool is_id(std::string_view text) {
  constexpr std::size_t kMaxLength = 64;
  if (text.empty() || text.size() > kMaxLength || text.front() == '.' || text.front() == '-') return false;
  return std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
           c == '_';
  });
}

/// What an expansion has wrong comes of the overrides, and all of them may have a part in it.
std::string Findings::where(TextPosition position) const {
  const std::string wall = kind_ == WallText::Expansion ? fmt::format("{} with ", printable(name_)) : "";
  if (position.option > 0) {
    return fmt::format("{}--set {}: ", wall, printable(overrides_.at(static_cast<std::size_t>(position.option - 1))));
  }
  if (kind_ == WallText::Expansion && !overrides_.empty()) {
    return fmt::format("{}--set {}: ", wall, printable(fmt::format("{}", fmt::join(overrides_, " --set ")), 200));
  }
  return position.line > 0 ? fmt::format("{}:{}:{}: ", name_, position.line, position.column)
                           : fmt::format("{}: ", name_);
}

void Findings::add(bool error, TextPosition position, std::string_view what, std::string hint) {
  constexpr std::size_t kLineLimit = 200;
  const std::string where = this->where(position);
  if (kind_ == WallText::Expansion) position.line = position.column = 0;
  const std::string line = position.line > 0 ? printable(text_line(text_, position.line), kLineLimit) : std::string();
  findings_.push_back({error, position, where + std::string(what), line, std::move(hint)});
}

void Findings::ignore(TextPosition position, const std::string& key) {
  if (ignored_.empty()) first_ignored_ = position;
  if (std::ranges::find(ignored_, key) == ignored_.end()) ignored_.push_back(key);
}

bool Findings::any_errors() const {
  return std::ranges::any_of(findings_, &WallFinding::error);
}

std::vector<WallFinding> Findings::take() {
  if (!ignored_.empty()) {
    warning(first_ignored_, fmt::format("not acted on by this version: {}", fmt::join(ignored_, ", ")),
            "the wall is used without them");
    ignored_.clear();
  }
  std::ranges::stable_sort(findings_, [](const WallFinding& a, const WallFinding& b) {
    return a.position.line != b.position.line ? a.position.line < b.position.line
                                              : a.position.column < b.position.column;
  });
  return std::move(findings_);
}

const TomlValue* TableReader::find(std::string_view key) {
  if (std::ranges::find(known_, key) == known_.end()) known_.emplace_back(key);
  const auto entry = std::ranges::find(table_.entries, key, &TomlEntry::key);
  return entry == table_.entries.end() ? nullptr : &entry->value;
}

TextPosition TableReader::position(std::string_view key) const {
  const auto entry = std::ranges::find(table_.entries, key, &TomlEntry::key);
  return entry == table_.entries.end() ? table_.position : entry->value.position;
}

const TomlValue* TableReader::require(std::string_view key, std::string_view example) {
  const TomlValue* const value = find(key);
  if (value == nullptr) {
    findings_.error(table_.position, fmt::format("{} has no '{}'", what_, key),
                    fmt::format("add {} = {}", key, example));
  }
  return value;
}

void TableReader::error(std::string_view key, std::string_view problem, std::string hint) {
  findings_.error(position(key), fmt::format("'{}' of {} {}", key, what_, problem), std::move(hint));
}

void TableReader::wrong_type(const TomlValue& value, std::string_view key, std::string_view wanted) {
  findings_.error(value.position, fmt::format("'{}' of {} is {}", key, what_, describe(value.type)),
                  fmt::format("it must be {}", wanted));
}

const TomlValue* TableReader::typed(std::string_view key, TomlValue::Type type) {
  const TomlValue* const value = find(key);
  if (value == nullptr || value->type == type) return value;
  wrong_type(*value, key, describe(type));
  return nullptr;
}

std::optional<std::string> TableReader::text(std::string_view key) {
  const TomlValue* const value = typed(key, TomlValue::Type::Text);
  if (value == nullptr) return std::nullopt;
  return value->text;
}

std::optional<std::string> TableReader::id(std::string_view key) {
  auto name = text(key);
  if (!name || is_id(*name)) return name;
  error(key, fmt::format("is \"{}\"", printable(*name)),
        "an id has 1 to 64 letters, digits, dots, dashes and underscores, and starts with none of dot and dash");
  return std::nullopt;
}

std::optional<std::size_t> TableReader::choice(std::string_view key, const std::vector<std::string>& names) {
  const auto name = text(key);
  if (!name) return std::nullopt;
  const auto found = std::ranges::find(names, *name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  error(key, fmt::format("is \"{}\"", printable(*name)), unknown_name_hint(*name, names));
  return std::nullopt;
}

std::optional<bool> TableReader::boolean(std::string_view key) {
  const TomlValue* const value = typed(key, TomlValue::Type::Boolean);
  if (value == nullptr) return std::nullopt;
  return value->boolean;
}

std::optional<int> TableReader::integer(std::string_view key, int low, int high) {
  const TomlValue* const value = typed(key, TomlValue::Type::Integer);
  if (value == nullptr) return std::nullopt;
  if (value->integer >= low && value->integer <= high) return static_cast<int>(value->integer);
  error(key, fmt::format("is {}", value->integer), fmt::format("it must be from {} to {}", low, high));
  return std::nullopt;
}

std::optional<double> TableReader::number(std::string_view key) {
  const TomlValue* const value = find(key);
  if (value == nullptr) return std::nullopt;
  if (value->type == TomlValue::Type::Real || value->type == TomlValue::Type::Integer) return value->real;
  wrong_type(*value, key, "a number");
  return std::nullopt;
}

std::optional<double> TableReader::real(std::string_view key, double low, double high) {
  const auto value = number(key);
  if (!value || (*value > low && *value <= high)) return value;
  error(key, fmt::format("is {}", *value), fmt::format("it must be finite, above {} and at most {}", low, high));
  return std::nullopt;
}

std::optional<double> TableReader::real_from(std::string_view key, double low, double high) {
  const auto value = number(key);
  if (!value || (*value >= low && *value <= high)) return value;
  error(key, fmt::format("is {}", *value), fmt::format("it must be finite, from {} to {}", low, high));
  return std::nullopt;
}

bool TableReader::check_count(const TomlValue& value, std::string_view key, std::size_t count, std::string_view of) {
  if (value.items.size() == count) return true;
  findings_.error(value.position, fmt::format("'{}' of {} has {} values", key, what_, value.items.size()),
                  fmt::format("it must have {} {}", count, of));
  return false;
}

std::optional<std::vector<double>> TableReader::reals(std::string_view key, std::size_t count, double limit) {
  const TomlValue* const value = typed(key, TomlValue::Type::Array);
  if (value == nullptr || !check_count(*value, key, count, "numbers")) return std::nullopt;
  std::vector<double> numbers;
  for (const TomlValue& item : value->items) {
    if (item.type != TomlValue::Type::Real && item.type != TomlValue::Type::Integer) {
      wrong_type(item, key, "an array of numbers");
      return std::nullopt;
    }
    if (!(std::abs(item.real) <= limit)) {
      findings_.error(item.position, fmt::format("'{}' of {} holds {}", key, what_, item.real),
                      fmt::format("numbers there must be finite and within {} of zero", limit));
      return std::nullopt;
    }
    numbers.push_back(item.real);
  }
  return numbers;
}

std::optional<glm::dvec3> TableReader::point(std::string_view key) {
  const auto numbers = reals(key, 3, kMaxMeters);
  if (!numbers) return std::nullopt;
  return glm::dvec3((*numbers)[0], (*numbers)[1], (*numbers)[2]);
}

std::optional<std::vector<int>> TableReader::integers(std::string_view key, std::size_t count, int low, int high) {
  const TomlValue* const value = typed(key, TomlValue::Type::Array);
  if (value == nullptr || !check_count(*value, key, count, "integers")) return std::nullopt;
  std::vector<int> numbers;
  for (const TomlValue& item : value->items) {
    if (item.type != TomlValue::Type::Integer) {
      wrong_type(item, key, "an array of integers");
      return std::nullopt;
    }
    if (item.integer < low || item.integer > high) {
      findings_.error(item.position, fmt::format("'{}' of {} holds {}", key, what_, item.integer),
                      fmt::format("it must be from {} to {}", low, high));
      return std::nullopt;
    }
    numbers.push_back(static_cast<int>(item.integer));
  }
  return numbers;
}

std::optional<std::vector<std::string>> TableReader::texts(std::string_view key) {
  const TomlValue* const value = typed(key, TomlValue::Type::Array);
  if (value == nullptr) return std::nullopt;
  std::vector<std::string> list;
  for (const TomlValue& item : value->items) {
    if (item.type != TomlValue::Type::Text) {
      wrong_type(item, key, "an array of strings");
      return std::nullopt;
    }
    list.push_back(item.text);
  }
  return list;
}

std::optional<Rect> TableReader::rect(std::string_view key) {
  const auto numbers = integers(key, 4, -kMaxPixelPosition, kMaxPixelPosition);
  if (!numbers) return std::nullopt;
  const int width = (*numbers)[2];
  const int height = (*numbers)[3];
  if (width <= 0 || height <= 0) {
    error(key, fmt::format("is {} x {} pixels", width, height), "write [x, y, width, height] with a positive size");
    return std::nullopt;
  }
  return Rect{(*numbers)[0], (*numbers)[1], (*numbers)[0] + width, (*numbers)[1] + height};
}

const TomlValue* TableReader::table(std::string_view key) {
  return typed(key, TomlValue::Type::Table);
}

std::vector<const TomlValue*> TableReader::tables(std::string_view key) {
  const TomlValue* const value = typed(key, TomlValue::Type::Array);
  std::vector<const TomlValue*> list;
  if (value == nullptr) return list;
  for (const TomlValue& item : value->items) {
    if (item.type != TomlValue::Type::Table) {
      wrong_type(item, key, "an array of tables");
    } else {
      list.push_back(&item);
    }
  }
  return list;
}

void TableReader::ignore(std::initializer_list<std::string_view> keys) {
  for (const std::string_view key : keys) {
    if (const TomlValue* const value = find(key)) findings_.ignore(value->position, std::string(key));
  }
}

void TableReader::finish() {
  for (const TomlEntry& entry : table_.entries) {
    if (entry.key.starts_with("x_") || std::ranges::find(known_, entry.key) != known_.end()) continue;
    findings_.error(entry.position, fmt::format("{} has no key '{}'", what_, printable(entry.key)),
                    unknown_name_hint(entry.key, known_) + " (x_... is free for your own data)");
  }
}

}  // namespace hpr
