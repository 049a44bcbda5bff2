#include "core/text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <sstream>
#include <utility>
#include <vector>

namespace hpr {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> cost(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) cost[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) cost[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      cost[i][j] = std::min({cost[i - 1][j] + 1, cost[i][j - 1] + 1, cost[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
      }
    }
  }
  return cost[a.size()][b.size()];
}

/// Bytes of the UTF-8 sequence that starts `text` (RFC 3629: no overlong forms, no surrogates), and its code point; 0
/// when there is no valid one.
std::pair<std::size_t, std::uint32_t> decode_utf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return {1, first};
  const std::size_t length = first >= 0xC2 && first < 0xE0   ? 2
                             : first >= 0xE0 && first < 0xF0 ? 3
                             : first >= 0xF0 && first < 0xF5 ? 4
                                                             : 0;
  if (length == 0 || length > text.size()) return {0, 0};
  std::uint32_t code = first & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {0, 0};
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> kMinCode{0, 0, 0x80, 0x800, 0x10000};
  if (code < kMinCode[length] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return {0, 0};
  return {length, code};
}

/// Control codes, line separators, and what is invisible or turns the text around it (Unicode's Bidi_Control).
bool disturbs_terminals(std::uint32_t code) {
  const auto between = [code](std::uint32_t low, std::uint32_t high) { return code >= low && code <= high; };
  return code < 0x20 || between(0x7F, 0x9F) || code == 0x061C || between(0x200B, 0x200F) || between(0x2028, 0x202E) ||
         between(0x2060, 0x206F) || code == 0xFEFF;
}

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

std::optional<std::string> nearest_name(std::string_view name, std::span<const std::string> choices) {
  if (name.size() > 200) return std::nullopt;
  std::optional<std::string> best;
  std::size_t best_distance = (name.size() + 2) / 3;
  for (const std::string& choice : choices) {
    const std::size_t distance = edit_distance(name, choice);
    if (distance < best_distance || (distance == best_distance && !best)) {
      best = choice;
      best_distance = distance;
    }
  }
  return best;
}

std::string unknown_name_hint(std::string_view name, std::span<const std::string> choices) {
  constexpr std::size_t kMaxShown = 40;
  const auto nearest = nearest_name(name, choices);
  const auto shown = choices.first(std::min(choices.size(), kMaxShown));
  return fmt::format("{}choices: {}{}", nearest ? fmt::format("did you mean '{}'? ", *nearest) : "",
                     fmt::join(shown, ", "),
                     choices.size() > kMaxShown ? fmt::format(" and {} more", choices.size() - kMaxShown) : "");
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string out;
  while (!text.empty()) {
    const auto [length, code] = decode_utf8(text);
    std::string piece(text.substr(0, std::max<std::size_t>(length, 1)));
    text.remove_prefix(piece.size());
    if (length == 0 || disturbs_terminals(code)) {
      std::string escaped;
      for (const char c : piece) escaped += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
      piece = std::move(escaped);
    }
    if (out.size() + piece.size() > limit) return out + "...";
    out += piece;
  }
  return out;
}

std::vector<std::string> split_commas(std::string_view list) {
  std::vector<std::string> items;
  while (true) {
    const auto comma = list.find(',');
    items.emplace_back(list.substr(0, comma));
    if (comma == std::string_view::npos) return items;
    list.remove_prefix(comma + 1);
  }
}

std::vector<std::string> split_words(std::string_view list) {
  std::vector<std::string> words;
  for (std::size_t start = 0; start <= list.size();) {
    const std::size_t end = std::min(list.find(',', start), list.size());
    if (end > start) words.emplace_back(list.substr(start, end - start));
    start = end + 1;
  }
  return words;
}

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

std::optional<std::vector<std::string>> split_line(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  std::string word;
  while (stream >> std::ws && stream.peek() != '#' && !stream.eof()) {
    const bool quoted = stream.peek() == '"';
    if (!(stream >> std::quoted(word))) {
      if (quoted) return std::nullopt;
      break;
    }
    words.push_back(word);
  }
  return words;
}

std::string shell_quote(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string(R"('\'')") : std::string(1, c);
  return quoted + "'";
}

std::string shell_line(std::span<const std::string> words) {
  constexpr std::string_view kPlain = "_./:=,+@%-";
  const auto plain = [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || kPlain.find(c) != std::string_view::npos;
  };
  std::string line;
  for (const std::string& word : words) {
    if (!line.empty()) line += ' ';
    line += !word.empty() && std::ranges::all_of(word, plain) ? word : shell_quote(word);
  }
  return line;
}

}  // namespace hpr
