#include "geometry/embree_api.h"

#include <dlfcn.h>

#include <filesystem>
#include <stdexcept>

namespace gpis {
namespace {

#define GPIS_STRING_OF(x) #x
#define GPIS_STRING(x) GPIS_STRING_OF(x)
constexpr const char* kSoname =
    "libembree" GPIS_STRING(RTC_VERSION_MAJOR) ".so." GPIS_STRING(RTC_VERSION_MAJOR);

std::filesystem::path bundled_library() {
  Dl_info info{};
  if (!dladdr(reinterpret_cast<void*>(&bundled_library), &info) || !info.dli_fname) return {};
  return std::filesystem::path(info.dli_fname).parent_path() / "gpis_native.libs" / kSoname;
}

// RTLD_LOCAL keeps our copy out of the host's scope; dlsym on the handle keeps the host's copy out
// of ours. Not RTLD_DEEPBIND, which changes malloc for the library under official Blender builds.
void* open_library() {
  const std::filesystem::path bundled = bundled_library();
  std::error_code none;
  const bool is_bundled = std::filesystem::exists(bundled, none);
  void* handle = dlopen(is_bundled ? bundled.c_str() : kSoname, RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    throw std::runtime_error("Embree could not be opened: " + std::string(dlerror()) +
                             ". Install the library " + kSoname +
                             " or use the wheel that carries it.");
  }
  return handle;
}

template <class Function>
void take(void* handle, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(handle, name));
  if (!function) {
    throw std::runtime_error(std::string(kSoname) + " lacks the function " + name +
                             "; it is not the Embree this module was built for.");
  }
}

EmbreeApi load() {
  void* handle = open_library();
  EmbreeApi api;
#define GPIS_EMBREE_TAKE(name) take(handle, #name, api.name);
  GPIS_EMBREE_FUNCTIONS(GPIS_EMBREE_TAKE)
#undef GPIS_EMBREE_TAKE

  Dl_info info{};
  if (dladdr(reinterpret_cast<void*>(api.rtcNewDevice), &info) && info.dli_fname) {
    api.path = info.dli_fname;
  }
  RTCDevice device = api.rtcNewDevice(nullptr);
  if (!device) throw std::runtime_error("Embree (" + api.path + ") could not make a device.");
  const auto property = [&](RTCDeviceProperty p) { return api.rtcGetDeviceProperty(device, p); };
  const auto major = property(RTC_DEVICE_PROPERTY_VERSION_MAJOR);
  api.version = std::to_string(major) + "." +
                std::to_string(property(RTC_DEVICE_PROPERTY_VERSION_MINOR)) + "." +
                std::to_string(property(RTC_DEVICE_PROPERTY_VERSION_PATCH));
  api.rtcReleaseDevice(device);
  if (major != RTC_VERSION_MAJOR) {
    throw std::runtime_error("Embree " + api.version + " (" + api.path +
                             ") answered, but this module was built for Embree " +
                             GPIS_STRING(RTC_VERSION_MAJOR) + "; rays would miss everything.");
  }
  return api;
}

}  // namespace

const EmbreeApi& embree() {
  static const EmbreeApi api = load();
  return api;
}

}  // namespace gpis
