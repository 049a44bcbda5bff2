// Random numbers of the unit square made into directions and places: rt/sampling/sampling.h.
// Needs reals.glsl.

// Columns x, y, z = `axis`, which has unit length.
dmat3 basis_about(dvec3 axis) {
  double turn = is_negative(axis.z) ? -1.0lf : 1.0lf;
  double a = -1.0lf / (turn + axis.z);
  double b = axis.x * axis.y * a;
  return dmat3(dvec3(1.0lf + turn * axis.x * axis.x * a, turn * b, -turn * axis.x),
               dvec3(b, turn + axis.y * axis.y * a, -axis.y), axis);
}

dvec2 on_circle(double u) {
  return circle_at(2.0lf * kPi * u);
}

dvec2 in_disc(dvec2 u) {
  return sqrt(u.x) * on_circle(u.y);
}

dvec3 on_sphere(dvec2 u) {
  return dvec3(2.0lf * sqrt(u.x * (1.0lf - u.x)) * on_circle(u.y), 1.0lf - 2.0lf * u.x);
}

// Within a cone about `axis`; `opening` is 1 - cos of its half angle.
dvec3 in_cone(dvec3 axis, double opening, dvec2 u) {
  double below = opening * u.x;
  dvec2 across = sqrt(below * (2.0lf - below)) * on_circle(u.y);
  return normalize(basis_about(axis) * dvec3(across, 1.0lf - below));
}

// On the side of `normal`, with the density cos / pi.
dvec3 cosine_lobe(dvec3 normal, dvec2 u) {
  dvec2 across = in_disc(u);
  return normalize(basis_about(normal) * dvec3(across, sqrt(max(0.0lf, 1.0lf - u.x))));
}
