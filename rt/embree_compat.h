#pragma once

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

/// The few calls that differ between Embree 3 and 4, under one name each.
namespace hpr::embree {

#if RTC_VERSION_MAJOR >= 4
using Context = RTCRayQueryContext;
inline constexpr RTCSceneFlags kFilterFlag = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;

inline void start(Context& context) {
  rtcInitRayQueryContext(&context);
}

inline void intersect16(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter,
                        RTCRayHit16& rays) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context;
  arguments.flags =
      static_cast<RTCRayQueryFlags>(RTC_RAY_QUERY_FLAG_INCOHERENT | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  arguments.filter = filter;
  rtcIntersect16(valid, scene, &rays, &arguments);
}

inline void occluded16(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  arguments.flags = RTC_RAY_QUERY_FLAG_INCOHERENT;
  rtcOccluded16(valid, scene, &rays, &arguments);
}
#else
using Context = RTCIntersectContext;
inline constexpr RTCSceneFlags kFilterFlag = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;

inline void start(Context& context) {
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}

inline void intersect16(const int* valid, RTCScene scene, Context& context, RTCFilterFunctionN filter,
                        RTCRayHit16& rays) {
  context.filter = filter;
  rtcIntersect16(valid, scene, &context, &rays);
}

inline void occluded16(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
  rtcOccluded16(valid, scene, &context, &rays);
}
#endif

}  // namespace hpr::embree
