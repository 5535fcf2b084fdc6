// Smooth dielectric: reflects or refracts, by Fresnel's share of each. On a stochastic surface the
// integrator knows the density of the normals and so can light it all the same
// (integrator/dielectric_scatter.h).
#include "material/dielectric.h"

#include "material/ggx.h"

namespace gpis {
namespace {

class Dielectric : public Material {
 public:
  Dielectric(double eta, const Color& color, const Color& reflection)
      : eta_(eta), color_(color), reflection_(reflection) {}

  Color eval(const Vec3&, const Vec3&, const Color&) const override { return {}; }
  double pdf(const Vec3&, const Vec3&, const Color&) const override { return 0; }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                       const Color& tint) const override {
    if (at.u < fresnel_dielectric(wo.z, eta_))
      return MaterialSample{{-wo.x, -wo.y, wo.z}, reflection_, 0, true};
    return MaterialSample{refract(wo, {0, 0, 1}, eta_), color_ * tint, 0, true};
  }
  Color albedo() const override { return color_; }
  bool specular() const override { return true; }
  Color specular_reflectance(double cos, const Color&) const override {
    return reflection_ * fresnel_dielectric(cos, eta_);
  }
  Color specular_transmittance(double cos, const Color& tint) const override {
    return color_ * tint * (1 - fresnel_dielectric(cos, eta_));
  }
  double relative_index() const override { return eta_; }

 private:
  double eta_;
  Color color_, reflection_;
};

}  // namespace

std::unique_ptr<Material> make_dielectric(const Color& color, const Color& reflection, double ior,
                                          double roughness) {
  // Facets that bend nothing (to the digits of their half vectors) pass light straight on.
  if (roughness >= kSmoothRoughness && std::abs(ior - 1) > 1e-4)
    return make_rough_dielectric(color, reflection, ior, roughness);
  return std::make_unique<TwoFaces<Dielectric>>(ior, color, reflection);
}

}  // namespace gpis
