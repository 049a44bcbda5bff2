#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/json.h"

namespace hpr {

/// Another system's JSON, read key by key; everything wrong is an Error (BadInput) that names the value's path, and the
/// line of what is no JSON.
class JsonFile {
 public:
  JsonFile(std::string_view text, std::string name);

  [[nodiscard]] const Json& root() const { return root_; }
  /// The elements of the array under `key` of `object`, which is at `path`; none when it is absent.
  [[nodiscard]] const std::vector<Json>& array(const Json& object, const std::string& path, const char* key) const;
  [[nodiscard]] std::string text(const Json& object, const std::string& path, const char* key,
                                 const std::string& otherwise) const;
  [[nodiscard]] bool boolean(const Json& object, const std::string& path, const char* key) const;
  /// Within [low, high]; absent: `otherwise`, or an error without one.
  [[nodiscard]] int integer(const Json& object, const std::string& path, const char* key, int low, int high,
                            std::optional<int> otherwise = std::nullopt) const;
  [[nodiscard]] double real(const Json& object, const std::string& path, const char* key, double low, double high,
                            std::optional<double> otherwise = std::nullopt) const;
  /// `value`, or an error where it is no object.
  [[nodiscard]] const Json& object(const Json& value, const std::string& path) const;

  [[noreturn]] void fail(const std::string& path, std::string_view what, std::string hint) const;

 private:
  std::string name_;
  Json root_;
};

}  // namespace hpr
