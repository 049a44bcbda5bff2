// What solids absorb: rt/materials/medium.h.
// Needs reals.glsl, surface_point.glsl and materials.glsl.

// What a place lies in, 1/m; zero: nothing that absorbs.
struct Media {
  dvec3 here;    // absorption of the innermost solid
  dvec3 around;  // absorption of the solid that encloses that
};

// Of `metres` of a medium: the fraction of light that is not absorbed.
dvec3 transmittance(dvec3 absorption, double metres) {
  if (absorption == dvec3(0.0lf)) return dvec3(1.0lf);
  dvec3 depth = -absorption * metres;
  return dvec3(exponential_of(depth.r), exponential_of(depth.g), exponential_of(depth.b));
}

// Of a stretch of `metres` that came through `media` and ends at `point`: from within a solid, that itself says what it was.
dvec3 transmittance_to(Media media, SurfacePoint point, MaterialPoint material, double metres) {
  return transmittance(point.inside && material.solid ? material.absorption : media.here, metres);
}

// What lies on the side of `point` that `direction` leads to, for who came to it through `media`.
Media media_towards(Media media, SurfacePoint point, MaterialPoint material, dvec3 direction) {
  if (!material.solid) return media;
  bool back = dot(direction, point.geometric_normal) > 0.0lf;
  if (point.inside) {
    if (back) return Media(material.absorption, media.around);
    return Media(media.around, dvec3(0.0lf));
  }
  if (back) return media;
  return Media(material.absorption, media.here);
}

// Whether `direction` leads from `point` into the solid it bounds, by refraction or by reflection from within.
bool leads_into_solid(SurfacePoint point, MaterialPoint material, dvec3 direction) {
  return material.solid && (dot(direction, point.geometric_normal) > 0.0lf) == point.inside;
}

// From a light `metres` away to `point`. Infinite distances count as 1.
dvec3 transmittance_to_light(Media media, SurfacePoint point, MaterialPoint material, dvec3 to_light, double metres) {
  if (!is_finite(metres)) return dvec3(1.0lf);
  return transmittance(media_towards(media, point, material, to_light).here, metres);
}
