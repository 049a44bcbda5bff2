// A test's: what light_tree.glsl chooses.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"

#include "light_tree.glsl"

struct Query {
  dvec3 position;
  dvec3 normal;
  double u;
  uint light;
  uint padding;
};
struct Answer {
  double importance;
  double probability;
  double probability_of_light;
  uint light;
  uint chosen;
};
layout(buffer_reference, scalar) readonly buffer Queries {
  Query queries[];
};
layout(buffer_reference, scalar) writeonly buffer Answers {
  Answer answers[];
};
layout(buffer_reference, scalar) readonly buffer LightTrees {
  LightTree tree;
};
layout(push_constant, scalar) uniform Constants {
  Queries of;
  Answers found;
  LightTrees trees;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  LightTree tree = trees.tree;
  Query query = of.queries[i];
  Answer answer;
  answer.importance = tree_importance(tree, query.position, query.normal);
  TreeChoice choice;
  answer.chosen = choose_light(tree, query.position, query.normal, query.u, choice) ? 1u : 0u;
  answer.probability = choice.probability;
  answer.light = choice.light;
  answer.probability_of_light = light_probability(tree, query.position, query.normal, query.light);
  found.answers[i] = answer;
}
