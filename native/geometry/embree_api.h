#pragma once
// Embree 3.13 and 4 behind one set of names. The library is never linked: a host such as Blender
// has an Embree of its own in the global symbol scope, and a module linked to another major version
// would have its rtc* calls answered by that one and silently miss every ray. So it is opened
// privately at the first use and called through the pointers of this struct only.

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <string>

namespace gpis {

// One line per function taken from the library; its name and type are Embree's own.
#define GPIS_EMBREE_FUNCTIONS(USE)  \
  USE(rtcNewDevice)                 \
  USE(rtcReleaseDevice)             \
  USE(rtcGetDeviceError)            \
  USE(rtcGetDeviceProperty)         \
  USE(rtcNewScene)                  \
  USE(rtcReleaseScene)              \
  USE(rtcSetSceneFlags)             \
  USE(rtcSetSceneBuildQuality)      \
  USE(rtcCommitScene)               \
  USE(rtcGetSceneBounds)            \
  USE(rtcNewGeometry)               \
  USE(rtcReleaseGeometry)           \
  USE(rtcSetNewGeometryBuffer)      \
  USE(rtcCommitGeometry)            \
  USE(rtcAttachGeometryByID)        \
  USE(rtcSetGeometryInstancedScene) \
  USE(rtcSetGeometryTransform)      \
  USE(rtcIntersect1)                \
  USE(rtcOccluded1)

struct EmbreeApi {
#define GPIS_EMBREE_MEMBER(name) decltype(&::name) name = nullptr;
  GPIS_EMBREE_FUNCTIONS(GPIS_EMBREE_MEMBER)
#undef GPIS_EMBREE_MEMBER

  std::string version;  // of the library that was opened, "3.13.5"
  std::string path;     // of its file

  // One incoherent ray. In version 4 a null argument means just that; version 3 wants a context.
  void intersect1(RTCScene scene, RTCRayHit* rayhit) const {
#if RTC_VERSION_MAJOR >= 4
    rtcIntersect1(scene, rayhit, nullptr);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, rayhit);
#endif
  }
  // Sets ray->tfar to -inf if anything is in the way.
  void occluded1(RTCScene scene, RTCRay* ray) const {
#if RTC_VERSION_MAJOR >= 4
    rtcOccluded1(scene, ray, nullptr);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, ray);
#endif
  }
};

// The library, opened at the first call (thread-safe) and kept for the life of the process. Looked
// for beside the module (a self-contained wheel carries it in gpis_native.libs/), then by the
// dynamic linker. Throws std::runtime_error with a sentence if there is none of the right version.
const EmbreeApi& embree();

}  // namespace gpis
