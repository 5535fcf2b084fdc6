// Lambertian reflection: BRDF color/π.
#include "core/warp.h"
#include "material/material.h"

namespace gpis {
namespace {

class Lambert final : public Material {
 public:
  explicit Lambert(const Color& color) : color_(color) {}

  Color eval(const Vec3& wo, const Vec3& wi, const Color& tint) const override {
    return color_ * tint * pdf(wo, wi, tint);
  }
  double pdf(const Vec3&, const Vec3& wi, const Color&) const override {
    return std::max(0.0, wi.z) / kPi;
  }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                       const Color& tint) const override {
    const Vec3 wi = square_to_cosine_hemisphere(at.u, at.v);
    return MaterialSample{wi, color_ * tint, pdf(wo, wi, tint)};
  }
  Color albedo() const override { return color_; }

 private:
  Color color_;
};

}  // namespace

std::unique_ptr<Material> make_lambert(const Color& color) {
  return std::make_unique<Lambert>(color);
}

}  // namespace gpis
