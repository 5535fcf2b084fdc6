// Reflection and refraction between two media (Born & Wolf, Principles of Optics, §1.5). `eta` is
// the index of refraction beyond the surface over that before it.
#pragma once

#include "material/material.h"

namespace gpis {

// Squared cosine of the angle of refraction at angle of incidence θ; negative: total reflection.
inline double refracted_cos2(double cos, double eta) {
  return 1 - (1 - cos * cos) / (eta * eta);
}

// Fresnel's reflectance of unpolarised light.
inline double fresnel_dielectric(double cos, double eta) {
  const double cos2 = refracted_cos2(cos, eta);
  if (!(cos2 > 0)) return 1;
  const double beyond = std::sqrt(cos2);
  const double across = (cos - eta * beyond) / (cos + eta * beyond);
  const double along = (eta * cos - beyond) / (eta * cos + beyond);
  return (across * across + along * along) / 2;
}

// Snell's law at a unit normal h on the side of `wo`. Not where all is reflected.
inline Vec3 refract(const Vec3& wo, const Vec3& h, double eta) {
  const double cos = dot(wo, h);
  return h * (cos / eta - std::sqrt(std::max(0.0, refracted_cos2(cos, eta)))) - wo / eta;
}

// The normal, on the side of `wo`, that refracts it to w; nothing if there is none. And the solid
// angle of such normals over that of w (Walter et al. 2007, eq. 16 and 17).
inline std::optional<Vec3> refracting_normal(const Vec3& wo, const Vec3& w, double eta) {
  Vec3 h = wo + w * eta;
  const double size = length(h);
  if (!(size > 0)) return std::nullopt;
  h = h * ((eta > 1 ? -1 : 1) / size);
  if (!(dot(h, wo) > 0 && dot(h, w) < 0)) return std::nullopt;
  return h;
}
inline double refraction_jacobian(const Vec3& wo, const Vec3& w, const Vec3& h, double eta) {
  const double sum = dot(wo, h) + eta * dot(w, h);
  return eta * eta * std::abs(dot(w, h)) / (sum * sum);
}

// A surface and its face from inside.
template <class Face>
class TwoFaces final : public Face {
 public:
  template <class... Properties>
  explicit TwoFaces(double ior, const Properties&... properties)
      : Face(ior, properties...), inside_(1 / ior, properties...) {}
  const Material& from_inside() const override { return inside_; }

 private:
  Face inside_;
};

std::unique_ptr<Material> make_rough_dielectric(const Color& color, const Color& reflection,
                                                double ior, double roughness);

}  // namespace gpis
