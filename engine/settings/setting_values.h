#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/text.h"
#include "engine/settings_table.h"

/// Kinds of values that settings have: how they are written, read and copied.
namespace hpr::setting {

using Settings = RenderSettings;

template <typename Number>
std::optional<Number> parse_number(const std::string& text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  return number;
}

/// The member that `at` returns a reference to.
template <typename At>
const auto& member(const Settings& settings, At at) {
  return at(const_cast<Settings&>(settings));  // nothing is written to it
}

/// A value that is written in a way of its own: `parse` makes a value of text, `write` text of a value. `at` returns a
/// reference to where it is.
template <typename At, typename Parse, typename Write>
SettingValue text(const std::string& type, const std::string& takes, At at, Parse parse, Write write) {
  return {.type = type,
          .takes = takes,
          .parse = [=](Settings& settings, const std::string& written) { at(settings) = parse(written); },
          .write = [=](const Settings& settings) -> std::string { return write(member(settings, at)); },
          .copy = [=](const Settings& from, Settings& to) { at(to) = member(from, at); }};
}

/// A text that stands for itself.
template <typename At>
SettingValue plain_text(const std::string& type, const std::string& takes, At at) {
  const auto same = [](const std::string& written) { return written; };
  return text(type, takes, at, same, same);
}

/// A number from `low` to `high`, both included; a default outside of them stands for a choice that is left open.
template <typename Number, typename At>
SettingValue number(Number low, Number high, At at, const std::string& takes = {}) {
  constexpr bool kReal = std::is_floating_point_v<Number>;
  const std::string range = kReal ? fmt::format("{:g} to {:g}", static_cast<double>(low), static_cast<double>(high))
                                  : fmt::format("{} to {}", low, high);
  const auto parse = [=](const std::string& written) {
    const auto parsed = parse_number<Number>(written);
    // Written so that a NaN is refused.
    if (parsed && *parsed >= low && *parsed <= high) return *parsed;
    throw Error(ExitCode::Usage, fmt::format("'{}' is no number from {}", printable(written), range),
                fmt::format("write one from {}", range));
  };
  return text(fmt::format("{} {}", kReal ? "FLOAT" : "INT", range), takes.empty() ? range : takes, at, parse,
              [=](Number value) { return value >= low && value <= high ? fmt::format("{}", value) : std::string(); });
}

inline bool parse_bool(const std::string& written) {
  if (written == "true" || written == "false") return written == "true";
  throw Error(ExitCode::Usage, fmt::format("'{}' is neither true nor false", printable(written)),
              "write true or false");
}

/// True or false.
template <typename At>
SettingValue flag(At at) {
  SettingValue value =
      text({}, "false, true", at, parse_bool, [](bool is_set) { return std::string(is_set ? "true" : "false"); });
  value.is_flag = true;
  return value;
}

/// True turns the member off.
template <typename At>
SettingValue off_flag(At at) {
  SettingValue value = text(
      {}, "false, true", at, [](const std::string& written) { return !parse_bool(written); },
      [](bool is_set) { return std::string(is_set ? "false" : "true"); });
  value.is_flag = true;
  return value;
}

/// Where `name` stands among `names`. Throws Error (Usage) with the choices and the nearest one.
inline std::size_t index_of(const std::string& name, std::span<const std::string_view> names) {
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  const std::vector<std::string> choices(names.begin(), names.end());
  throw Error(ExitCode::Usage, fmt::format("there is no '{}'", printable(name)),
              unknown_name_hint(printable(name), choices));
}

/// One of an enumeration's values, whose names stand in their order.
template <std::size_t kCount, typename At>
SettingValue choice(const std::array<std::string_view, kCount>& names, At at) {
  using Value = std::remove_reference_t<decltype(at(std::declval<Settings&>()))>;
  return text(
      fmt::format("{}", fmt::join(names, "|")), fmt::format("{}", fmt::join(names, ", ")), at,
      [names](const std::string& name) { return static_cast<Value>(index_of(name, names)); },
      [names](Value value) { return std::string(names.at(static_cast<std::size_t>(value))); });
}

}  // namespace hpr::setting
