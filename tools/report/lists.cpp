#include "tools/report/lists.h"

#include <fmt/format.h>

#include <charconv>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr int kMaxRanks = 4096;

}  // namespace

Size parse_size(const std::string& text, const std::string& option, int most) {
  const auto extent = parse_extent(text);
  if (!extent) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is not two positive integers", option, printable(text)),
                fmt::format("write it like {} 3x2", option));
  }
  if (extent->first > most || extent->second > most) {
    throw Error(ExitCode::Limit, fmt::format("{}: {} is more than {} a side", option, printable(text), most),
                fmt::format("the most is {} {}x{}", option, most, most));
  }
  return {extent->first, extent->second};
}

std::vector<int> parse_counts(const std::string& list, const std::string& option) {
  std::vector<int> counts;
  for (const std::string& item : split_commas(list)) {
    int value = 0;
    const auto [end, failure] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (failure != std::errc{} || end != item.data() + item.size() || value < 1 || value > kMaxRanks) {
      throw Error(ExitCode::Usage,
                  fmt::format("{}: '{}' is not a number from 1 to {}", option, printable(item), kMaxRanks),
                  fmt::format("write it like {} 1,2,4,8", option));
    }
    counts.push_back(value);
  }
  return counts;
}

std::string grid_name(Size grid) {
  return fmt::format("{}x{}", grid.width, grid.height);
}

std::string wall_of(Size grid, Size screen) {
  return fmt::format("{}@{}", grid_name(grid), grid_name(screen));
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace hpr
