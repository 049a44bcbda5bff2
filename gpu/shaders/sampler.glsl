// The random numbers of rt/sampling/sampler.h, to the bit: as whole numbers, of which 2^32 are 1.

struct Sampler {
  uint64_t stream;
  uint index;
  uint drawn;
};

Sampler make_sampler(uint64_t stream, uint index) {
  return Sampler(stream, index, 0u);
}

uint64_t mixed(uint64_t x) {
  x += 0x9E3779B97F4A7C15ul;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ul;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBul;
  return x ^ (x >> 31);
}

uint scrambled_reversed(uint x, uint seed) {
  x ^= x * 0x3D20ADEAu;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526C56u;
  x ^= x * 0x53A22864u;
  return x;
}

uint sobol_second_reversed(uint index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0F0F0F0Fu;
  index ^= (index >> 8) & 0x00FF00FFu;
  return index ^ (index >> 16);
}

// Generator matrices with their bits reversed, see matrix_of() in sampler.cpp.
const uint kThird[32] = uint[](
    0x00000001u, 0x00000003u, 0x00000006u, 0x00000009u, 0x00000017u, 0x0000003Au, 0x00000071u, 0x000000A3u,
    0x00000116u, 0x00000339u, 0x00000677u, 0x000009AAu, 0x00001601u, 0x00003903u, 0x00007706u, 0x0000AA09u,
    0x00010117u, 0x0003033Au, 0x00060671u, 0x000909A3u, 0x00171616u, 0x003A3939u, 0x00717777u, 0x00A3AAAAu,
    0x01170001u, 0x033A0003u, 0x06710006u, 0x09A30009u, 0x16160017u, 0x3939003Au, 0x77770071u, 0xAAAA00A3u);
const uint kFourth[32] = uint[](
    0x00000001u, 0x00000003u, 0x00000004u, 0x0000000Au, 0x0000001Fu, 0x0000002Eu, 0x00000045u, 0x000000C9u,
    0x0000011Bu, 0x000002A4u, 0x0000079Au, 0x00000B67u, 0x0000101Eu, 0x0000302Du, 0x00004041u, 0x0000A0C3u,
    0x0001F104u, 0x0002E28Au, 0x000457DFu, 0x000C9BAEu, 0x0011A105u, 0x002A7289u, 0x0079E7DBu, 0x00B6DBA4u,
    0x0100011Au, 0x030002A7u, 0x0400079Eu, 0x0A000B6Du, 0x1F001001u, 0x2E003003u, 0x45004004u, 0xC900A00Au);

uint sobol_third_reversed(uint index) {
  uint number = 0u;
  for (; index != 0u; index &= index - 1u) number ^= kThird[findLSB(index)];
  return number;
}

uint sobol_fourth_reversed(uint index) {
  uint number = 0u;
  for (; index != 0u; index &= index - 1u) number ^= kFourth[findLSB(index)];
  return number;
}

uint shuffled(uint index, uint64_t key) {
  return bitfieldReverse(scrambled_reversed(bitfieldReverse(index), uint(key)));
}

uvec2 scrambled_pair(uint reversed_x, uint reversed_y, uint64_t key) {
  return uvec2(bitfieldReverse(scrambled_reversed(reversed_x, uint(key >> 32))),
               bitfieldReverse(scrambled_reversed(reversed_y, uint(mixed(key)))));
}

const uint64_t kPixelOrder = 0x5851F42Dul;

uint64_t next_key(inout Sampler s) {
  return mixed(s.stream + 0x632BE59BD9B4E019ul * uint64_t(++s.drawn));
}

uint one(inout Sampler s) {
  uint64_t key = next_key(s);
  return bitfieldReverse(scrambled_reversed(shuffled(s.index, key), uint(key >> 32)));
}

uvec2 two(inout Sampler s) {
  uint64_t key = next_key(s);
  uint index = shuffled(s.index, key);
  return scrambled_pair(index, sobol_second_reversed(index), key);
}

uvec2 two_of_pixel(inout Sampler s) {
  uint index = shuffled(s.index, kPixelOrder);
  return scrambled_pair(index, sobol_second_reversed(index), next_key(s));
}

uvec2 two_with_pixel(inout Sampler s) {
  uint index = shuffled(s.index, kPixelOrder);
  return scrambled_pair(sobol_third_reversed(index), sobol_fourth_reversed(index), next_key(s));
}

Sampler branch_of(Sampler s, uint which) {
  return make_sampler(mixed(s.stream ^ mixed((uint64_t(which) << 32) + uint64_t(s.drawn + 1u))), s.index);
}

// `random_frame`: mixed(mixed(seed) ^ frame).
uint64_t pixel_stream(uint64_t random_frame, uint screen, ivec2 pixel) {
  uint64_t position = (uint64_t(uint(pixel.y)) << 32) | uint64_t(uint(pixel.x));
  return mixed(mixed(random_frame ^ (uint64_t(screen) + 1ul)) ^ position);
}
