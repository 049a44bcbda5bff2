// Textures, as gpu/light/gpu_textures.h lays them out, and sample_texture of rt/materials/material_point.h, to the bit.
// Needs reals.glsl.

const uint kRepeat = 0u;
const uint kMirroredRepeat = 1u;
const uint kClampToEdge = 2u;
const uint kLinear = 0u;
const uint kSrgb = 1u;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Texels {
  uint texels[];  // RGBA8, row 0 at the top
};
struct Texture {
  Texels image;
  ivec2 size;
  uint wrap_s;
  uint wrap_t;
  uint nearest;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer TextureItems {
  Texture items[];
};
layout(buffer_reference, scalar) readonly buffer SrgbLevels {
  double linear[];  // of the 256 levels
};
layout(buffer_reference, scalar) readonly buffer Textures {
  TextureItems all;
  SrgbLevels srgb;
};

// A texture as a material uses it.
struct TextureRef {
  int texture;  // -1: none
  uint uv_set;
  float transform[6];
};

bool is_present(TextureRef reference) {
  return reference.texture >= 0;
}

double wrapped(double coordinate, uint wrap) {
  if (wrap == kRepeat && abs(coordinate) < 2147483648.0lf) {
    double whole = floor(abs(coordinate));  // software devices' trunc() keeps the fraction of what is above 2^24
    precise double left = coordinate - (coordinate < 0.0lf ? -whole : whole);
    precise double raised = left + 1.0lf;
    return left < 0.0lf ? raised : left;
  }
  if (!is_finite(coordinate)) return 0.0lf;
  if (wrap == kClampToEdge) return clamp(coordinate, 0.0lf, 1.0lf);
  if (wrap == kMirroredRepeat) {
    precise double in_period = coordinate - 2.0lf * floor(0.5lf * coordinate);
    precise double back = 2.0lf - in_period;
    return in_period > 1.0lf ? back : in_period;
  }
  return coordinate - floor(coordinate);
}

// The texel that stands at `index`, at most one beyond an edge.
int texel_index(int index, int count, uint wrap) {
  if (index < 0) return wrap == kRepeat ? count - 1 : 0;
  if (index >= count) return wrap == kRepeat ? 0 : count - 1;
  return index;
}

dvec4 decoded(Textures textures, uint texel, uint encoding) {
  const double kLevel = 1.0lf / 255.0lf;
  uvec4 levels = uvec4(texel, texel >> 8, texel >> 16, texel >> 24) & 0xFFu;
  precise dvec4 linear = dvec4(levels) * kLevel;
  if (encoding != kSrgb) return linear;
  SrgbLevels srgb = textures.srgb;
  return dvec4(srgb.linear[levels.r], srgb.linear[levels.g], srgb.linear[levels.b], linear.a);
}

// At `uv`, decoded before it is mixed; coordinates that are not finite read as 0. White where the image is empty.
dvec4 sample_texture(Textures textures, uint number, uint encoding, dvec2 uv) {
  Texture texture = textures.all.items[number];
  ivec2 size = texture.size;
  if (size.x <= 0 || size.y <= 0) return dvec4(1.0lf);
  precise double s = wrapped(uv.x, texture.wrap_s) * double(size.x);
  precise double t = wrapped(uv.y, texture.wrap_t) * double(size.y);
  uint width = uint(size.x);
  double off = texture.nearest != 0u ? 0.0lf : 0.5lf;
  precise double x = s - off;
  precise double y = t - off;
  int x0 = x < 0.0lf ? -1 : int(x);
  int y0 = y < 0.0lf ? -1 : int(y);
  precise double fx = x - double(x0);
  precise double fy = y - double(y0);
  int next = texture.nearest != 0u ? 0 : 1;
  uint left = uint(texel_index(x0, size.x, texture.wrap_s));
  uint right = uint(texel_index(x0 + next, size.x, texture.wrap_s));
  uint above = uint(texel_index(y0, size.y, texture.wrap_t)) * width;
  uint below = uint(texel_index(y0 + next, size.y, texture.wrap_t)) * width;
  uvec4 texels = uvec4(texture.image.texels[above + left], texture.image.texels[above + right],
                       texture.image.texels[below + left], texture.image.texels[below + right]);
  dvec4 first = decoded(textures, texels.x, encoding);
  if (texels.x == texels.y && texels.x == texels.z && texels.x == texels.w) return first;
  precise dvec4 upper = first * (1.0lf - fx) + decoded(textures, texels.y, encoding) * fx;
  precise dvec4 lower = decoded(textures, texels.z, encoding) * (1.0lf - fx) + decoded(textures, texels.w, encoding) * fx;
  precise dvec4 mixed = upper * (1.0lf - fy) + lower * fy;
  return mixed;
}

// KHR_texture_transform.
dvec2 transformed_uv(TextureRef reference, vec2 uv) {
  double u = double(uv.x);
  double v = double(uv.y);
  precise dvec2 at = dvec2(
      double(reference.transform[0]) * u + double(reference.transform[2]) * v + double(reference.transform[4]),
      double(reference.transform[1]) * u + double(reference.transform[3]) * v + double(reference.transform[5]));
  return at;
}

dvec4 texel_of(Textures textures, TextureRef reference, uint encoding, vec2 uv[2]) {
  vec2 set = uv[min(reference.uv_set, 1u)];
  return sample_texture(textures, uint(reference.texture), encoding, transformed_uv(reference, set));
}
