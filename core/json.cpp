#include "core/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>

namespace hpr {
namespace {

using Library = nlohmann::json;

constexpr std::string_view name_of(Json::Type type) {
  switch (type) {
    case Json::Type::Null:
      return "null";
    case Json::Type::Boolean:
      return "boolean";
    case Json::Type::Unsigned:
    case Json::Type::Negative:
    case Json::Type::Real:
      return "number";
    case Json::Type::String:
      return "string";
    case Json::Type::Array:
      return "array";
    case Json::Type::Object:
      break;
  }
  return "object";
}

[[noreturn]] void fail_type(const Json& json, std::string_view expected) {
  throw JsonError(fmt::format("the value is of type {}, not {}", json.type_name(), expected));
}

/// Builds a value from the events of the library's parser (nlohmann::json_sax); false would end the parsing, which
/// errors do by throwing.
class TreeBuilder {
 public:
  TreeBuilder(std::size_t text_bytes, int max_depth) : text_bytes_(text_bytes), max_depth_(max_depth) {}

  [[nodiscard]] Json take() { return std::move(root_); }

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(std::int64_t value) { return add(value); }
  bool number_unsigned(std::uint64_t value) { return add(value); }
  bool number_float(double value, const std::string& /*text*/) { return add(value); }
  bool string(std::string& text) { return add(std::move(text)); }
  bool binary(std::vector<std::uint8_t>& /*bytes*/) { return false; }
  bool start_object(std::size_t /*size*/) { return open(Json::object()); }
  bool start_array(std::size_t /*size*/) { return open(Json::array()); }
  bool key(std::string& text) {
    key_ = std::move(text);
    return true;
  }
  bool end_object() { return close(); }
  bool end_array() { return close(); }
  bool parse_error(std::size_t bytes_read, const std::string& /*token*/, const Library::exception& error) {
    // Numbers beyond double are out of range and have no position.
    if (dynamic_cast<const Library::parse_error*>(&error) == nullptr) throw JsonError(error.what());
    throw JsonError(error.what(), std::min(bytes_read > 0 ? bytes_read - 1 : 0, text_bytes_));
  }

 private:
  bool add(Json value) {
    (void)place(std::move(value));
    return true;
  }

  bool open(Json value) {
    if (open_.size() >= static_cast<std::size_t>(max_depth_)) {
      throw JsonError(fmt::format("the JSON nests deeper than {} levels", max_depth_));
    }
    open_.push_back(place(std::move(value)));
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  /// Puts a value where it belongs. Pointers to open values stay good: their neighbours come when they are closed.
  Json* place(Json value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Json& parent = *open_.back();
    Json& child = parent.is_object() ? parent[key_] : parent.elements().emplace_back();
    child = std::move(value);
    return &child;
  }

  std::size_t text_bytes_;
  int max_depth_;
  Json root_;
  std::vector<Json*> open_;
  std::string key_;
};

/// Writes values as the library does: it writes reals and strings itself, and what surrounds them is written here, so
/// that no second tree of all values is built.
class TextWriter {
 public:
  TextWriter(int indent, bool ascii) : indent_(indent), ascii_(ascii) {}

  [[nodiscard]] std::string take() { return std::move(text_); }

  void write(const Json& json, int margin = 0) {
    switch (json.type()) {
      case Json::Type::Null:
        text_ += "null";
        break;
      case Json::Type::Boolean:
        text_ += json.get<bool>() ? "true" : "false";
        break;
      case Json::Type::Unsigned:
        fmt::format_to(std::back_inserter(text_), "{}", json.get<std::uint64_t>());
        break;
      case Json::Type::Negative:
        fmt::format_to(std::back_inserter(text_), "{}", json.get<std::int64_t>());
        break;
      case Json::Type::Real:
        write_real(json.get<double>());
        break;
      case Json::Type::String:
        write_string(json.string());
        break;
      case Json::Type::Array:
        write_list(json.elements(), "[]", margin, [&](const Json& element, int inner) { write(element, inner); });
        break;
      case Json::Type::Object:
        write_list(json.members(), "{}", margin, [&](const Json::Member& member, int inner) {
          write_string(member.key);
          text_ += indent_ < 0 ? ":" : ": ";
          write(member.value, inner);
        });
    }
  }

 private:
  template <typename Item, typename Body>
  void write_list(const std::vector<Item>& items, std::string_view brackets, int margin, const Body& write_item) {
    text_ += brackets[0];
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (i > 0) text_ += ',';
      break_line(margin + indent_);
      write_item(items[i], margin + indent_);
    }
    if (!items.empty()) break_line(margin);
    text_ += brackets[1];
  }

  void break_line(int margin) {
    if (indent_ >= 0) text_.append(1, '\n').append(static_cast<std::size_t>(margin), ' ');
  }

  void write_real(double value) {
    if (!std::isfinite(value)) {
      text_ += "null";
      return;
    }
    std::array<char, 64> digits{};
    text_.append(digits.data(), nlohmann::detail::to_chars(digits.data(), digits.data() + digits.size(), value));
  }

  void write_string(const std::string& text) {
    const bool plain = std::ranges::all_of(text, [](char c) { return c >= ' ' && c < 0x7f && c != '"' && c != '\\'; });
    if (plain) {
      text_.append(1, '"').append(text).append(1, '"');
    } else {
      text_ += Library(text).dump(-1, ' ', ascii_, Library::error_handler_t::replace);
    }
  }

  int indent_;
  bool ascii_;
  std::string text_;
};

}  // namespace

/// Members in their order. Objects of many members have an index, so that no file makes looking up keys slow.
struct Json::Object {
  [[nodiscard]] Json* find(std::string_view key) {
    if (!index_.empty()) {
      const auto found = index_.find(key);
      return found == index_.end() ? nullptr : &members[found->second].value;
    }
    const auto found = std::ranges::find(members, key, &Member::key);
    return found == members.end() ? nullptr : &found->value;
  }

  /// The key must be new.
  Json& add(std::string_view key, Json value) {
    constexpr std::size_t kMaxWithoutIndex = 16;
    members.emplace_back(key, std::move(value));
    if (!index_.empty()) index_.emplace(key, members.size() - 1);
    if (index_.empty() && members.size() > kMaxWithoutIndex) build_index();
    return members.back().value;
  }

  void erase(std::string_view key) {
    std::erase_if(members, [&](const Member& member) { return member.key == key; });
    if (!index_.empty()) build_index();
  }

  std::vector<Member> members;

 private:
  void build_index() {
    index_.clear();
    for (std::size_t i = 0; i < members.size(); ++i) index_.emplace(members[i].key, i);
  }

  std::map<std::string, std::size_t, std::less<>> index_;  // key -> position; empty: members are compared in turn
};

Json::Json(std::string text) : type_(Type::String), data_{.string = new std::string(std::move(text))} {}

Json::Json(std::initializer_list<Member> members) : type_(Type::Object), data_{.object = new Object} {
  for (const auto& [key, value] : members) data_.object->add(key, value);
}

Json Json::array(std::initializer_list<Json> elements) {
  Json json;
  json.data_.array = new std::vector<Json>(elements);
  json.type_ = Type::Array;
  return json;
}

Json::Json(const Json& other) : data_(other.data_) {
  if (other.is_string()) data_.string = new std::string(*other.data_.string);
  if (other.is_array()) data_.array = new std::vector<Json>(*other.data_.array);
  if (other.is_object()) data_.object = new Object(*other.data_.object);
  type_ = other.type_;
}

Json::~Json() {
  if (is_string()) delete data_.string;
  if (is_array()) delete data_.array;
  if (is_object()) delete data_.object;
}

std::string_view Json::type_name() const {
  return name_of(type_);
}

bool Json::boolean() const {
  if (!is_boolean()) fail_type(*this, name_of(Type::Boolean));
  return data_.boolean;
}

double Json::real() const {
  if (type_ == Type::Real) return data_.real;
  if (type_ == Type::Unsigned) return static_cast<double>(data_.whole);
  if (type_ != Type::Negative) fail_type(*this, name_of(Type::Real));
  return static_cast<double>(data_.negative);
}

std::int64_t Json::integer(std::int64_t low, std::int64_t high) const {
  if (!is_integer()) throw JsonError(fmt::format("{} is no integer", dump_ascii()));
  const bool fits = type_ == Type::Negative ? data_.negative >= low : std::cmp_less_equal(data_.whole, high);
  if (!fits) throw JsonError(fmt::format("{} is not from {} to {}", dump_ascii(), low, high));
  return type_ == Type::Negative ? data_.negative : static_cast<std::int64_t>(data_.whole);
}

std::uint64_t Json::whole(std::uint64_t high) const {
  if (!is_integer()) throw JsonError(fmt::format("{} is no integer", dump_ascii()));
  if (!is_unsigned() || data_.whole > high) throw JsonError(fmt::format("{} is not from 0 to {}", dump_ascii(), high));
  return data_.whole;
}

const std::string& Json::string() const {
  if (!is_string()) fail_type(*this, name_of(Type::String));
  return *data_.string;
}

const std::vector<Json>& Json::elements() const {
  if (!is_array()) fail_type(*this, name_of(Type::Array));
  return *data_.array;
}

std::vector<Json>& Json::elements() {
  return const_cast<std::vector<Json>&>(std::as_const(*this).elements());
}

const std::vector<Json::Member>& Json::members() const {
  if (!is_object()) fail_type(*this, name_of(Type::Object));
  return data_.object->members;
}

std::vector<Json::Member>& Json::members() {
  return const_cast<std::vector<Member>&>(std::as_const(*this).members());
}

std::size_t Json::size() const {
  return is_array() ? data_.array->size() : is_object() ? data_.object->members.size() : 0;
}

const Json& Json::operator[](std::size_t index) const {
  if (index >= elements().size()) throw JsonError(fmt::format("the array of {} has no element {}", size(), index));
  return elements()[index];
}

Json& Json::operator[](std::size_t index) {
  return const_cast<Json&>(std::as_const(*this)[index]);
}

void Json::push_back(Json element) {
  if (is_null()) *this = array();
  elements().push_back(std::move(element));
}

const Json& Json::operator[](std::string_view key) const {
  static const Json null;
  const Json* const found = find(key);
  return found == nullptr ? null : *found;
}

Json& Json::operator[](std::string_view key) {
  if (is_null()) *this = object();
  if (!is_object()) fail_type(*this, name_of(Type::Object));
  Json* const found = data_.object->find(key);
  return found != nullptr ? *found : data_.object->add(key, nullptr);
}

const Json* Json::find(std::string_view key) const {
  return is_object() ? data_.object->find(key) : nullptr;
}

Json* Json::find(std::string_view key) {
  return const_cast<Json*>(std::as_const(*this).find(key));
}

const Json& Json::at(std::string_view key) const {
  if (!is_object()) fail_type(*this, name_of(Type::Object));
  const Json* const found = find(key);
  if (found == nullptr) throw JsonError(fmt::format("there is no '{}'", key));
  return *found;
}

void Json::erase(std::string_view key) {
  if (is_object()) data_.object->erase(key);
}

Json Json::parse(std::string_view text, int max_depth) {
  TreeBuilder builder(text.size(), max_depth);
  (void)Library::sax_parse(text.begin(), text.end(), &builder);
  return builder.take();
}

std::optional<Json> Json::try_parse(std::string_view text, int max_depth) {
  try {
    return parse(text, max_depth);
  } catch (const JsonError&) {
    return std::nullopt;
  }
}

std::string Json::dump(int indent) const {
  TextWriter writer(indent, false);
  writer.write(*this);
  return writer.take();
}

std::string Json::dump_ascii() const {
  TextWriter writer(-1, true);
  writer.write(*this);
  return writer.take();
}

bool operator==(const Json& a, const Json& b) {
  using Type = Json::Type;
  if (a.is_number() && b.is_number() && a.type_ != b.type_) return a.real() == b.real();
  if (a.type_ != b.type_) return false;
  switch (a.type_) {
    case Type::Null:
      return true;
    case Type::Boolean:
      return a.data_.boolean == b.data_.boolean;
    case Type::Unsigned:
      return a.data_.whole == b.data_.whole;
    case Type::Negative:
      return a.data_.negative == b.data_.negative;
    case Type::Real:
      return a.data_.real == b.data_.real;
    case Type::String:
      return a.string() == b.string();
    case Type::Array:
      return a.elements() == b.elements();
    case Type::Object:
      break;
  }
  return a.size() == b.size() && std::ranges::all_of(a.members(), [&](const Json::Member& member) {
           const Json* const other = b.find(member.key);
           return other != nullptr && *other == member.value;
         });
}

std::ostream& operator<<(std::ostream& out, const Json& json) {
  return out << json.dump();
}

}  // namespace hpr
