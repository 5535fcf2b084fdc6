// A subset of Blender's Principled node: (1 - metallic)·(coat over Lambert) + metallic·(GGX metal).
//
// The coat is a GGX dielectric of index 1.5 (F0 = .04, Schlick). What it reflects is taken from the
// base in the reciprocal way of Kelemen & Szirmay-Kalos 2001: base · (1-F(θo))(1-F(θi)) / (1-F̄), F̄
// = F0 + (1-F0)/21 the cosine average of F. Over a smooth coat, base + coat = 1 at every angle for
// a white base; rough coats lose their multiple scattering, as all GGX here.
#include "core/warp.h"
#include "material/ggx.h"
#include "material/material.h"

namespace gpis {
namespace {

constexpr double kF0 = 0.04;
constexpr double kMeanFresnel = kF0 + (1 - kF0) / 21;

double coat_fresnel(double cos) {
  return kF0 + (1 - kF0) * schlick_weight(cos);
}

class Principled final : public Material {
 public:
  Principled(const Color& color, double roughness, double metallic)
      : color_(color), ggx_(roughness), metallic_(metallic) {}

  Color eval(const Vec3& wo, const Vec3& wi, const Color& tint) const override {
    if (wi.z <= 0) return {};
    const Color color = color_ * tint;
    const double cos = dot(wo, normalize(wo + wi));
    const Color metal = color + (Color{1, 1, 1} - color) * schlick_weight(cos);
    const Color facets = metal * metallic_ + Color{1, 1, 1} * ((1 - metallic_) * coat_fresnel(cos));
    const double under = (1 - coat_fresnel(wo.z)) * (1 - coat_fresnel(wi.z)) / (1 - kMeanFresnel);
    return facets * ggx_.reflect_eval(wo, wi) + color * ((1 - metallic_) * under * wi.z / kPi);
  }
  double pdf(const Vec3& wo, const Vec3& wi, const Color& tint) const override {
    if (wi.z <= 0) return 0;
    const double p = facet_probability(wo, color_ * tint);
    return p * ggx_.reflect_pdf(wo, wi) + (1 - p) * wi.z / kPi;
  }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                       const Color& tint) const override {
    Vec3 wi;
    // One number chooses the lobe and, stretched again, the direction in it.
    const double p = facet_probability(wo, color_ * tint);
    if (at.u < p) {
      wi = reflect(wo, ggx_.sample_visible(wo, {at.u / p, at.v}));
      if (wi.z <= 0) return std::nullopt;
    } else {
      wi = square_to_cosine_hemisphere((at.u - p) / (1 - p), at.v);
    }
    const double density = pdf(wo, wi, tint);
    return MaterialSample{wi, eval(wo, wi, tint) / density, density};
  }
  Color albedo() const override { return color_; }

 private:
  // Of choosing the facets: their share of the reflected light, roughly; never 0 (they exist at
  // every angle).
  double facet_probability(const Vec3& wo, const Color& color) const {
    const double fresnel = coat_fresnel(wo.z);
    const double base = (1 - metallic_) * (1 - fresnel) * luminance(color);
    const double facets =
        metallic_ * std::max(luminance(color), fresnel) + (1 - metallic_) * fresnel;
    return facets / (facets + base);
  }
  Color color_;
  Ggx ggx_;
  double metallic_;
};

}  // namespace

std::unique_ptr<Material> make_principled(const Color& color, double roughness, double metallic) {
  if (metallic == 1 && roughness < kSmoothRoughness) return make_mirror(color, {1, 1, 1});
  return std::make_unique<Principled>(color, std::max(roughness, kSmoothRoughness), metallic);
}

}  // namespace gpis
