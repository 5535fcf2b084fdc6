// Perfect mirror: all light goes to the reflected direction. On a stochastic surface the integrator
// knows the density of the normals and so can light it all the same (definitions B10).
#include "material/ggx.h"
#include "material/material.h"

namespace gpis {
namespace {

class Mirror final : public Material {
 public:
  Mirror(const Color& color, const Color& edge)
      : color_(color), edge_(edge), edge_is_color_(dot(edge - color, edge - color) == 0) {}

  Color eval(const Vec3&, const Vec3&, const Color&) const override { return {}; }
  double pdf(const Vec3&, const Vec3&, const Color&) const override { return 0; }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint,
                                       const Color& tint) const override {
    return MaterialSample{{-wo.x, -wo.y, wo.z}, specular_reflectance(wo.z, tint), 0, true};
  }
  Color albedo() const override { return color_; }
  bool specular() const override { return true; }
  Color specular_reflectance(double cos, const Color& tint) const override {
    const Color color = color_ * tint, edge = edge_is_color_ ? color : edge_;
    return color + (edge - color) * schlick_weight(cos);
  }

 private:
  Color color_, edge_;
  bool edge_is_color_;  // reflects the same at all angles
};

}  // namespace

std::unique_ptr<Material> make_mirror(const Color& color, const Color& edge) {
  return std::make_unique<Mirror>(color, edge);
}

}  // namespace gpis
