#pragma once

#include <string>

#include "image/image_io.h"
#include "scene/scene.h"

namespace hpr {

/// What the command line calls an environment: `R,G,B`, the same radiance from everywhere, or a latitude-longitude
/// picture (.hdr, .exr, .png, .jpg; see Environment for its orientation). PNG and JPEG are taken as sRGB, white as
/// radiance 1. Infinite values of a picture become the largest half float, 65504; NaN and negative ones become 0; those
/// that were not finite are counted.
/// Throws Error: Usage for a text that is neither; Io, BadInput or Limit for a picture that can't be read.
[[nodiscard]] Environment load_environment(const std::string& text, const ImageLimits& limits = {});
/// Makes an environment of a latitude-longitude picture that was read; replaces values as load_environment does. Errors
/// name it `name`. Throws Error (BadInput).
[[nodiscard]] Environment environment_of(const FloatImage& picture, const std::string& name);

}  // namespace hpr
