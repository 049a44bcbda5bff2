#pragma once

#include <array>
#include <cstddef>
#include <span>

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

/// The few calls that differ between Embree 3 and 4, under one name each.
namespace hpr::embree {

/// Rays we trace at once: as wide as AVX2, the instruction set all ranks keep to. Embree takes sixteen as well, but
/// copies them into packets of eight first.
inline constexpr std::size_t kWidth = 8;
using RayPacket = RTCRay8;
using HitPacket = RTCRayHit8;

/// What Embree should be quick at: coherent are neighbouring primary rays, and nothing else.
enum class Rays { Incoherent, Coherent };

#if RTC_VERSION_MAJOR >= 4
/// The query's own context first: filters are handed its address.
struct Context {
  RTCRayQueryContext query;
  RTCRayQueryFlags flags;
};
inline constexpr RTCSceneFlags kFilterFlag = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;

inline void start(Context& context, Rays rays) {
  rtcInitRayQueryContext(&context.query);
  context.flags = rays == Rays::Coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
}

inline RTCIntersectArguments closest_arguments(Context& context, RTCFilterFunctionN filter) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context.query;
  arguments.flags = static_cast<RTCRayQueryFlags>(context.flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  arguments.filter = filter;
  return arguments;
}
inline RTCOccludedArguments occluded_arguments(Context& context) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context.query;
  arguments.flags = context.flags;
  return arguments;
}

inline void intersect(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter, RTCRayHit8& rays) {
  RTCIntersectArguments arguments = closest_arguments(context, filter);
  rtcIntersect8(valid, scene, &rays, &arguments);
}
inline void intersect(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter,
                      RTCRayHit16& rays) {
  RTCIntersectArguments arguments = closest_arguments(context, filter);
  rtcIntersect16(valid, scene, &rays, &arguments);
}

/// Every ray of several packets that ends no sooner than it starts.
inline void intersect(RTCScene scene, Context& context, RTCFilterFunctionN filter, std::span<HitPacket> packets) {
  for (HitPacket& rays : packets) {
    alignas(64) std::array<int, kWidth> valid;
    for (std::size_t i = 0; i < kWidth; ++i) valid[i] = rays.ray.tnear[i] <= rays.ray.tfar[i] ? -1 : 0;
    intersect(valid.data(), scene, context, filter, rays);
  }
}

inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay8& rays) {
  RTCOccludedArguments arguments = occluded_arguments(context);
  rtcOccluded8(valid, scene, &rays, &arguments);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  RTCOccludedArguments arguments = occluded_arguments(context);
  rtcOccluded16(valid, scene, &rays, &arguments);
}
#else
using Context = RTCIntersectContext;
inline constexpr RTCSceneFlags kFilterFlag = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;

inline void start(Context& context, Rays rays) {
  rtcInitIntersectContext(&context);
  context.flags = rays == Rays::Coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}

inline void intersect(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter, RTCRayHit8& rays) {
  context.filter = filter;
  rtcIntersect8(valid, scene, &context, &rays);
}
inline void intersect(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter,
                      RTCRayHit16& rays) {
  context.filter = filter;
  rtcIntersect16(valid, scene, &context, &rays);
}

/// Every ray of several packets that ends no sooner than it starts. Coherent ones go down the tree together.
inline void intersect(RTCScene scene, Context& context, RTCFilterFunctionN filter, std::span<HitPacket> packets) {
  context.filter = filter;
  rtcIntersectNM(scene, &context, reinterpret_cast<RTCRayHitN*>(packets.data()), kWidth,
                 static_cast<unsigned int>(packets.size()), sizeof(HitPacket));
}

inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay8& rays) {
  rtcOccluded8(valid, scene, &context, &rays);
}
inline void occluded(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  rtcOccluded16(valid, scene, &context, &rays);
}
#endif

/// Whether candidate `i` is met from behind, for a geometry's RayGeometry::behind. By the ray and the normal that
/// Embree met it by: where rounding moves an edge of a closed mesh, both its triangles move, so no ray slips in
/// between.
[[nodiscard]] inline bool is_behind(const RTCFilterFunctionNArguments& candidates, unsigned int i, float behind) {
  if (behind == 0.0F) return false;
  const unsigned int n = candidates.N;
  const float along = RTCRayN_dir_x(candidates.ray, n, i) * RTCHitN_Ng_x(candidates.hit, n, i) +
                      RTCRayN_dir_y(candidates.ray, n, i) * RTCHitN_Ng_y(candidates.hit, n, i) +
                      RTCRayN_dir_z(candidates.ray, n, i) * RTCHitN_Ng_z(candidates.hit, n, i);
  return along * behind > 0.0F;
}

}  // namespace hpr::embree
