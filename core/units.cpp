#include "core/units.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

namespace hpr {
namespace {

/// The number that starts `text`, which then holds the rest.
std::optional<double> take_number(std::string_view& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || !std::isfinite(value) || value < 0.0) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  return value;
}

struct Unit {
  std::string_view name;
  double factor;
};

template <std::size_t N>
std::optional<double> with_unit(std::string_view text, const std::array<Unit, N>& units) {
  const auto number = take_number(text);
  if (!number) return std::nullopt;
  for (const Unit& unit : units) {
    if (unit.name == text) return *number * unit.factor;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::uint64_t> parse_bytes(std::string_view text) {
  constexpr double kKi = 1024.0;
  constexpr std::array<Unit, 15> kUnits{{{"", 1},
                                         {"B", 1},
                                         {"K", kKi},
                                         {"KiB", kKi},
                                         {"kB", 1e3},
                                         {"KB", 1e3},
                                         {"M", kKi * kKi},
                                         {"MiB", kKi * kKi},
                                         {"MB", 1e6},
                                         {"G", kKi * kKi * kKi},
                                         {"GiB", kKi * kKi * kKi},
                                         {"GB", 1e9},
                                         {"T", kKi * kKi * kKi * kKi},
                                         {"TB", 1e12},
                                         {"TiB", kKi * kKi * kKi * kKi}}};
  const auto bytes = with_unit(text, kUnits);
  if (!bytes || *bytes > 9e18) return std::nullopt;
  return static_cast<std::uint64_t>(*bytes);
}

std::string format_bytes(std::uint64_t bytes) {
  constexpr std::array<std::string_view, 7> kUnits{"B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (std::round(value * 10.0) >= 10240.0) {  // as it will be written
    value /= 1024.0;
    ++unit;
  }
  return fmt::format("{:g} {}", std::round(value * 10.0) / 10.0, kUnits.at(unit));
}

std::optional<std::chrono::nanoseconds> parse_duration(std::string_view text) {
  constexpr std::array<Unit, 6> kUnits{{{"", 1e9}, {"s", 1e9}, {"ms", 1e6}, {"us", 1e3}, {"ns", 1}, {"min", 60e9}}};
  const auto nanoseconds = with_unit(text, kUnits);
  if (!nanoseconds || *nanoseconds > 9e18) return std::nullopt;
  return std::chrono::nanoseconds(static_cast<std::int64_t>(*nanoseconds));
}

std::optional<std::pair<int, int>> parse_extent(std::string_view text) {
  std::pair<int, int> extent;
  const char* const last = text.data() + text.size();
  const auto [x, x_error] = std::from_chars(text.data(), last, extent.first);
  if (x_error != std::errc{} || x == last || *x != 'x') return std::nullopt;
  const auto [end, y_error] = std::from_chars(x + 1, last, extent.second);
  if (y_error != std::errc{} || end != last || extent.first <= 0 || extent.second <= 0) return std::nullopt;
  return extent;
}

}  // namespace hpr
