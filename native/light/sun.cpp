// Sun: a distant disk of constant radiance L, or one direction. The irradiance on a plane that
// faces a disk of half angle a is E = π L sin² a.
#include "core/warp.h"
#include "light/light.h"

namespace gpis {
namespace {

class DirectionalSun final : public Light {
 public:
  DirectionalSun(const Vec3& axis, const Color& irradiance)
      : to_sun_(-axis), irradiance_(irradiance) {}

  double power(double r) const override { return luminance(irradiance_) * kPi * r * r; }
  std::optional<LightSample> sample(const Vec3&, SquarePoint) const override {
    return LightSample{to_sun_, kInfinity, irradiance_, kInfinity};
  }
  std::optional<LightHit> intersect(const Ray&, double) const override { return std::nullopt; }

 private:
  Vec3 to_sun_;
  Color irradiance_;
};

class DiskSun final : public Light {
 public:
  DiskSun(const Vec3& axis, const Color& irradiance, double half_angle)
      : frame_(-axis), irradiance_(irradiance) {
    const double sin = std::sin(half_angle), sin_half = std::sin(half_angle / 2);
    radiance_ = irradiance / (kPi * sin * sin);
    cap_ = 2 * sin_half * sin_half;  // 1 - cos of the half angle, without cancellation
  }

  double power(double r) const override { return luminance(irradiance_) * kPi * r * r; }
  std::optional<LightSample> sample(const Vec3&, SquarePoint at) const override {
    return LightSample{frame_.to_world(square_to_cone(at.u, at.v, cap_)), kInfinity, radiance_,
                       density()};
  }
  std::optional<LightHit> intersect(const Ray& ray, double t_max) const override {
    if (t_max < kInfinity) return std::nullopt;
    // |d - axis|²/2 = 1 - cos, accurate for small disks.
    const Vec3 apart = ray.direction - frame_.n;
    if (dot(apart, apart) >= 2 * cap_) return std::nullopt;
    return LightHit{radiance_, density()};
  }

 private:
  double density() const { return 1 / (2 * kPi * cap_); }
  Frame frame_;
  Color irradiance_, radiance_;
  double cap_;
};

}  // namespace

std::unique_ptr<Light> make_sun(const Vec3& axis, const Color& irradiance, double angle) {
  if (angle == 0) return std::make_unique<DirectionalSun>(axis, irradiance);
  return std::make_unique<DiskSun>(axis, irradiance, angle / 2);
}

}  // namespace gpis
