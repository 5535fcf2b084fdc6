// Emitters. Lights do not block light: a ray adds what it meets on its way to the next surface, as
// in Cycles. Adding a light: one file, one line in the table of scene/scene.cpp. Radiometric
// conventions are those of Cycles, measured against it.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/vec.h"
#include "core/warp.h"

namespace gpis {

struct LightSample {
  Vec3 direction;  // from the point, unit
  double distance = kInfinity;
  Color radiance;  // divided by pdf: the contribution per unit of BRDF·cos. A delta light has pdf =
                   // infinity and gives
  double pdf = 0;  // here its irradiance on a plane that faces it.
  bool delta() const { return pdf == kInfinity; }
};

struct LightHit {
  Color radiance;
  double pdf = 0;  // per solid angle, with which sample(ray.origin) chooses ray.direction
};

class Light {
 public:
  virtual ~Light() = default;
  // Emitted power in watts (its luminance); of distant lights what enters a sphere of that radius.
  virtual double power(double scene_radius) const = 0;
  // `at` chooses the place on the light, area by area. Nothing if the point is where the light does
  // not shine.
  virtual std::optional<LightSample> sample(const Vec3& point, SquarePoint at) const = 0;
  // What the ray meets of the light before t_max; distant lights are met at infinity only. Delta
  // lights are never met.
  virtual std::optional<LightHit> intersect(const Ray& ray, double t_max) const = 0;
};

// Radiant power `power` (W) into the whole sphere; radius 0 is a point, otherwise a sphere of
// constant radiance.
std::unique_ptr<Light> make_point(const Vec3& position, const Color& power, double radius);
// A point light seen through a cone of full angle `angle` about `axis`, with a smooth edge of
// relative width `blend`; within the cone it is as bright as a point light of the same power.
std::unique_ptr<Light> make_spot(const Vec3& position, const Vec3& axis, const Color& power,
                                 double radius, double angle, double blend);
// Irradiance (W/m²) on a plane that faces the sun; `axis` is where the light goes; angle 0 is a
// direction, otherwise a disk of that full angle.
std::unique_ptr<Light> make_sun(const Vec3& axis, const Color& irradiance, double angle);
// A rectangle or ellipse with edge vectors (diameters) u and v, shining along `facing` (a normal of
// it).
std::unique_ptr<Light> make_area(const Vec3& center, const Vec3& u, const Vec3& v,
                                 const Vec3& facing, bool ellipse, const Color& radiance);
double area_of(const Vec3& u, const Vec3& v, bool ellipse);

// The world. A constant colour is not sampled (power 0): following the BRDF is as good.
std::unique_ptr<Light> make_constant_environment(const Color& radiance);
// Equirectangular image (scene/description.h) with importance sampling of what is brighter than the
// mean; an even one is not sampled either.
std::unique_ptr<Light> make_image_environment(int width, int height, const float* image,
                                              const Mat3& image_to_world, double strength);

}  // namespace gpis
