// A scene's surfaces, as gpu/gpu_scene.h lays them out.
#include "bvh.glsl"

const uint kNoSurface = 0xFFFFFFFFu;

layout(buffer_reference, scalar) readonly buffer Positions {
  vec3 positions[];
};
layout(buffer_reference, scalar) readonly buffer Triangles {
  uvec3 triangles[];
};

struct Instance {
  dmat4x3 to_world;
  dmat3 to_boxes;    // from the world, moved so that `box_origin` is 0, to where the tree's boxes are
  dvec3 box_origin;  // world
  Positions positions;
  Triangles triangles;
  BvhNodes nodes;
  Indices items;  // triangles of the mesh
  uint first_surface;
  float largest;  // of the coordinates of the tree's boxes
  float front;    // 0: both sides are seen; else what a determinant is multiplied by to be positive before the front
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer Instances {
  Instance instances[];
};

struct SceneTree {
  BvhNodes nodes;
  Indices items;  // instances
  Instances instances;
  dvec3 center;  // boxes are relative to it
  float largest;
  uint is_empty;
};
layout(buffer_reference, scalar) readonly buffer SceneTrees {
  SceneTree tree;
};
