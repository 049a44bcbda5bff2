// Where lobes of one direction send flux whose normals lean: AdjointBsdf::find_directions.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "photon_kernel.glsl"
#include "adjoint_bsdf.glsl"

// The normal that an eye shades a lobe with.
dvec3 normal_of(uint lobe, SurfacePoint seen) {
  Materials materials = work.materials;
  return lobe == kCoat ? coat_normal_to_shade_with(materials, seen) : normal_to_shade_with(materials, seen);
}

// Where an eye's ray came from that a mirror of `normal` sent along `arrived`, or, where it is bent, a surface of index `eta`.
bool sent_from(dvec3 arrived, dvec3 normal, bool is_bent, double eta, out dvec3 direction) {
  direction = dvec3(0.0lf);
  double cosine = dot(arrived, normal);
  if (!(cosine > 0.0lf)) return false;
  if (!is_bent) {
    direction = normalize(2.0lf * cosine * normal - arrived);
    return true;
  }
  double sine2 = max(0.0lf, 1.0lf - cosine * cosine) / (eta * eta);
  if (!(sine2 < 1.0lf)) return false;
  direction = normalize((cosine / eta - sqrt(1.0lf - sine2)) * normal - arrived / eta);
  return true;
}

// By one normal, for light that arrives as it is, or as it was before an eye's ray was put back on its side. The weight is zero
// where there is none.
dvec3 direction_by(FluxArrival at, uint lobe, dvec3 arrived, dvec3 normal, double eta, out dvec3 direction) {
  bool is_bent = lobe == kTransmission;
  double falls = dot(at.surface.to_viewer, at.surface.geometric_normal);
  if (!sent_from(arrived, normal, is_bent, eta, direction) || !(falls > 0.0lf)) return dvec3(0.0lf);
  double leaves = dot(direction, at.surface.geometric_normal);
  if (is_bent ? !(leaves < 0.0lf) : !(leaves > 0.0lf)) return dvec3(0.0lf);
  SurfacePoint seen = seen_from(at, direction);
  if (distance(normal_of(lobe, seen), is_bent ? -normal : normal) > kSameNormal) return dvec3(0.0lf);
  MaterialPoint material = material_at(at, seen);
  double squeezed = dot(arrived, normal) / abs(dot(direction, normal));
  return bsdf_weight(make_bsdf(material, seen, true), lobe) * (squeezed * abs(leaves) / falls);
}

// `index`: of the lobe's directions.
void find_directions(FluxArrival at, uint lobe, uint index) {
  dvec3 light = at.surface.to_viewer;
  dvec3 geometric = at.surface.geometric_normal;
  double eta = at.surface.inside ? 1.0lf / at.material.ior : at.material.ior;
  SurfacePoint from_above = at.surface;
  from_above.to_viewer = geometric;
  // Those an eye may shade with: by the map, by the corners, by the triangle.
  dvec3 normals[4] = dvec3[](at.material.normal, normal_of(lobe, from_above), at.surface.shading_normal, geometric);
#ifndef PLAIN_MATERIALS
  if (lobe == kCoat) normals[0] = at.material.extensions.clearcoat_normal;
#endif
  uint count = 0u;
  dvec3 sum = dvec3(0.0lf);
  for (uint i = 0u; i < 2u * 4u; ++i) {
    dvec3 normal = normals[i / 2u];
    bool is_known = false;
    for (uint before = 0u; before < i / 2u; ++before) {
      is_known = is_known || distance(normals[before], normal) < 4.0lf * kSameNormal;
    }
    if (is_known) continue;
    dvec3 arrived = i % 2u == 0u ? light : light - 2.0lf * dot(light, geometric) * geometric;
    dvec3 direction;
    dvec3 weight = direction_by(at, lobe, arrived, normal, eta, direction);
    if (!carries_light(weight)) continue;
    work.states.states[photon].directions[index].direction[count] = direction;
    work.states.states[photon].directions[index].weight[count] = weight;
    sum += weight;
    ++count;
  }
  work.states.states[photon].directions[index].sum = sum;
  work.states.states[photon].directions[index].count = count;
}

void main() {
  if (!start_photon() || work.states.states[photon].scatters == 0u) return;
  FluxArrival at = work.states.states[photon].arrival;
  for (uint index = 0u; index < 3u; ++index) {
    uint lobe = kReflection + index;
    work.states.states[photon].directions[index].sum = dvec3(0.0lf);
    work.states.states[photon].directions[index].count = 0u;
    if (lobe == kCoat && !is_extended(at.bsdf)) continue;
    if (is_plain_lobe(at, lobe) || !bsdf_is_delta(at.bsdf, lobe) || !bsdf_present(at.bsdf, lobe)) continue;
    find_directions(at, lobe, index);
  }
  note_cut_off(false);
}
