// Area light: a one-sided rectangle or ellipse of constant radiance L. Its power is π L times its
// area.
#include "core/warp.h"
#include "light/light.h"

namespace gpis {

double area_of(const Vec3& u, const Vec3& v, bool ellipse) {
  return length(cross(u, v)) * (ellipse ? kPi / 4 : 1);
}

namespace {

class AreaLight final : public Light {
 public:
  AreaLight(const Vec3& center, const Vec3& u, const Vec3& v, const Vec3& facing, bool ellipse,
            const Color& radiance)
      : center_(center),
        u_(u),
        v_(v),
        ellipse_(ellipse),
        radiance_(radiance),
        area_(area_of(u, v, ellipse)) {
    const Vec3 across = cross(u, v);
    normal_ = normalize(across) * std::copysign(1.0, dot(across, facing));
    // Dual basis: p = center + a u + b v has a = (p - center)·dual_u.
    dual_u_ = cross(v, across) / dot(across, across);
    dual_v_ = cross(across, u) / dot(across, across);
  }

  double power(double) const override { return luminance(radiance_) * kPi * area_; }
  std::optional<LightSample> sample(const Vec3& point, SquarePoint at) const override {
    double a = at.u - 0.5, b = at.v - 0.5;
    if (ellipse_) {
      const auto [x, y] = square_to_disk(at.u, at.v);
      a = x / 2;
      b = y / 2;
    }
    const Vec3 to_light = center_ + u_ * a + v_ * b - point;
    const double distance2 = dot(to_light, to_light), distance = std::sqrt(distance2);
    const double cos = -dot(to_light, normal_) / distance;
    if (!(cos > 0)) return std::nullopt;
    return LightSample{to_light / distance, distance, radiance_, distance2 / (cos * area_)};
  }
  std::optional<LightHit> intersect(const Ray& ray, double t_max) const override {
    const double cos = -dot(ray.direction, normal_);
    if (cos <= 0) return std::nullopt;
    const double t = dot(ray.origin - center_, normal_) / cos;
    if (t <= 0 || t >= t_max) return std::nullopt;
    const Vec3 p = ray.at(t) - center_;
    const double a = dot(p, dual_u_), b = dot(p, dual_v_);
    const bool outside = ellipse_ ? a * a + b * b > 0.25 : std::max(std::abs(a), std::abs(b)) > 0.5;
    if (outside) return std::nullopt;
    return LightHit{radiance_, t * t / (cos * area_)};
  }

 private:
  Vec3 center_, u_, v_, normal_, dual_u_, dual_v_;
  bool ellipse_;
  Color radiance_;
  double area_;
};

}  // namespace

std::unique_ptr<Light> make_area(const Vec3& center, const Vec3& u, const Vec3& v,
                                 const Vec3& facing, bool ellipse, const Color& radiance) {
  return std::make_unique<AreaLight>(center, u, v, facing, ellipse, radiance);
}

}  // namespace gpis
