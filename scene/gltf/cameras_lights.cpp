#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "scene/gltf/materials.h"

namespace hpr {
namespace {

/// `vector` at unit length; none when it has no direction.
std::optional<glm::dvec3> unit(const glm::dvec3& vector) {
  // Scaled first: the square of a large or tiny length leaves the range of double.
  const double largest = std::max({std::abs(vector.x), std::abs(vector.y), std::abs(vector.z)});
  if (!(largest > 0.0) || !std::isfinite(largest)) return std::nullopt;
  return glm::normalize(vector / largest);
}

/// Right, up, back from the axes of a node, back kept, then up.
std::optional<glm::dmat3> orthonormal(const glm::dmat4& matrix) {
  const auto back = unit(glm::dvec3(matrix[2]));
  const auto up = unit(glm::dvec3(matrix[1]));
  if (!back || !up) return std::nullopt;
  const auto level = unit(glm::cross(*up, *back));
  if (!level) return std::nullopt;
  return glm::dmat3(*level, glm::cross(*back, *level), *back);
}

/// A number of a JSON object that check_shape has looked at; 0 when it isn't there.
double number_of(const tinygltf::Value& object, const char* key) {
  return object.IsObject() && object.Has(key) ? object.Get(key).GetNumberAsDouble() : 0.0;
}

}  // namespace

std::optional<Light> light_of(const GltfData& data, int node, const glm::dmat4& to_world) {
  const tinygltf::Node& from = data.model().nodes[GltfData::to_size(node)];
  const auto found = from.extensions.find("KHR_lights_punctual");
  if (found == from.extensions.end()) return std::nullopt;
  const auto& light = data.model().lights[GltfData::to_size(found->second.Get("light").GetNumberAsInt())];
  Light to;
  to.name = light.name.empty() ? from.name : light.name;
  to.type = light.type == "directional" ? LightType::Directional
            : light.type == "spot"      ? LightType::Spot
                                        : LightType::Point;
  to.position = glm::dvec3(to_world[3]);
  if (const auto direction = unit(-glm::dvec3(to_world[2]))) {
    to.direction = glm::vec3(*direction);
  } else if (to.type != LightType::Point) {
    data.context().warn(fmt::format("nodes[{}]", node), "its transform leaves its light no direction; taken as -z");
  }
  const glm::dvec3 color =
      light.color.size() == 3 ? glm::dvec3(light.color[0], light.color[1], light.color[2]) : glm::dvec3(1.0);
  to.intensity = glm::vec3(color * light.intensity);
  to.range = light.range;
  to.inner_cone_radians = static_cast<float>(light.spot.innerConeAngle);
  to.outer_cone_radians = static_cast<float>(light.spot.outerConeAngle);
  if (to.type == LightType::Directional) {
    to.angular_radius_radians = static_cast<float>(number_of(light.extras, "angularRadius"));
  } else {
    to.radius = number_of(light.extras, "radius");
  }
  return to;
}

std::optional<Camera> camera_of(const GltfData& data, int node, const glm::dmat4& to_world) {
  const tinygltf::Node& from = data.model().nodes[GltfData::to_size(node)];
  if (from.camera < 0) return std::nullopt;
  const tinygltf::Camera& camera = data.model().cameras[GltfData::to_size(from.camera)];
  Camera to;
  to.name = camera.name.empty() ? from.name : camera.name;
  to.eye = glm::dvec3(to_world[3]);
  if (const auto axes = orthonormal(to_world)) {
    to.axes = *axes;
  } else {
    data.context().warn(fmt::format("nodes[{}]", node), "its transform leaves its camera no direction; looks along -z");
  }
  if (camera.type == "perspective") {
    to.lens = PerspectiveLens{camera.perspective.yfov, camera.perspective.znear};
  } else {
    const auto& lens = camera.orthographic;
    to.lens = OrthographicLens{std::abs(lens.xmag), std::abs(lens.ymag), lens.znear, lens.zfar};
  }
  return to;
}

}  // namespace hpr
