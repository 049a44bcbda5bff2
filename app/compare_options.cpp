#include "app/compare_options.h"

#include <fmt/format.h>

#include <charconv>

#include "core/error.h"
#include "core/names.h"
#include "core/units.h"

namespace hpr {
namespace {

constexpr int kMostRanks = 4096;

std::vector<std::string> split(std::string_view list) {
  std::vector<std::string> items;
  while (true) {
    const auto comma = list.find(',');
    items.emplace_back(list.substr(0, comma));
    if (comma == std::string_view::npos) return items;
    list.remove_prefix(comma + 1);
  }
}

}  // namespace

std::vector<std::string> split_strategies(std::string_view list) {
  std::vector<std::string> names;
  for (const std::string& item : split(list)) {
    const bool is_number = !item.empty() && item.find_first_not_of("0123456789") == std::string::npos;
    if (is_number && !names.empty()) {
      names.back() += "," + item;
    } else {
      names.push_back(item);
    }
  }
  return names;
}

Size parse_size(const std::string& text, const std::string& option, int most) {
  const auto extent = parse_extent(text);
  if (!extent) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is not two positive integers", option, printable(text)),
                fmt::format("write it like {} 3x2", option));
  }
  if (extent->first > most || extent->second > most) {
    throw Error(ExitCode::Limit, fmt::format("{}: {} is more than {} a side", option, printable(text), most));
  }
  return {extent->first, extent->second};
}

std::vector<int> parse_ranks(const std::string& list) {
  std::vector<int> ranks;
  for (const std::string& item : split(list)) {
    int value = 0;
    const auto [end, failure] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (failure != std::errc{} || end != item.data() + item.size() || value < 1 || value > kMostRanks) {
      throw Error(ExitCode::Usage,
                  fmt::format("--ranks: '{}' is not a number of ranks from 1 to {}", printable(item), kMostRanks),
                  "write it like --ranks 1,2,4,8");
    }
    ranks.push_back(value);
  }
  return ranks;
}

}  // namespace hpr
