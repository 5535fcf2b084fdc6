// Point, sphere and spot lights. Radiant power P: intensity P/4π, radiance of a sphere of radius r
// P/(4π² r²).
#include "core/warp.h"
#include "light/light.h"

namespace gpis {
namespace {

// Smooth edge of the cone, in the cosine to the axis (Cycles: spot_light_attenuation).
struct Cone {
  Vec3 axis{0, 0, 0};
  double cos_half = -2, edge = 0;

  double attenuation(const Vec3& emitted) const {
    if (cos_half < -1) return 1;
    const double inside = dot(axis, emitted) - cos_half;
    if (inside <= 0) return 0;
    if (inside >= edge) return 1;
    const double x = inside / edge;
    return x * x * (3 - 2 * x);
  }
};

class PointLight final : public Light {
 public:
  PointLight(const Vec3& position, const Color& power, const Cone& cone)
      : position_(position), power_(power), cone_(cone) {}

  double power(double) const override { return luminance(power_); }
  std::optional<LightSample> sample(const Vec3& point, SquarePoint) const override {
    const Vec3 to_light = position_ - point;
    const double distance2 = dot(to_light, to_light);
    if (distance2 == 0) return std::nullopt;
    const double distance = std::sqrt(distance2);
    const Vec3 direction = to_light / distance;
    const double attenuation = cone_.attenuation(-direction);
    if (attenuation == 0) return std::nullopt;
    return LightSample{direction, distance, power_ * (attenuation / (4 * kPi * distance2)),
                       kInfinity};
  }
  std::optional<LightHit> intersect(const Ray&, double) const override { return std::nullopt; }

 private:
  Vec3 position_;
  Color power_;
  Cone cone_;
};

class SphereLight final : public Light {
 public:
  SphereLight(const Vec3& position, const Color& power, double radius, const Cone& cone)
      : position_(position), power_(power), radius_(radius), cone_(cone) {
    radiance_ = power / (4 * kPi * kPi * radius * radius);
  }

  double power(double) const override { return luminance(power_); }
  std::optional<LightSample> sample(const Vec3& point, SquarePoint at) const override {
    const Vec3 to_center = position_ - point;
    const double distance2 = dot(to_center, to_center), cap = cap_from(distance2);
    if (cap == 0) return std::nullopt;
    const Vec3 direction =
        Frame(to_center / std::sqrt(distance2)).to_world(square_to_cone(at.u, at.v, cap));
    const double attenuation = cone_.attenuation(-direction);
    if (attenuation == 0) return std::nullopt;
    const double along = dot(to_center, direction);
    const Vec3 off = to_center - direction * along;
    const double half_chord = std::sqrt(std::max(0.0, radius_ * radius_ - dot(off, off)));
    return LightSample{direction, along - half_chord, radiance_ * attenuation, 1 / (2 * kPi * cap)};
  }
  std::optional<LightHit> intersect(const Ray& ray, double t_max) const override {
    const Vec3 to_center = position_ - ray.origin;
    const double cap = cap_from(dot(to_center, to_center));
    if (cap == 0) return std::nullopt;
    const double along = dot(to_center, ray.direction);
    const Vec3 off = to_center - ray.direction * along;
    const double discriminant = radius_ * radius_ - dot(off, off);
    if (along <= 0 || discriminant <= 0 || along - std::sqrt(discriminant) >= t_max)
      return std::nullopt;
    const double attenuation = cone_.attenuation(-ray.direction);
    if (attenuation == 0) return std::nullopt;
    return LightHit{radiance_ * attenuation, 1 / (2 * kPi * cap)};
  }

 private:
  // 1 - cos of the half angle under which the sphere is seen; 0 from inside, where it does not
  // shine.
  double cap_from(double distance2) const {
    const double sin2 = radius_ * radius_ / distance2;
    return sin2 < 1 ? sin2 / (1 + std::sqrt(1 - sin2)) : 0;
  }
  Vec3 position_;
  Color power_, radiance_;
  double radius_;
  Cone cone_;
};

std::unique_ptr<Light> make(const Vec3& position, const Color& power, double radius,
                            const Cone& cone) {
  if (radius == 0) return std::make_unique<PointLight>(position, power, cone);
  return std::make_unique<SphereLight>(position, power, radius, cone);
}

}  // namespace

std::unique_ptr<Light> make_point(const Vec3& position, const Color& power, double radius) {
  return make(position, power, radius, {});
}

std::unique_ptr<Light> make_spot(const Vec3& position, const Vec3& axis, const Color& power,
                                 double radius, double angle, double blend) {
  const double cos_half = std::cos(angle / 2);
  return make(position, power, radius, {axis, cos_half, (1 - cos_half) * blend});
}

}  // namespace gpis
