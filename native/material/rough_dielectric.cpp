// Rough dielectric: single scattering at a GGX surface between two media (Walter et al. 2007).
#include "material/dielectric.h"
#include "material/ggx.h"

namespace gpis {
namespace {

class RoughDielectric : public Material {
 public:
  RoughDielectric(double eta, const Color& color, const Color& reflection, double roughness)
      : eta_(eta), color_(color), reflection_(reflection), ggx_(roughness) {}

  Color eval(const Vec3& wo, const Vec3& wi, const Color& tint) const override {
    const Color share = wi.z > 0 ? reflection_ : color_ * tint;
    return share * (pdf(wo, wi, tint) * ggx_.weight(wo, wi));
  }
  // Chooses a facet by its visible area, then reflection or refraction by Fresnel.
  double pdf(const Vec3& wo, const Vec3& wi, const Color&) const override {
    if (wi.z > 0) {
      const double fresnel = fresnel_dielectric(dot(wo, normalize(wo + wi)), eta_);
      return fresnel * ggx_.reflect_pdf(wo, wi);
    }
    const std::optional<Vec3> h = refracting_normal(wo, wi, eta_);
    if (!h || !(h->z > 0)) return 0;
    const double cos = dot(wo, *h);
    return (1 - fresnel_dielectric(cos, eta_)) * ggx_.visible_pdf(wo, *h) *
           refraction_jacobian(wo, wi, *h, eta_);
  }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                       const Color& tint) const override {
    // The last digits of one number, as good as a third one, choose what happens at the facet.
    const double digits = at.v * kFirstDigits, first = std::floor(digits);
    const Vec3 h = ggx_.sample_visible(wo, {at.u, (first + 0.5) / kFirstDigits});
    const bool reflected = digits - first < fresnel_dielectric(dot(wo, h), eta_);
    const Vec3 wi = reflected ? reflect(wo, h) : refract(wo, h, eta_);
    // To the wrong side: it would meet the surface again.
    if (!(reflected ? wi.z > 0 : wi.z < 0)) return std::nullopt;
    const double density = pdf(wo, wi, tint);
    if (!(density > 0)) return std::nullopt;
    const Color share = reflected ? reflection_ : color_ * tint;
    return MaterialSample{wi, share * ggx_.weight(wo, wi), density};
  }
  Color albedo() const override { return color_; }
  double relative_index() const override { return eta_; }

 private:
  static constexpr double kFirstDigits = 1 << 26;
  double eta_;
  Color color_, reflection_;
  Ggx ggx_;
};

}  // namespace

std::unique_ptr<Material> make_rough_dielectric(const Color& color, const Color& reflection,
                                                double ior, double roughness) {
  return std::make_unique<TwoFaces<RoughDielectric>>(ior, color, reflection, roughness);
}

}  // namespace gpis
