#include "scene/gltf/document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/text.h"

namespace hpr {
GltfContext::GltfContext(std::string_view name, const SceneLimits& limits, bool in_parts)
    : name_(printable(name, 300)), limits_(limits), in_parts_(in_parts) {}

void GltfContext::fail(std::string_view where, std::string_view what, std::string_view hint, ExitCode code) const {
  const std::string message =
      where.empty() ? fmt::format("{}: {}", name_, what) : fmt::format("{}: {}: {}", name_, where, what);
  throw Error(code, message, std::string(hint));
}

void GltfContext::warn(std::string_view where, std::string_view what) {
  constexpr std::size_t kMaxWarnings = 100;
  std::string message = where.empty() ? std::string(what) : fmt::format("{}: {}", where, what);
  if (warnings_.size() >= kMaxWarnings) {
    ++dropped_;
    return;
  }
  if (seen_.insert(message).second) warnings_.push_back(std::move(message));
}

void GltfContext::warn_not_finite(std::string_view where, std::uint64_t count, std::size_t first_vertex) {
  if (count == 0) return;
  not_finite_ += count;
  warn(where, fmt::format("{} values are no finite numbers, the first at vertex {}; replaced", count, first_vertex));
}

void GltfContext::warn_unused(const Error& error) {
  const ExitCode code = error.code();
  if (code != ExitCode::BadInput && code != ExitCode::Io && code != ExitCode::Limit) throw;
  std::string_view what = error.what();
  if (const std::string prefix = name_ + ": "; what.starts_with(prefix)) what.remove_prefix(prefix.size());
  warn("", fmt::format("{}; the scene does not use it", what));
}

void GltfContext::check_room(std::uint64_t bytes, std::string_view what) const {
  if (bytes > memory_left()) {
    fail("", fmt::format("{} would take the scene past the memory limit of {} bytes", what, limits_.memory_bytes),
         "draw less, or raise --limit-mem", ExitCode::Limit);
  }
}

void GltfContext::charge(std::uint64_t bytes, std::string_view what) {
  check_room(bytes, what);
  charged_ += bytes;
}

std::vector<std::string> GltfContext::take_warnings() {
  if (dropped_ > 0) warnings_.push_back(fmt::format("{} further warnings", std::exchange(dropped_, 0)));
  seen_.clear();
  return std::exchange(warnings_, {});
}

namespace {

std::string shown(const Json& value) {
  return printable(value.dump_ascii(), 40);
}

}  // namespace

std::optional<std::int64_t> whole_number(const Json& value) {
  if (value.is_unsigned()) {
    const auto number = value.get<std::uint64_t>();
    if (number > GltfItem::kMaxWhole) return std::nullopt;
    return static_cast<std::int64_t>(number);
  }
  if (value.is_integer()) return value.get<std::int64_t>();
  if (!value.is_number()) return std::nullopt;
  const auto number = value.get<double>();
  if (std::abs(number) > static_cast<double>(GltfItem::kMaxWhole) || number != std::floor(number)) return std::nullopt;
  return static_cast<std::int64_t>(number);
}

std::string GltfItem::path() const {
  if (parent_ == nullptr) return {};
  const std::string above = parent_->path();
  const std::string here = index_ == kNone ? std::string(key_) : fmt::format("{}[{}]", key_, index_);
  return above.empty() ? here : fmt::format("{}.{}", above, here);
}

void GltfItem::fail(std::string_view key, std::string_view what, std::string_view hint) const {
  const std::string above = path();
  if (above.empty() || key.empty()) context_->fail(above.empty() ? key : std::string_view(above), what, hint);
  context_->fail(fmt::format("{}.{}", above, key), what, hint);
}

void GltfItem::warn(std::string_view key, std::string_view what) const {
  const std::string above = path();
  context_->warn(above.empty() ? std::string(key) : key.empty() ? above : fmt::format("{}.{}", above, key), what);
}

Json* GltfItem::find(const char* key, Presence presence) const {
  Json* const found = value_->find(key);
  if (found == nullptr && presence == Presence::Required) fail(key, "is missing");
  return found;
}

Json* GltfItem::array(const char* key, Presence presence) const {
  Json* const value = find(key, presence);
  if (value != nullptr && !value->is_array()) fail(key, fmt::format("must be an array, not {}", value->type_name()));
  return value;
}

GltfItem GltfItem::element(const char* key, std::size_t position) const {
  Json& value = (*value_)[key][position];
  GltfItem item(*this, key, position, value);
  if (!value.is_object()) item.fail("", fmt::format("must be an object, not {}", value.type_name()));
  return item;
}

Json GltfItem::stand_in(std::string_view section) {
  if (section == "buffers") return {{"byteLength", 1}, {"uri", "data:,0"}};
  if (section == "bufferViews") return {{"buffer", 0}, {"byteLength", 1}};
  if (section == "accessors") return {{"componentType", 5121}, {"count", 1}, {"type", "SCALAR"}};
  if (section == "meshes") return {{"primitives", Json::array()}};
  if (section == "skins") return {{"joints", Json::array()}};
  if (section == "animations") return {{"channels", Json::array()}, {"samplers", Json::array()}};
  if (section == "lights") return {{"type", "point"}};
  if (section == "cameras") {
    return {{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 1.0}}}};
  }
  return Json::object();
}

std::optional<GltfItem> GltfItem::object(const char* key, Presence presence) const {
  Json* const value = find(key, presence);
  if (value == nullptr) return std::nullopt;
  if (!value->is_object()) fail(key, fmt::format("must be an object, not {}", value->type_name()));
  return GltfItem(*this, key, kNone, *value);
}

std::optional<std::string> GltfItem::text(const char* key, Presence presence) const {
  const Json* const value = find(key, presence);
  if (value == nullptr) return std::nullopt;
  if (!value->is_string()) fail(key, fmt::format("must be text, not {}", value->type_name()));
  return value->get<std::string>();
}

std::optional<bool> GltfItem::flag(const char* key) const {
  const Json* const value = find(key, Presence::Optional);
  if (value == nullptr) return std::nullopt;
  if (!value->is_boolean()) fail(key, fmt::format("must be true or false, not {}", shown(*value)));
  return value->get<bool>();
}

std::optional<std::uint64_t> GltfItem::whole(const char* key, Presence presence, std::uint64_t low,
                                             std::uint64_t high) const {
  Json* const value = find(key, presence);
  if (value == nullptr) return std::nullopt;
  const auto number = whole_number(*value);
  if (!number || *number < 0 || static_cast<std::uint64_t>(*number) < low ||
      static_cast<std::uint64_t>(*number) > high) {
    fail(key, fmt::format("must be a whole number from {} to {}, not {}", low, high, shown(*value)));
  }
  *value = static_cast<std::uint64_t>(*number);
  return static_cast<std::uint64_t>(*number);
}

void GltfItem::check_index(Json& value, std::string_view where, std::size_t count) const {
  const auto number = whole_number(value);
  if (!number || *number < 0) fail(where, fmt::format("must be an index, not {}", shown(value)));
  if (static_cast<std::uint64_t>(*number) >= count) {
    fail(where, fmt::format("is {}, but there are only {}", *number, count));
  }
  value = *number;
}

std::optional<std::size_t> GltfItem::index_below(const char* key, std::size_t count, Presence presence) const {
  Json* const value = find(key, presence);
  if (value == nullptr) return std::nullopt;
  check_index(*value, key, count);
  return value->get<std::size_t>();
}

std::optional<std::size_t> GltfItem::index(const char* key, const char* section, Presence presence) const {
  return index_below(key, section_size(section), presence);
}

std::size_t GltfItem::indices(const char* key, const char* section, Presence presence) const {
  return indices_below(key, section_size(section), presence);
}

std::size_t GltfItem::indices_below(const char* key, std::size_t count, Presence presence) const {
  Json* const list = array(key, presence);
  if (list == nullptr) return 0;
  for (std::size_t i = 0; i < list->size(); ++i) {
    Json& value = (*list)[i];
    const auto number = whole_number(value);
    if (!number || *number < 0 || static_cast<std::uint64_t>(*number) >= count) {
      check_index(value, fmt::format("{}[{}]", key, i), count);
    }
    value = *number;
  }
  return list->size();
}

std::size_t GltfItem::index_map(const char* key, const char* section, Presence presence) const {
  const auto map = object(key, presence);
  if (!map) return 0;
  const std::size_t count = section_size(section);
  for (auto& [name, value] : map->value().members()) map->check_index(value, printable(name), count);
  return map->value().size();
}

std::optional<double> GltfItem::number(const char* key, Presence presence, double low, double high) const {
  const Json* const value = find(key, presence);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number()) fail(key, fmt::format("must be a number, not {}", shown(*value)));
  const auto number = value->get<double>();
  if (!(number >= low && number <= high)) {
    fail(key, fmt::format("is {}, outside of {} to {}", shown(*value), low, high));
  }
  return number;
}

bool GltfItem::clamp_value(Json& value, double low, double high) const {
  const auto number = value.get<double>();
  if (number >= low && number <= high) return false;
  value = std::clamp(number, low, high);
  return true;
}

std::optional<double> GltfItem::clamped(const char* key, double low, double high) const {
  Json* const value = find(key, Presence::Optional);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number()) fail(key, fmt::format("must be a number, not {}", shown(*value)));
  const std::string before = shown(*value);
  if (clamp_value(*value, low, high)) warn(key, fmt::format("is {}; taken as {}", before, shown(*value)));
  *value = value->get<double>();  // tinygltf keeps the integers of extensions in 32 bits
  return value->get<double>();
}

bool GltfItem::numbers(const char* key, std::size_t count, double low, double high) const {
  Json* const list = array(key, Presence::Optional);
  if (list == nullptr) return false;
  if (count > 0 && list->size() != count) {
    fail(key, fmt::format("must have {} numbers, not {}", count, list->size()));
  }
  for (Json& value : list->elements()) {
    if (!value.is_number()) fail(key, fmt::format("must hold numbers, not {}", shown(value)));
    const Json before = value;
    if (clamp_value(value, low, high)) warn(key, fmt::format("has {}; taken as {}", shown(before), shown(value)));
  }
  return true;
}

std::size_t GltfItem::section_size(const char* section) const {
  const Json* const found = root_->find(section);
  return found != nullptr && found->is_array() ? found->size() : 0;
}

Json parse_json(std::string_view text, const GltfContext& context) {
  try {
    return Json::parse(text);
  } catch (const JsonError& error) {
    if (!error.offset()) {
      context.fail("", "the JSON holds a number that no computer holds", "look for exponents above 308");
    }
    const std::size_t offset = *error.offset();
    const std::size_t before = offset > 0 ? text.rfind('\n', offset - 1) : std::string_view::npos;
    const std::size_t start = before == std::string_view::npos ? 0 : before + 1;
    const std::size_t end = std::min(text.find('\n', offset), text.size());
    const auto line = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(offset), '\n') + 1;
    // Files without line breaks: show what stands around the fault.
    const std::size_t from = std::max(start, offset > 60 ? offset - 60 : 0);
    throw Error(ExitCode::BadInput,
                fmt::format("{}:{}:{}: the JSON is broken{}", context.name(), line, offset - start + 1,
                            offset >= text.size() ? ": it ends too early" : ""),
                "export the scene again, or repair the file", printable(text.substr(from, end - from), 120));
  }
}

}  // namespace hpr
