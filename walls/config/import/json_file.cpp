#include "walls/config/import/json_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "walls/config/import/foreign_wall.h"

namespace hpr {

JsonFile::JsonFile(std::string_view text, std::string name) : name_(std::move(name)) {
  try {
    root_ = Json::parse(text);
  } catch (const JsonError& error) {
    if (!error.offset()) {
      throw_in_file(text, name_, 0, "it holds numbers or text beyond what JSON allows",
                    "mend the file, or name another kind with --from");
    }
    const std::string_view read = text.substr(0, *error.offset() + 1);
    throw_in_file(text, name_, 1 + static_cast<int>(std::ranges::count(read, '\n')), "it is no JSON",
                  "mend the line, or name another kind with --from");
  }
}

const std::vector<Json>& JsonFile::array(const Json& object, const std::string& path, const char* key) const {
  static const std::vector<Json> none;
  const Json* const found = object.find(key);
  if (found == nullptr) return none;
  if (!found->is_array()) fail(path + "/" + key, "it is no list", "write [ ... ]");
  return found->elements();
}

std::string JsonFile::text(const Json& object, const std::string& path, const char* key,
                           const std::string& otherwise) const {
  const Json* const found = object.find(key);
  if (found == nullptr) return otherwise;
  if (!found->is_string()) fail(path + "/" + key, "it is no text", "write \"...\"");
  return found->get<std::string>();
}

bool JsonFile::boolean(const Json& object, const std::string& path, const char* key) const {
  const Json* const found = object.find(key);
  if (found == nullptr) return false;
  if (!found->is_boolean()) fail(path + "/" + key, "it is neither true nor false", "write true or false");
  return found->get<bool>();
}

int JsonFile::integer(const Json& object, const std::string& path, const char* key, int low, int high,
                      std::optional<int> otherwise) const {
  const std::optional<double> other = otherwise ? std::optional<double>(*otherwise) : std::nullopt;
  const double value = real(object, path, key, low, high, other);
  if (value != std::floor(value)) fail(path + "/" + key, fmt::format("it is {}", value), "give it a whole number");
  return static_cast<int>(value);
}

double JsonFile::real(const Json& object, const std::string& path, const char* key, double low, double high,
                      std::optional<double> otherwise) const {
  const Json* const found = object.find(key);
  if (found == nullptr && otherwise) return *otherwise;
  const std::string hint = fmt::format("give it a number from {} to {}", low, high);
  if (found == nullptr) fail(path, fmt::format("it has no \"{}\"", key), hint);
  if (!found->is_number()) fail(path + "/" + key, "it is no number", hint);
  const auto value = found->get<double>();
  if (!(value >= low && value <= high)) fail(path + "/" + key, fmt::format("it is {}", value), hint);
  return value;
}

const Json& JsonFile::object(const Json& value, const std::string& path) const {
  if (!value.is_object()) fail(path, "it is no object", "write { ... }");
  return value;
}

void JsonFile::fail(const std::string& path, std::string_view what, std::string hint) const {
  throw_in_file({}, name_, 0, fmt::format("{}: {}", path.empty() ? "/" : path, what), std::move(hint));
}

}  // namespace hpr
