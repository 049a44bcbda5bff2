#pragma once

#include <tinyxml2.h>

#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// Another system's XML, read attribute by attribute; everything wrong is an Error (BadInput) with its line.
class XmlFile {
 public:
  /// `text` must outlive this.
  XmlFile(std::string_view text, std::string name);

  /// The outermost element, which must be called so.
  [[nodiscard]] const tinyxml2::XMLElement& root(const char* called) const;
  [[nodiscard]] const tinyxml2::XMLElement& child(const tinyxml2::XMLElement& parent, const char* called) const;
  [[nodiscard]] static std::vector<const tinyxml2::XMLElement*> children(const tinyxml2::XMLElement& parent,
                                                                         const char* called);

  /// Empty when absent.
  [[nodiscard]] static std::string text(const tinyxml2::XMLElement& element, const char* attribute);
  /// Within [low, high]; absent: `otherwise`, or an error without one.
  [[nodiscard]] int integer(const tinyxml2::XMLElement& element, const char* attribute, int low, int high,
                            std::optional<int> otherwise = std::nullopt) const;
  /// Three finite numbers; none when absent.
  [[nodiscard]] std::optional<glm::dvec3> point(const tinyxml2::XMLElement& element, const char* attribute) const;

  [[noreturn]] void fail(const tinyxml2::XMLElement& element, std::string_view what, std::string hint) const;

 private:
  std::string_view text_;
  std::string name_;
  tinyxml2::XMLDocument document_;
};

}  // namespace hpr
