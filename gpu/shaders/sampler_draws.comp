// A test's: what samplers draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "sampler.glsl"

struct Draws {
  uint one;
  uvec2 two;
  uvec2 of_pixel;
  uvec2 with_pixel;
  uint branched;
};
layout(buffer_reference, scalar) writeonly buffer DrawsBuffer {
  Draws draws[];
};
layout(push_constant, scalar) uniform Constants {
  DrawsBuffer found;
  uint64_t seed;
  uint64_t frame;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  uint64_t random_frame = mixed(mixed(seed) ^ frame);
  // Places and samples that the test knows too, far out and negative ones among them.
  ivec2 pixel = ivec2(int(i * 2654435761u), int(i % 5000u) - 100);
  Sampler s = make_sampler(pixel_stream(random_frame, i % 7u, pixel), i ^ (i << 13));
  Draws each;
  each.of_pixel = two_of_pixel(s);
  each.with_pixel = two_with_pixel(s);
  each.one = one(s);
  each.two = two(s);
  Sampler other = branch_of(s, i % 3u);
  each.branched = one(other);
  found.draws[i] = each;
}
