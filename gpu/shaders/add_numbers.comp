// A test's: adds one number to each of many.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

layout(buffer_reference, scalar) buffer Numbers {
  uint64_t numbers[];
};
layout(push_constant, scalar) uniform Constants {
  Numbers buffer_of_them;
  uint64_t count;
  uint64_t added;
};

void main() {
  uint64_t i = thread_index();
  if (i < count) buffer_of_them.numbers[uint(i)] += added;
}
