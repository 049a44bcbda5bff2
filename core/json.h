#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iosfwd>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace hpr {

/// A text is no JSON, or a JSON value is not what the program asks it for.
class JsonError : public std::runtime_error {
 public:
  explicit JsonError(const std::string& what, std::optional<std::size_t> offset = std::nullopt)
      : std::runtime_error(what), offset_(offset) {}

  /// The number of bytes before a syntax error, the whole text where it ends too early. None for every other error.
  [[nodiscard]] std::optional<std::size_t> offset() const { return offset_; }

 private:
  std::optional<std::size_t> offset_;
};

/// Sequences and maps of the standard library, text excepted.
template <typename T>
concept JsonRange = !std::convertible_to<T, std::string_view> && requires(const T& range) {
  { *range.begin() } -> std::convertible_to<typename T::value_type>;
  range.end();
};

/// A JSON value (RFC 8259). Objects keep the order in which members were added. Integers are exact from -2^63 to 2^64-1
/// and are not reals: 3 is written as 3, 3.0 as 3.0. Reals that are not finite are written as null.
///
///   Json report{{"schema", "hpr.example/1"}, {"size", {{"width", 64}, {"height", 48}}}};
///   report["corner"] = Json::array({0, 1.5});
///   report["frames"].push_back({{"ms", 16.7}});
///   std::fputs(report.dump(2).c_str(), stdout);
///
///   const Json file = Json::parse(text);
///   for (const Json& frame : file.at("frames").elements()) total += frame.at("ms").get<double>();
///
/// Braces make objects, Json::array({...}) makes arrays; both copy their values, so a large one is moved to its place
/// by operator[] or push_back.
class Json {
 public:
  enum class Type : std::uint8_t { Null, Boolean, Unsigned, Negative, Real, String, Array, Object };

  struct Member;

  /// How deep arrays and objects may nest in a parsed text; copying, writing and destroying a value recurse this deep.
  static constexpr int kMaxDepth = 256;

  Json() = default;
  Json(std::nullptr_t) {}
  template <std::same_as<bool> T>
  Json(T value) : type_(Type::Boolean), data_{.boolean = value} {}
  template <std::integral T>
  requires(!std::same_as<T, bool>) Json(T value) {
    if (std::in_range<std::uint64_t>(value)) {
      type_ = Type::Unsigned;
      data_.whole = static_cast<std::uint64_t>(value);
    } else {
      type_ = Type::Negative;
      data_.negative = static_cast<std::int64_t>(value);
    }
  }
  template <std::floating_point T>
  Json(T value) : type_(Type::Real), data_{.real = static_cast<double>(value)} {}
  Json(std::string text);
  Json(std::string_view text) : Json(std::string(text)) {}
  Json(const char* text) : Json(std::string(text)) {}
  /// Null where there is no value.
  template <typename T>
  Json(const std::optional<T>& value) {
    if (value) *this = Json(*value);
  }
  /// An array of a sequence's values, or an object of a map's.
  template <JsonRange T>
  Json(const T& range);
  /// An object of these members, whose keys must differ.
  Json(std::initializer_list<Member> members);
  [[nodiscard]] static Json array(std::initializer_list<Json> elements = {});
  [[nodiscard]] static Json object() { return std::initializer_list<Member>{}; }

  Json(const Json& other);
  Json(Json&& other) noexcept { swap(other); }
  Json& operator=(const Json& other) { return *this = Json(other); }
  Json& operator=(Json&& other) noexcept {
    Json moved(std::move(other));
    swap(moved);
    return *this;
  }
  ~Json();
  void swap(Json& other) noexcept {
    std::swap(type_, other.type_);
    std::swap(data_, other.data_);
  }

  [[nodiscard]] Type type() const { return type_; }
  /// "null", "boolean", "number", "string", "array" or "object".
  [[nodiscard]] std::string_view type_name() const;
  [[nodiscard]] bool is_null() const { return type_ == Type::Null; }
  [[nodiscard]] bool is_boolean() const { return type_ == Type::Boolean; }
  [[nodiscard]] bool is_number() const { return is_integer() || type_ == Type::Real; }
  [[nodiscard]] bool is_integer() const { return type_ == Type::Unsigned || type_ == Type::Negative; }
  [[nodiscard]] bool is_unsigned() const { return type_ == Type::Unsigned; }
  [[nodiscard]] bool is_string() const { return type_ == Type::String; }
  [[nodiscard]] bool is_array() const { return type_ == Type::Array; }
  [[nodiscard]] bool is_object() const { return type_ == Type::Object; }

  /// The value as bool, an integer type, float, double, std::string or a std::vector of these. Throws JsonError where
  /// it is of another kind: reals are no integers, and an integer must fit the type. Every number may be read as real.
  template <typename T>
  [[nodiscard]] T get() const;
  /// The text of a string; throws JsonError for every other value.
  [[nodiscard]] const std::string& string() const;

  /// The values of an array; throws JsonError for every other value.
  [[nodiscard]] const std::vector<Json>& elements() const;
  [[nodiscard]] std::vector<Json>& elements();
  /// The members of an object in their order; throws JsonError for every other value. Values may be changed, keys not.
  [[nodiscard]] const std::vector<Member>& members() const;
  [[nodiscard]] std::vector<Member>& members();
  /// How many elements or members there are; 0 for what is neither array nor object.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] bool empty() const { return size() == 0; }

  /// An element of an array. Throws JsonError past its end and for every other value.
  [[nodiscard]] const Json& operator[](std::size_t index) const;
  [[nodiscard]] Json& operator[](std::size_t index);
  /// Appends to an array; null becomes one. Throws JsonError for every other value.
  void push_back(Json element);

  /// A member's value; null where there is none, and in what is no object.
  [[nodiscard]] const Json& operator[](std::string_view key) const;
  /// A member's value, which is added as null where there is none; null becomes an object. Throws JsonError for every
  /// other value. References to members of an object end when one is added to it.
  Json& operator[](std::string_view key);
  /// A member's value; nullptr where there is none, and in what is no object.
  [[nodiscard]] const Json* find(std::string_view key) const;
  [[nodiscard]] Json* find(std::string_view key);
  [[nodiscard]] bool contains(std::string_view key) const { return find(key) != nullptr; }
  /// A member's value; throws JsonError, with the key, where there is none.
  [[nodiscard]] const Json& at(std::string_view key) const;
  /// A member's value as get() reads it; `otherwise` where there is none.
  template <typename T>
  [[nodiscard]] T value(std::string_view key, T otherwise) const {
    const Json* const found = find(key);
    return found == nullptr ? otherwise : found->get<T>();
  }
  /// Removes a member if there is one.
  void erase(std::string_view key);

  /// Reads a whole text, UTF-8. Of members with the same key the last one's value counts, at the position of the first.
  /// Throws JsonError: with an offset for what is no JSON, without one for numbers beyond double and for arrays and
  /// objects that nest deeper than `max_depth`.
  [[nodiscard]] static Json parse(std::string_view text, int max_depth = kMaxDepth);
  /// What parse() returns; none where it throws.
  [[nodiscard]] static std::optional<Json> try_parse(std::string_view text, int max_depth = kMaxDepth);

  /// The value as text: on one line without spaces, or with `indent` spaces a level. Real numbers have the fewest
  /// digits that read back to the same bits. Bytes of strings that are no UTF-8 become U+FFFD.
  [[nodiscard]] std::string dump(int indent = -1) const;
  /// The value on one line, with escapes (\u00e9) for what is not ASCII.
  [[nodiscard]] std::string dump_ascii() const;

  /// Whether two values are the same: numbers by their value (3 equals 3.0), objects whatever the order of members.
  friend bool operator==(const Json& a, const Json& b);
  /// Writes dump(): for messages of tests.
  friend std::ostream& operator<<(std::ostream& out, const Json& json);

 private:
  struct Object;
  union Data {
    bool boolean;
    std::uint64_t whole;
    std::int64_t negative;
    double real;
    std::string* string;       // owned
    std::vector<Json>* array;  // owned
    Object* object;            // owned
  };

  [[nodiscard]] bool boolean() const;
  [[nodiscard]] double real() const;
  [[nodiscard]] std::int64_t integer(std::int64_t low, std::int64_t high) const;
  [[nodiscard]] std::uint64_t whole(std::uint64_t high) const;

  Type type_ = Type::Null;
  Data data_{.whole = 0};
};

/// A key of an object and its value.
struct Json::Member {
  template <std::convertible_to<std::string_view> Key>
  Member(Key&& name, Json content) : key(std::forward<Key>(name)), value(std::move(content)) {}

  std::string key;
  Json value;
};

template <JsonRange T>
Json::Json(const T& range) {
  if constexpr (requires { typename T::mapped_type; }) {
    *this = object();
    for (const auto& [key, value] : range) (*this)[key] = value;
  } else {
    *this = array();
    for (const auto& element : range) push_back(element);
  }
}

template <typename T>
T Json::get() const {
  if constexpr (std::same_as<T, bool>) {
    return boolean();
  } else if constexpr (std::signed_integral<T>) {
    return static_cast<T>(integer(std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
  } else if constexpr (std::unsigned_integral<T>) {
    return static_cast<T>(whole(std::numeric_limits<T>::max()));
  } else if constexpr (std::floating_point<T>) {
    return static_cast<T>(real());
  } else if constexpr (std::same_as<T, std::string>) {
    return string();
  } else {
    T values;
    for (const Json& element : elements()) values.push_back(element.get<typename T::value_type>());
    return values;
  }
}

}  // namespace hpr
