// A test's: textures.glsl at some coordinates.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "textures.glsl"

struct TextureUse {
  TextureRef reference;
  uint encoding;
  uint padding;
  vec2 uv[2];
  dvec2 plain_uv;
};
struct TextureSamples {
  dvec4 plain;
  dvec4 texel;
};
layout(buffer_reference, scalar) readonly buffer Uses {
  TextureUse uses[];
};
layout(buffer_reference, scalar) writeonly buffer FoundSamples {
  TextureSamples samples[];
};
layout(push_constant, scalar) uniform Constants {
  Uses of;
  FoundSamples found;
  Textures textures;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  TextureUse use = of.uses[i];
  TextureSamples each;
  each.plain = sample_texture(textures, uint(use.reference.texture), use.encoding, use.plain_uv);
  each.texel = texel_of(textures, use.reference, use.encoding, use.uv);
  found.samples[i] = each;
}
