#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/json.h"
#include "image/color.h"
#include "image/image.h"
#include "walls/config/toml_reader.h"

/// Tables of keys: what TOML of a kind may hold, from which its reader, its writer, its JSON Schema and its docs come.
/// walls/config/wall_keys.cpp has the table of wall files.
namespace hpr {

/// The key of a TOML table that is being read.
struct KeySource {
  TableReader& reader;
  std::string_view key;
  const std::filesystem::path& folder;  ///< in which files are looked for that the text names
};

/// A row of the tables of keys in docs.
struct KeyDescription {
  std::string table;  ///< "windows[]"; empty: the outermost one
  std::string key;
  std::string takes;    ///< the values, for people: "1 to 64"
  std::string initial;  ///< the value where the key is absent; empty: there is none
  std::string help;
};

/// What values a key takes, and the member of T that they fill.
template <typename T>
struct KeyKind {
  std::string takes;
  Json schema;
  /// Fills the member where the key is there. What is wrong with its value becomes a finding of the reader.
  std::function<void(const KeySource&, T&)> read;
  std::function<std::string(const T&)> write = {};  ///< the value as TOML; null: the key is never written
  std::function<bool(const T&)> is_initial = {};    ///< such values are not written; null: all are
  std::string initial = {};                         ///< for docs
  bool is_ignored = false;                          ///< valid and not acted on
  std::vector<KeyDescription> inner = {};           ///< of tables: their keys; KeyDescription::table is from the key on
  /// Of the keys of the outermost table: what is written as [tables] of their own, after all values.
  std::function<std::string(const T&)> write_blocks = {};
};

/// A row of a table of keys.
template <typename T>
struct TableKey {
  std::string_view name;
  KeyKind<T> kind;
  std::string_view help;
  std::string_view example = {};  ///< not empty: the key is required, and this is suggested where it is missing
  std::string_view initial = {};  ///< for docs, where the kind does not know it
};

/// The keys of one kind of TOML table, in the order in which they are written.
template <typename T>
struct KeyTable {
  std::string_view name;  ///< in messages: "window"
  std::vector<TableKey<T>> keys;
  /// A rule of the schema: "oneOf", "anyOf" or "not", and the keys it is about.
  std::string_view combination = {};
  std::vector<std::string_view> combined = {};
};

/// Reads all keys of a TOML table, and calls `then` with the name of each when it was read; unknown ones are findings.
template <typename T, typename Then>
void read_keys(const KeyTable<T>& table, TableReader& reader, const std::filesystem::path& folder, T& into, Then then) {
  for (const TableKey<T>& key : table.keys) {
    if (!key.example.empty()) reader.require(key.name, key.example);
    key.kind.read({reader, key.name, folder}, into);
    then(key.name);
  }
  reader.finish();
}

template <typename T>
void read_keys(const KeyTable<T>& table, TableReader& reader, const std::filesystem::path& folder, T& into) {
  read_keys(table, reader, folder, into, [](std::string_view /*key*/) {});
}

/// "key = value" of each key that is written, between `before` and `after`.
template <typename T>
std::string write_keys(const KeyTable<T>& table, const T& from, std::string_view before, std::string_view after) {
  std::string text;
  for (const auto& [name, kind, help, example, initial] : table.keys) {
    if (!kind.write || (kind.is_initial && kind.is_initial(from))) continue;
    text += fmt::format("{}{} = {}{}", before, name, kind.write(from), after);
  }
  return text;
}

/// "{ key = value, ... }".
template <typename T>
std::string write_inline(const KeyTable<T>& table, const T& from) {
  const std::string keys = write_keys(table, from, ", ", "");
  return keys.empty() ? "{}" : "{ " + keys.substr(2) + " }";
}

/// The JSON Schema of the table: its keys, and those that start with x_.
template <typename T>
Json schema_of(const KeyTable<T>& table) {
  Json schema{{"type", "object"}};
  schema["properties"] = Json::object();
  std::vector<std::string> required;
  for (const TableKey<T>& key : table.keys) {
    schema["properties"][key.name] = key.kind.schema;
    if (!key.example.empty()) required.emplace_back(key.name);
  }
  schema["patternProperties"] = {{"^x_", true}};
  schema["additionalProperties"] = false;
  if (!required.empty()) schema["required"] = required;
  if (table.combination == "not") {
    schema["not"] = {{"required", table.combined}};
  } else {
    for (const std::string_view key : table.combined) {
      schema[table.combination].push_back({{"required", Json::array({key})}});
    }
  }
  return schema;
}

/// The rows of docs of the table and of all tables in it. `suffix` is what stands behind a key that holds such a table:
/// "[]" for arrays of them.
template <typename T>
std::vector<KeyDescription> describe(const KeyTable<T>& table, std::string_view suffix) {
  std::vector<KeyDescription> rows;
  for (const TableKey<T>& key : table.keys) {
    std::string initial(!key.example.empty() ? "required" : !key.initial.empty() ? key.initial : key.kind.initial);
    rows.push_back(
        {std::string(suffix), std::string(key.name), key.kind.takes, std::move(initial), std::string(key.help)});
    for (KeyDescription row : key.kind.inner) {
      row.table = fmt::format("{}.{}{}", suffix, key.name, row.table);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

/// Kinds of keys.
namespace keys {

// Values as TOML.
[[nodiscard]] inline std::string to_toml(const std::string& text) {
  return toml_quote(text);
}
[[nodiscard]] inline std::string to_toml(bool value) {
  return value ? "true" : "false";
}
[[nodiscard]] inline std::string to_toml(int value) {
  return fmt::format("{}", value);
}
[[nodiscard]] inline std::string to_toml(double value) {
  return toml_number(value);
}
[[nodiscard]] inline std::string to_toml(const glm::dvec3& p) {
  return fmt::format("[{}, {}, {}]", toml_number(p.x), toml_number(p.y), toml_number(p.z));
}
[[nodiscard]] inline std::string to_toml(Size size) {
  return fmt::format("[{}, {}]", size.width, size.height);
}
[[nodiscard]] inline std::string to_toml(const Rect& r) {
  return fmt::format("[{}, {}, {}, {}]", r.x0, r.y0, r.width(), r.height());
}
[[nodiscard]] inline std::string to_toml(Rgba8 c) {
  return fmt::format("[{}, {}, {}, {}]", c.r, c.g, c.b, c.a);
}

/// JSON Schemas of values.
namespace schema {

[[nodiscard]] inline Json text() {
  return {{"type", "string"}};
}
[[nodiscard]] inline Json whole(std::int64_t low, std::int64_t high) {
  return {{"type", "integer"}, {"minimum", low}, {"maximum", high}};
}
[[nodiscard]] inline Json number(double low, double high) {
  return {{"type", "number"}, {"minimum", low}, {"maximum", high}};
}
/// Above 0.
[[nodiscard]] inline Json positive(double high) {
  return {{"type", "number"}, {"exclusiveMinimum", 0}, {"maximum", high}};
}
[[nodiscard]] inline Json list(Json items) {
  return {{"type", "array"}, {"items", std::move(items)}};
}
[[nodiscard]] inline Json list(Json items, std::size_t count) {
  return {{"type", "array"}, {"items", std::move(items)}, {"minItems", count}, {"maxItems", count}};
}

}  // namespace schema

/// A key of one member. `read` takes the reader and the key and returns the value, none where it is absent or wrong.
/// Members that are std::optional are never written.
template <typename T, typename Member, typename Read>
KeyKind<T> value_kind(Member T::*member, std::string takes, Json schema, Read read) {
  KeyKind<T> kind{
      .takes = std::move(takes), .schema = std::move(schema), .read = [=](const KeySource& source, T& into) {
        if (auto value = read(source.reader, source.key)) into.*member = *std::move(value);
      }};
  if constexpr (requires(const Member& value) { to_toml(value); }) {
    kind.write = [=](const T& from) { return to_toml(from.*member); };
    kind.is_initial = [=](const T& from) { return from.*member == T{}.*member; };
    kind.initial = to_toml(T{}.*member);
  }
  return kind;
}

template <typename T, typename Member>
KeyKind<T> text(Member T::*member, std::string takes = "a text") {
  KeyKind<T> kind = value_kind(member, std::move(takes), schema::text(),
                               [](TableReader& reader, std::string_view key) { return reader.text(key); });
  if (kind.initial == "\"\"") kind.initial.clear();
  return kind;
}

/// A name, as TableReader::id has it.
template <typename T>
KeyKind<T> id(std::string T::*member) {
  KeyKind<T> kind = value_kind(member, "an id", {{"type", "string"}, {"pattern", "^[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}$"}},
                               [](TableReader& reader, std::string_view key) { return reader.id(key); });
  if (kind.initial == "\"\"") kind.initial.clear();
  return kind;
}

template <typename T>
KeyKind<T> boolean(bool T::*member) {
  return value_kind(member, "true or false", {{"type", "boolean"}},
                    [](TableReader& reader, std::string_view key) { return reader.boolean(key); });
}

/// An integer from `low` to `high`; a member's initial value outside of them stands for a choice that is left open.
template <typename T, typename Member>
KeyKind<T> whole(Member T::*member, int low, int high) {
  KeyKind<T> kind =
      value_kind(member, fmt::format("{} to {}", low, high), schema::whole(low, high),
                 [=](TableReader& reader, std::string_view key) { return reader.integer(key, low, high); });
  if constexpr (std::is_same_v<Member, int>) {
    if (T{}.*member < low) kind.initial.clear();
  }
  return kind;
}

/// A number from `low` to `high`.
template <typename T>
KeyKind<T> number(double T::*member, double low, double high) {
  return value_kind(member, fmt::format("{} to {}", low, high), schema::number(low, high),
                    [=](TableReader& reader, std::string_view key) { return reader.real_from(key, low, high); });
}

/// A number above 0; a member that is 0 at first stands for a choice that is left open.
template <typename T, typename Member>
KeyKind<T> positive(Member T::*member, double high) {
  KeyKind<T> kind = value_kind(member, fmt::format("above 0, at most {}", high), schema::positive(high),
                               [=](TableReader& reader, std::string_view key) { return reader.real(key, 0.0, high); });
  if (kind.initial == "0.0") kind.initial.clear();
  return kind;
}

/// One of an enumeration's values, whose names stand in their order.
template <typename T, typename Choice>
KeyKind<T> choice(Choice T::*member, const std::vector<std::string>& names) {
  KeyKind<T> kind{.takes = fmt::format("\"{}\"", fmt::join(names, "\", \"")),
                  .schema = {{"enum", names}},
                  .read =
                      [=](const KeySource& source, T& into) {
                        if (const auto index = source.reader.choice(source.key, names)) {
                          into.*member = static_cast<Choice>(*index);
                        }
                      },
                  .write = [=](const T& from) { return toml_quote(names.at(static_cast<std::size_t>(from.*member))); },
                  .is_initial = [=](const T& from) { return from.*member == T{}.*member; }};
  kind.initial = kind.write(T{});
  return kind;
}

/// [x, y, z] in metres.
template <typename T>
KeyKind<T> point(glm::dvec3 T::*member) {
  return value_kind(member, "[x, y, z]", schema::list(schema::number(-kMaxMeters, kMaxMeters), 3),
                    [](TableReader& reader, std::string_view key) { return reader.point(key); });
}

/// [width, height] in pixels, each from 1 to `max`.
template <typename T, typename Member>
KeyKind<T> size(Member T::*member, int max) {
  KeyKind<T> kind =
      value_kind(member, fmt::format("[width, height], each 1 to {}", max), schema::list(schema::whole(1, max), 2),
                 [=](TableReader& reader, std::string_view key) -> std::optional<Size> {
                   const auto sides = reader.integers(key, 2, 1, max);
                   if (!sides) return std::nullopt;
                   return Size{(*sides)[0], (*sides)[1]};
                 });
  kind.initial.clear();
  return kind;
}

/// [x, y, width, height] in pixels.
[[nodiscard]] inline Json rect_schema() {
  Json schema{{"type", "array"}, {"minItems", 4}, {"maxItems", 4}};
  const Json coordinate = schema::whole(-kMaxPixelPosition, kMaxPixelPosition);
  const Json side = schema::whole(1, kMaxPixelPosition);
  schema["prefixItems"] = Json::array({coordinate, coordinate, side, side});
  return schema;
}
template <typename T>
KeyKind<T> rect(Rect T::*member) {
  KeyKind<T> kind = value_kind(member, "[x, y, width, height]", rect_schema(),
                               [](TableReader& reader, std::string_view key) { return reader.rect(key); });
  kind.initial.clear();
  return kind;
}

/// [red, green, blue, alpha], each 0 to 255.
template <typename T>
KeyKind<T> color(Rgba8 T::*member) {
  return value_kind(member, "[r, g, b, a], each 0 to 255", schema::list(schema::whole(0, 255), 4),
                    [](TableReader& reader, std::string_view key) -> std::optional<Rgba8> {
                      const auto rgba = reader.integers(key, 4, 0, 255);
                      if (!rgba) return std::nullopt;
                      const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>((*rgba)[i]); };
                      return Rgba8{byte(0), byte(1), byte(2), byte(3)};
                    });
}

/// What docs say of keys that are valid and not acted on.
inline constexpr std::string_view kIgnored = "anything; not acted on";

/// A valid key that nothing acts on; all of them end in one warning.
template <typename T>
KeyKind<T> ignored() {
  return {.takes = std::string(kIgnored),
          .schema = true,
          .read = [](const KeySource& source, T& /*into*/) { source.reader.ignore({source.key}); },
          .is_ignored = true};
}

/// Reads the table under the key of `source`, where it is there, into `into`.
template <typename T>
void read_table(const KeySource& source, const KeyTable<T>& keys, T& into) {
  const TomlValue* const value = source.reader.table(source.key);
  if (value == nullptr) return;
  TableReader reader(*value, std::string(keys.name), source.reader.findings());
  read_keys(keys, reader, source.folder, into);
}

/// A table of keys that fill a member.
template <typename T, typename Inner>
KeyKind<T> table(Inner T::*member, const KeyTable<Inner>& keys) {
  return {.takes = "a table",
          .schema = schema_of(keys),
          .read = [=](const KeySource& source, T& into) { read_table(source, keys, into.*member); },
          .write = [=](const T& from) { return write_inline(keys, from.*member); },
          .is_initial = [=](const T& from) { return from.*member == Inner{}; },
          .inner = describe(keys, "")};
}

/// A table of keys that fill members of T itself.
template <typename T>
KeyKind<T> section(const KeyTable<T>& keys) {
  return {.takes = "a table",
          .schema = schema_of(keys),
          .read = [=](const KeySource& source, T& into) { read_table(source, keys, into); },
          .write = [=](const T& from) { return write_inline(keys, from); },
          .is_initial = [=](const T& from) { return write_keys(keys, from, "", "").empty(); },
          .inner = describe(keys, "")};
}

/// An array of tables with these keys that wall_reader.cpp reads, written from a member one inline table a line.
template <typename T, typename Inner>
KeyKind<T> lines(std::vector<Inner> T::*member, const KeyTable<Inner>& keys) {
  return {.takes = "tables",
          .schema = schema::list(schema_of(keys)),
          .read = [](const KeySource& source, T& /*into*/) { static_cast<void>(source.reader.has(source.key)); },
          .write =
              [=](const T& from) {
                std::string text = "[\n";
                for (const Inner& inner : from.*member) text += "  " + write_inline(keys, inner) + ",\n";
                return text + "]";
              },
          .is_initial = [=](const T& from) { return (from.*member).empty(); },
          .inner = describe(keys, "[]")};
}

/// What somebody else reads, and nobody writes.
template <typename T>
KeyKind<T> read_elsewhere(std::string takes, Json schema, std::vector<KeyDescription> inner = {}) {
  return {.takes = std::move(takes),
          .schema = std::move(schema),
          .read = [](const KeySource& source, T& /*into*/) { static_cast<void>(source.reader.has(source.key)); },
          .inner = std::move(inner)};
}

/// The kind, with values written whether or not they are the initial ones.
template <typename T>
KeyKind<T> always(KeyKind<T> kind) {
  kind.is_initial = nullptr;
  return kind;
}

/// The kind, with values written where `is_written` holds.
template <typename T, typename IsWritten>
KeyKind<T> when(IsWritten is_written, KeyKind<T> kind) {
  kind.is_initial = [=](const T& from) { return !is_written(from); };
  return kind;
}

/// The rows of a table of a member's keys as rows of the table around it.
template <typename T, typename Inner>
TableKey<T> lifted(Inner T::*member, const TableKey<Inner>& key) {
  KeyKind<T> kind{.takes = key.kind.takes,
                  .schema = key.kind.schema,
                  .read = [=](const KeySource& source, T& into) { key.kind.read(source, into.*member); },
                  .initial = key.kind.initial,
                  .inner = key.kind.inner};
  return {key.name, std::move(kind), key.help, key.example, key.initial};
}

}  // namespace keys
}  // namespace hpr
