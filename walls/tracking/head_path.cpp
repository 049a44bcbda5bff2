#include "walls/tracking/head_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/text.h"
#include "walls/config/toml_document.h"

namespace hpr {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{64} << 20U;
constexpr double kMaxCoordinate = 1e6;  ///< metres, and seconds by as much again

[[noreturn]] void fail(const std::string& name, int line, std::string_view what, std::string_view text) {
  throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", name, line, what),
              "a pose is time, x, y, z and nothing more, or heading, pitch, roll, or qx, qy, qz, qw; times rise",
              printable(text));
}

/// Numbers between commas: time, x, y, z and the rest of a pose.
std::optional<std::vector<double>> csv_row(std::string_view line) {
  std::vector<double> numbers;
  while (true) {
    const std::size_t comma = line.find(',');
    std::string_view word = line.substr(0, comma);
    while (!word.empty() && (word.front() == ' ' || word.front() == '\t')) word.remove_prefix(1);
    while (!word.empty() && (word.back() == ' ' || word.back() == '\t' || word.back() == '\r')) word.remove_suffix(1);
    double value = 0.0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
    numbers.push_back(value);
    if (comma == std::string_view::npos) return numbers;
    line.remove_prefix(comma + 1);
  }
}

/// {"time": t, "position": [x, y, z], "orientation": [qx, qy, qz, qw]}, or "heading_pitch_roll", or neither.
std::optional<std::vector<double>> json_row(std::string_view line) {
  const Json json = Json::try_parse(line).value_or(Json());
  if (!json["time"].is_number()) return std::nullopt;
  std::vector<double> numbers{json["time"].get<double>()};
  if (!json.contains("position")) return std::nullopt;
  const bool turned = json.contains("orientation");
  const bool angled = json.contains("heading_pitch_roll");
  if (turned && angled) return std::nullopt;
  const auto add = [&](const char* key, std::size_t count) {
    const Json& list = json[key];
    if (!list.is_array() || list.size() != count) return false;
    for (const Json& item : list.elements()) {
      if (!item.is_number()) return false;
      numbers.push_back(item.get<double>());
    }
    return true;
  };
  if (!add("position", 3)) return std::nullopt;
  if (turned && !add("orientation", 4)) return std::nullopt;
  if (angled && !add("heading_pitch_roll", 3)) return std::nullopt;
  return numbers;
}

/// The row of a table of the array `poses`.
std::optional<std::vector<double>> toml_row(const TomlValue& table) {
  using Type = TomlValue::Type;
  const auto value = [&](std::string_view key) -> const TomlValue* {
    const auto entry = std::ranges::find(table.entries, key, &TomlEntry::key);
    return entry == table.entries.end() ? nullptr : &entry->value;
  };
  const auto is_number = [](const TomlValue& v) { return v.type == Type::Integer || v.type == Type::Real; };
  const TomlValue* const time = value("time");
  if (time == nullptr || !is_number(*time)) return std::nullopt;
  std::vector<double> numbers{time->real};
  const TomlValue* const orientation = value("orientation");
  const TomlValue* const angles = value("heading_pitch_roll");
  if (value("position") == nullptr || (orientation != nullptr && angles != nullptr)) return std::nullopt;
  const std::pair<const TomlValue*, std::size_t> lists[] = {{value("position"), 3}, {orientation, 4}, {angles, 3}};
  for (const auto& [list, count] : lists) {
    if (list == nullptr) continue;
    if (list->type != Type::Array || list->items.size() != count) return std::nullopt;
    for (const TomlValue& item : list->items) {
      if (!is_number(item)) return std::nullopt;
      numbers.push_back(item.real);
    }
  }
  return numbers;
}

/// Collects samples and refuses what is none.
class Collector {
 public:
  explicit Collector(std::string name) : name_(std::move(name)) {}

  void add(const std::optional<std::vector<double>>& row, int line, std::string_view text) {
    HeadSample sample;
    if (!row || row->size() < 4 || !pose_from(std::span(*row).subspan(1), sample.pose) ||
        !(std::abs(row->front()) <= kMaxCoordinate)) {
      fail(name_, line, "no pose of a head", text);
    }
    sample.time = row->front();
    if (!samples_.empty() && !(sample.time > samples_.back().time)) {
      fail(name_, line, fmt::format("time {} comes after {}", sample.time, samples_.back().time), text);
    }
    samples_.push_back(sample);
  }

  [[nodiscard]] HeadPath path() {
    if (samples_.empty()) {
      throw Error(ExitCode::BadInput, fmt::format("{}: a head's path without poses", name_),
                  "write one a line, e.g. 0.0,0.0,1.7,0.5");
    }
    return HeadPath(std::move(samples_));
  }

 private:
  std::string name_;
  std::vector<HeadSample> samples_;
};

HeadPath parse_toml_path(std::string_view text, const std::string& name) {
  const auto parsed = parse_toml(text);
  if (const auto* const failure = std::get_if<TomlFailure>(&parsed)) {
    throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", name, failure->position.line, failure->what),
                "write poses = [{ time = 0.0, position = [x, y, z] }, ...]");
  }
  Collector collector(name);
  for (const TomlEntry& entry : std::get<TomlValue>(parsed).entries) {
    if (entry.key != "poses" || entry.value.type != TomlValue::Type::Array) {
      throw Error(ExitCode::BadInput,
                  fmt::format("{}:{}: '{}' is no array of poses", name, entry.position.line, printable(entry.key)),
                  "write poses = [{ time = 0.0, position = [x, y, z] }, ...]");
    }
    for (const TomlValue& item : entry.value.items) collector.add(toml_row(item), item.position.line, "");
  }
  return collector.path();
}

}  // namespace

bool pose_from(std::span<const double> numbers, HeadPose& pose) {
  constexpr double kMinLength = 1e-3;
  constexpr double kMaxLength = 1e3;
  if (numbers.size() != 3 && numbers.size() != 6 && numbers.size() != 7) return false;
  if (!std::ranges::all_of(numbers, [](double n) { return std::abs(n) <= kMaxCoordinate; })) return false;
  pose.position = {numbers[0], numbers[1], numbers[2]};
  pose.orientation = {1.0, 0.0, 0.0, 0.0};
  if (numbers.size() == 6) pose.orientation = orientation_of(numbers[3], numbers[4], numbers[5]);
  if (numbers.size() == 7) {
    const glm::dquat turn(numbers[6], numbers[3], numbers[4], numbers[5]);
    const double length = glm::length(turn);
    if (!(length > kMinLength && length < kMaxLength)) return false;
    pose.orientation = turn / length;
  }
  return true;
}

glm::dquat orientation_of(double heading, double pitch, double roll) {
  const auto about = [](double degrees, const glm::dvec3& axis) { return glm::angleAxis(glm::radians(degrees), axis); };
  return about(heading, {0.0, 1.0, 0.0}) * about(pitch, {1.0, 0.0, 0.0}) * about(roll, {0.0, 0.0, 1.0});
}

HeadPath::HeadPath(std::vector<HeadSample> samples) : samples_(std::move(samples)) {
  HPR_CHECK(!samples_.empty());
}

HeadPose HeadPath::at(double seconds) const {
  const double time = samples_.front().time + seconds;
  const auto after = std::ranges::upper_bound(samples_, time, {}, &HeadSample::time);
  if (after == samples_.begin()) return samples_.front().pose;
  if (after == samples_.end()) return samples_.back().pose;
  const HeadSample& from = *(after - 1);
  const double fraction = (time - from.time) / (after->time - from.time);
  return {glm::mix(from.pose.position, after->pose.position, fraction),
          glm::normalize(glm::slerp(from.pose.orientation, after->pose.orientation, fraction))};
}

HeadPath parse_head_path(std::string_view text, HeadPathFormat format, const std::string& name) {
  if (format == HeadPathFormat::Toml) return parse_toml_path(text, name);
  Collector collector(name);
  text = without_mark(text);
  bool first = true;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.find_first_not_of(" \t\r") == std::string_view::npos || line.starts_with('#')) continue;
    const bool heading = first && format == HeadPathFormat::Csv && line.starts_with("time");
    first = false;
    if (heading) continue;
    collector.add(format == HeadPathFormat::Csv ? csv_row(line) : json_row(line), number, line);
  }
  return collector.path();
}

HeadPath load_head_path(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  const std::string name = printable(file.string());
  HeadPathFormat format = HeadPathFormat::Csv;
  if (extension == ".json" || extension == ".jsonl") {
    format = HeadPathFormat::JsonLines;
  } else if (extension == ".toml") {
    format = HeadPathFormat::Toml;
  } else if (extension != ".csv") {
    throw Error(ExitCode::BadInput, fmt::format("'{}' is no head's path", name),
                "it is a .csv, .json, .jsonl (an object a line) or .toml file");
  }
  const auto bytes = read_file(file, kMaxFileBytes);
  return parse_head_path({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, format, name);
}

}  // namespace hpr
