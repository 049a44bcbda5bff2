#include "walls/config/host_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

[[noreturn]] void refuse(std::string_view list, std::string_view why) {
  throw Error(ExitCode::Usage, fmt::format("'{}' is no list of hosts: {}", printable(list), why),
              "write e.g. wall0[1-9] or a[01-03,07],b2");
}

/// Splits at the commas that stand outside of brackets.
std::vector<std::string_view> words_of(std::string_view list) {
  std::vector<std::string_view> words;
  std::size_t begin = 0;
  bool inside = false;
  for (std::size_t i = 0; i <= list.size(); ++i) {
    const char c = i < list.size() ? list[i] : ',';
    if (c == '[' && inside) refuse(list, "a bracket opens inside another");
    if (c == ']' && !inside) refuse(list, "a bracket closes that never opened");
    inside = c == '[' || (inside && c != ']');
    if (c != ',' || (inside && i < list.size())) continue;
    if (inside) refuse(list, "a bracket never closes");
    if (i == begin) refuse(list, "a name is missing");
    words.push_back(list.substr(begin, i - begin));
    begin = i + 1;
  }
  return words;
}

int number_of(std::string_view digits, std::string_view list) {
  int number = 0;
  const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  const bool plain = !digits.empty() && digits.front() >= '0' && digits.front() <= '9';
  if (!plain || failed != std::errc() || end != digits.data() + digits.size()) {
    refuse(list, fmt::format("'{}' is no number", printable(digits)));
  }
  return number;
}

void check_count(std::size_t count, std::string_view list) {
  if (count <= static_cast<std::size_t>(kMaxScreens)) return;
  refuse(list, fmt::format("it has more than {} hosts", kMaxScreens));
}

/// What a bracket's text "01-03,07" stands for.
std::vector<std::string> numbers_of(std::string_view text, std::string_view list) {
  std::vector<std::string> numbers;
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view range = text.substr(0, comma);
    const std::size_t dash = range.find('-');
    const std::string_view low = range.substr(0, dash);
    const std::string_view high = dash == std::string_view::npos ? low : range.substr(dash + 1);
    const int first = number_of(low, list);
    const int last = number_of(high, list);
    if (last < first) refuse(list, fmt::format("the range {} runs backwards", range));
    const bool padded = low.size() > 1 && low.front() == '0';
    if (padded && high.size() < low.size()) refuse(list, fmt::format("the range {} has ends of other widths", range));
    check_count(static_cast<std::size_t>(last - first), list);
    for (int number = first; number <= last; ++number) {
      numbers.push_back(fmt::format("{:0{}}", number, padded ? low.size() : 1));
    }
    check_count(numbers.size(), list);
    if (comma == std::string_view::npos) return numbers;
    text.remove_prefix(comma + 1);
  }
}

std::vector<std::string> expand(std::string_view word, std::string_view list) {
  std::vector<std::string> names{""};
  while (!word.empty()) {
    const std::size_t bracket = word.find('[');
    for (std::string& name : names) name += word.substr(0, bracket);
    if (bracket == std::string_view::npos) break;
    const std::size_t end = word.find(']');
    const std::vector<std::string> numbers = numbers_of(word.substr(bracket + 1, end - bracket - 1), list);
    check_count(names.size() * numbers.size(), list);
    std::vector<std::string> longer;
    for (const std::string& name : names) {
      for (const std::string& number : numbers) longer.push_back(name + number);
    }
    names = std::move(longer);
    word.remove_prefix(end + 1);
  }
  return names;
}

bool is_host(std::string_view name) {
  constexpr std::size_t kLongest = 64;  // as the system has it
  return !name.empty() && name.size() <= kLongest && name.front() != '-' && name.front() != '.' &&
         std::ranges::all_of(name, [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.' ||
                  c == '_';
         });
}

}  // namespace

std::vector<std::string> parse_host_list(std::string_view text) {
  std::vector<std::string> hosts;
  std::set<std::string> seen;
  for (const std::string_view word : words_of(text)) {
    for (std::string& host : expand(word, text)) {
      if (!is_host(host)) refuse(text, fmt::format("'{}' cannot be a host's name", printable(host)));
      if (!seen.insert(host).second) refuse(text, fmt::format("it names '{}' twice", host));
      hosts.push_back(std::move(host));
    }
    check_count(hosts.size(), text);
  }
  return hosts;
}

}  // namespace hpr
