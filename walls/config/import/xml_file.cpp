#include "walls/config/import/xml_file.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <sstream>

#include "core/text.h"
#include "walls/config/import/foreign_wall.h"

namespace hpr {

XmlFile::XmlFile(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {
  if (document_.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS) return;
  throw_in_file(text_, name_, document_.ErrorLineNum(), fmt::format("it is no XML ({})", document_.ErrorName()),
                "mend the file, or name another kind with --from");
}

const tinyxml2::XMLElement& XmlFile::root(const char* called) const {
  const tinyxml2::XMLElement* const element = document_.RootElement();
  const std::string hint = "is it a file of that kind? name another one with --from";
  if (element == nullptr) throw_in_file(text_, name_, 0, fmt::format("it has no <{}>", called), hint);
  if (element->Name() != std::string_view(called)) {
    fail(*element, fmt::format("<{}> stands where <{}> was expected", printable(element->Name()), called), hint);
  }
  return *element;
}

const tinyxml2::XMLElement& XmlFile::child(const tinyxml2::XMLElement& parent, const char* called) const {
  const tinyxml2::XMLElement* const element = parent.FirstChildElement(called);
  if (element == nullptr) {
    fail(parent, fmt::format("<{}> has no <{}>", parent.Name(), called), fmt::format("add a <{}>", called));
  }
  return *element;
}

std::vector<const tinyxml2::XMLElement*> XmlFile::children(const tinyxml2::XMLElement& parent, const char* called) {
  std::vector<const tinyxml2::XMLElement*> found;
  for (auto* child = parent.FirstChildElement(called); child != nullptr; child = child->NextSiblingElement(called)) {
    found.push_back(child);
  }
  return found;
}

std::string XmlFile::text(const tinyxml2::XMLElement& element, const char* attribute) {
  const char* const value = element.Attribute(attribute);
  return value != nullptr ? value : "";
}

int XmlFile::integer(const tinyxml2::XMLElement& element, const char* attribute, int low, int high,
                     std::optional<int> otherwise) const {
  const std::string value = text(element, attribute);
  if (value.empty() && otherwise) return *otherwise;
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < low || number > high) {
    const std::string what = value.empty() ? fmt::format("<{}> has no {}", element.Name(), attribute)
                                           : fmt::format("{} is '{}'", attribute, printable(value));
    fail(element, what, fmt::format("give it a whole number from {} to {}", low, high));
  }
  return number;
}

std::optional<glm::dvec3> XmlFile::point(const tinyxml2::XMLElement& element, const char* attribute) const {
  const std::string value = text(element, attribute);
  if (value.empty()) return std::nullopt;
  std::istringstream stream(value);
  stream.imbue(std::locale::classic());
  glm::dvec3 read(0.0);
  std::string rest;
  const bool sound = static_cast<bool>(stream >> read.x >> read.y >> read.z) && !(stream >> rest) &&
                     std::isfinite(read.x + read.y + read.z);
  if (!sound) {
    fail(element, fmt::format("{} is '{}', not three numbers", attribute, printable(value)),
         fmt::format("write e.g. {}=\"-1.0 0.0 -1.0\"", attribute));
  }
  return read;
}

void XmlFile::fail(const tinyxml2::XMLElement& element, std::string_view what, std::string hint) const {
  throw_in_file(text_, name_, element.GetLineNum(), what, std::move(hint));
}

}  // namespace hpr
