// Rough conductor: single scattering at a GGX surface.
#include "material/ggx.h"
#include "material/material.h"

namespace gpis {
namespace {

class Conductor final : public Material {
 public:
  Conductor(const Color& color, double roughness) : color_(color), ggx_(roughness) {}

  Color eval(const Vec3& wo, const Vec3& wi, const Color& tint) const override {
    return color_ * tint * ggx_.reflect_eval(wo, wi);
  }
  double pdf(const Vec3& wo, const Vec3& wi, const Color&) const override {
    return ggx_.reflect_pdf(wo, wi);
  }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                       const Color& tint) const override {
    const Vec3 wi = reflect(wo, ggx_.sample_visible(wo, at));
    if (wi.z <= 0) return std::nullopt;
    return MaterialSample{wi, color_ * tint * ggx_.weight(wo, wi), ggx_.reflect_pdf(wo, wi)};
  }
  Color albedo() const override { return color_; }

 private:
  Color color_;
  Ggx ggx_;
};

}  // namespace

std::unique_ptr<Material> make_conductor(const Color& color, double roughness) {
  if (roughness < kSmoothRoughness) return make_mirror(color, color);
  return std::make_unique<Conductor>(color, roughness);
}

}  // namespace gpis
