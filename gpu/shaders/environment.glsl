// An environment as a light: rt/lights/environment_map.h and facing_tables.h.
// Needs reals.glsl, sampling.glsl and discrete.glsl.

layout(buffer_reference, scalar) readonly buffer EnvironmentTexels {
  vec3 texels[];
};

struct Environment {
  EnvironmentTexels texels;  // [height][width], not yet scaled
  Sums facing;               // table after table: rows, then cells
  Sums row_cosines;          // of the polar angles between rows
  Sums row_sums;
  Sums texel_sums;
  Sums cell_powers;
  dvec3 mean;
  double rotation_radians;
  double scale;
  double cosine_fraction;  // of a surface's samples that are spread by the cosine
  ivec2 size;
  ivec2 cells;
};
layout(buffer_reference, scalar) readonly buffer Environments {
  Environment environment;
};

struct DirectionalRadiance {
  dvec3 radiance;
  double pdf;
};

double brightness_of(dvec3 radiance) {
  return (radiance.r + radiance.g + radiance.b) / 3.0lf;
}

bool is_constant(Environment map) {
  return map.size == ivec2(1);
}

// A cube about the directions of normals, its faces cut into kFacingSide x kFacingSide squares.
const uint kFacingSide = 8u;
const uint kFacingNormals = 6u * kFacingSide * kFacingSide;

uint square_of(double coordinate) {
  return min(uint((0.5lf + 0.5lf * coordinate) * double(kFacingSide)), kFacingSide - 1u);
}

// Where the table of a normal starts: its rows, which its cells follow.
uint facing_table(Environment map, dvec3 normal) {
  uint index = kFacingNormals;
  if (normal != dvec3(0.0lf)) {
    dvec3 length_of = abs(normal);
    int axis = length_of.x >= length_of.y && length_of.x >= length_of.z ? 0 : (length_of.y >= length_of.z ? 1 : 2);
    uint face = 2u * uint(axis) + (normal[axis] < 0.0lf ? 1u : 0u);
    uint across = square_of(normal[(axis + 1) % 3] / length_of[axis]);
    uint along = square_of(normal[(axis + 2) % 3] / length_of[axis]);
    index = (face * kFacingSide + along) * kFacingSide + across;
  }
  return index * uint(map.cells.y + map.cells.x * map.cells.y);
}

double cell_probability(Environment map, uint table, int row, int column) {
  double all_rows = map.facing.sums[table + uint(map.cells.y - 1)];
  uint first = table + uint(map.cells.y + row * map.cells.x);
  double whole_row = map.facing.sums[first + uint(map.cells.x - 1)];
  if (!(all_rows > 0.0lf) || !(whole_row > 0.0lf)) return 0.0lf;
  double of_row = map.facing.sums[table + uint(row)] - (row > 0 ? map.facing.sums[table + uint(row - 1)] : 0.0lf);
  double of_cell = map.facing.sums[first + uint(column)] - (column > 0 ? map.facing.sums[first + uint(column - 1)] : 0.0lf);
  return of_row / all_rows * (of_cell / whole_row);
}

dvec3 environment_texel(Environment map, int x, int y) {
  int column = (x + map.size.x) % map.size.x;
  return map.scale * dvec3(map.texels.texels[clamp(y, 0, map.size.y - 1) * map.size.x + column]);
}

// In texels.
dvec2 environment_position(Environment map, dvec3 direction) {
  double around = 0.5lf + (arc_tangent_of(direction.x, -direction.z) + map.rotation_radians) / (2.0lf * kPi);
  double up = clamp(direction.y, -1.0lf, 1.0lf);
  double polar = arc_tangent_of(sqrt((1.0lf - up) * (1.0lf + up)), up);
  return dvec2((around - floor(around)) * double(map.size.x), polar / kPi * double(map.size.y));
}

// `across_picture` in [0, 1), from its left; `up`: the cosine of the polar angle.
dvec3 environment_direction(Environment map, double across_picture, double up) {
  dvec2 at = circle_at(2.0lf * kPi * (across_picture - 0.5lf) - map.rotation_radians);
  double across = sqrt(max(0.0lf, (1.0lf - up) * (1.0lf + up)));
  return dvec3(across * at.y, up, -across * at.x);
}

dvec3 between_texels(Environment map, dvec2 position) {
  dvec2 low = floor(position - 0.5lf);
  ivec2 first = ivec2(low);
  dvec2 f = position - 0.5lf - low;
  dvec3 upper = (1.0lf - f.x) * environment_texel(map, first.x, first.y) +
                f.x * environment_texel(map, first.x + 1, first.y);
  dvec3 lower = (1.0lf - f.x) * environment_texel(map, first.x, first.y + 1) +
                f.x * environment_texel(map, first.x + 1, first.y + 1);
  return (1.0lf - f.y) * upper + f.y * lower;
}

dvec3 environment_light(Environment map, dvec3 direction) {
  return is_constant(map) ? map.mean : between_texels(map, environment_position(map, direction));
}

// `normal`, of the surface that is lit, has unit length or is zero: light from all sides.
DirectionalRadiance evaluate_environment(Environment map, dvec3 direction, dvec3 normal) {
  bool from_all_sides = normal == dvec3(0.0lf);
  if (is_constant(map)) {
    if (!(brightness_of(map.mean) > 0.0lf)) return DirectionalRadiance(map.mean, 0.0lf);
    return DirectionalRadiance(map.mean, from_all_sides ? 0.25lf / kPi : max(0.0lf, dot(normal, direction)) / kPi);
  }
  dvec2 position = environment_position(map, direction);
  DirectionalRadiance seen = DirectionalRadiance(between_texels(map, position), 0.0lf);
  int x = min(int(position.x), map.size.x - 1);
  int y = min(int(position.y), map.size.y - 1);
  int column = ((x + 1) * map.cells.x - 1) / map.size.x;
  int row = ((y + 1) * map.cells.y - 1) / map.size.y;
  double power = map.cell_powers.sums[row * map.cells.x + column];
  double by_cosine = from_all_sides ? 0.0lf : map.cosine_fraction;
  if (!from_all_sides) seen.pdf = by_cosine * max(0.0lf, dot(normal, direction)) / kPi;
  if (!(power > 0.0lf)) return seen;
  int index = y * map.size.x + x;
  bool is_first = x == column * map.size.x / map.cells.x;
  double value = map.texel_sums.sums[index] - (is_first ? 0.0lf : map.texel_sums.sums[index - 1]);
  // Of the cell the texel has its part of brightness times solid angle, and spreads it over that solid angle.
  seen.pdf += (1.0lf - by_cosine) * (value / power) * cell_probability(map, facing_table(map, normal), row, column);
  return seen;
}

bool sample_environment_cells(Environment map, dvec3 normal, dvec2 u, out dvec3 direction) {
  direction = dvec3(0.0lf);
  uint table = facing_table(map, normal);
  uvec2 cells = uvec2(map.cells);
  if (!(map.facing.sums[table + cells.y - 1u] > 0.0lf)) return false;
  DiscreteSample row = sample_discrete(map.facing, table, cells.y, u.y);
  DiscreteSample column = sample_discrete(map.facing, table + cells.y + row.index * cells.x, cells.x, u.x);
  uvec2 size = uvec2(map.size);
  uvec2 first = uvec2(column.index, row.index) * size / cells;
  uvec2 count = uvec2(column.index + 1u, row.index + 1u) * size / cells - first;
  DiscreteSample y = sample_discrete(map.row_sums, column.index * size.y + first.y, count.y, row.rest);
  uint found = first.y + y.index;
  DiscreteSample x = sample_discrete(map.texel_sums, found * size.x + first.x, count.x, column.rest);
  double upper = map.row_cosines.sums[found];
  double up = upper + y.rest * (map.row_cosines.sums[found + 1u] - upper);
  direction = environment_direction(map, (double(first.x) + double(x.index) + x.rest) / double(size.x), up);
  return true;
}

// A direction of unit length; false where no light comes to that side.
bool sample_environment(Environment map, dvec3 normal, double choice, dvec2 u, out dvec3 direction) {
  bool from_all_sides = normal == dvec3(0.0lf);
  if (from_all_sides && is_constant(map)) {
    direction = environment_direction(map, u.x, 1.0lf - 2.0lf * u.y);
    return true;
  }
  if (!from_all_sides && choice < map.cosine_fraction) {
    direction = cosine_lobe(normal, u);
    return true;
  }
  return sample_environment_cells(map, normal, u, direction);
}
