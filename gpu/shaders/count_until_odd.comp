// A test's: counts by twos until somebody makes the number odd.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

layout(buffer_reference, scalar) coherent buffer Number {
  uint number;
};
layout(push_constant, scalar) uniform Constants {
  Number counted;
};

void main() {
  while ((atomicAdd(counted.number, 2u) & 1u) == 0u) {
  }
}
