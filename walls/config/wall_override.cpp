#include "walls/config/wall_override.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <vector>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::string_view kForm = "write PATH=VALUE, e.g. viewers.0.position_m=[0,1.6,0.5] or stereo.mode=anaglyph";

void set_place(TomlValue& value, TextPlace place) {
  value.place = place;
  for (TomlValue& item : value.items) set_place(item, place);
  for (TomlEntry& entry : value.entries) {
    entry.place = place;
    set_place(entry.value, place);
  }
}

/// None when the text is neither TOML nor a bare word.
std::optional<TomlValue> value_of(std::string_view text) {
  auto parsed = parse_toml(fmt::format("v = {}", text));
  if (auto* const table = std::get_if<TomlValue>(&parsed)) {
    if (table->entries.size() == 1) return std::move(table->entries.front().value);
    return std::nullopt;
  }
  const bool bare = !text.empty() && std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-_./:").find(c) != std::string_view::npos;
  });
  if (!bare) return std::nullopt;
  TomlValue word;
  word.type = TomlValue::Type::Text;
  word.text = std::string(text);
  return word;
}

std::vector<std::string> steps_of(std::string_view path) {
  std::vector<std::string> steps;
  while (true) {
    const std::size_t dot = path.find('.');
    steps.emplace_back(path.substr(0, dot));
    if (dot == std::string_view::npos) return steps;
    path.remove_prefix(dot + 1);
  }
}

std::optional<std::size_t> index_of(const std::string& step) {
  std::size_t index = 0;
  const auto [stop, error] = std::from_chars(step.data(), step.data() + step.size(), index);
  if (error != std::errc() || stop != step.data() + step.size()) return std::nullopt;
  return index;
}

/// Goes from a value to the one a step below; what is missing is made.
class Walker {
 public:
  Walker(TomlValue& document, TextPlace place, Findings& findings)
      : value_(&document), place_(place), findings_(findings) {}

  /// False, and a finding, where there is no such step.
  bool step(const std::string& name) {
    const auto index = index_of(name);
    if (fresh_) value_->type = index ? TomlValue::Type::Array : TomlValue::Type::Table;
    if (value_->type == TomlValue::Type::Array) return index ? into_array(*index) : refuse(name, "takes a number");
    if (value_->type == TomlValue::Type::Table) return into_table(name);
    return refuse(name, fmt::format("is inside {}", describe(value_->type)));
  }

  void put(TomlValue value) {
    set_place(value, place_);
    *value_ = std::move(value);
  }

 private:
  [[nodiscard]] TomlValue made() const {
    TomlValue value;
    value.place = place_;
    return value;
  }

  bool into_array(std::size_t index) {
    if (index > value_->items.size()) {
      return refuse(std::to_string(index), fmt::format("is beyond the {} there are", value_->items.size()));
    }
    fresh_ = index == value_->items.size();
    if (fresh_) value_->items.push_back(made());
    value_ = &value_->items[index];
    return true;
  }

  bool into_table(const std::string& name) {
    const auto entry = std::ranges::find(value_->entries, name, &TomlEntry::key);
    fresh_ = entry == value_->entries.end();
    if (fresh_) {
      value_->entries.push_back({name, place_, made()});
      value_ = &value_->entries.back().value;
    } else {
      value_ = &entry->value;
    }
    return true;
  }

  bool refuse(const std::string& name, std::string_view why) {
    findings_.error(place_, fmt::format("'{}' of the path {}", printable(name), why), std::string(kForm));
    return false;
  }

  TomlValue* value_;
  TextPlace place_;
  Findings& findings_;
  bool fresh_ = false;  ///< value_ was made by the last step
};

}  // namespace

void apply_overrides(TomlValue& document, std::span<const std::string> overrides, Findings& findings) {
  for (std::size_t i = 0; i < overrides.size(); ++i) {
    const std::string_view text = overrides[i];
    const TextPlace place{0, 0, static_cast<int>(i) + 1};
    const std::size_t equals = text.find('=');
    const std::string_view path = text.substr(0, equals);
    auto value = equals == std::string_view::npos ? std::nullopt : value_of(text.substr(equals + 1));
    const std::vector<std::string> steps = steps_of(path);
    if (!value || std::ranges::any_of(steps, &std::string::empty)) {
      throw Error(ExitCode::Usage,
                  fmt::format("--set {}: {}", printable(text),
                              value ? "a key of the path is empty" : "the value is neither TOML nor a word"),
                  std::string(kForm));
    }
    Walker walker(document, place, findings);
    if (std::ranges::all_of(steps, [&](const std::string& step) { return walker.step(step); })) {
      walker.put(std::move(*value));
    }
  }
}

}  // namespace hpr
