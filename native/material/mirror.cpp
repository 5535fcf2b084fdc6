// Perfect mirror: all light goes to the reflected direction. On a stochastic surface the integrator
// knows the density of the normals and so can light it all the same (definitions B10).
#include "material/ggx.h"
#include "material/material.h"

namespace gpis {
namespace {

class Mirror final : public Material {
 public:
  Mirror(const Color& color, const Color& edge) : color_(color), edge_(edge) {}

  Color eval(const Vec3&, const Vec3&) const override { return {}; }
  double pdf(const Vec3&, const Vec3&) const override { return 0; }
  std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint) const override {
    return MaterialSample{{-wo.x, -wo.y, wo.z}, specular_reflectance(wo.z), 0, true};
  }
  Color albedo() const override { return color_; }
  bool specular() const override { return true; }
  Color specular_reflectance(double cos) const override {
    return color_ + (edge_ - color_) * schlick_weight(cos);
  }

 private:
  Color color_, edge_;
};

}  // namespace

std::unique_ptr<Material> make_mirror(const Color& color, const Color& edge) {
  return std::make_unique<Mirror>(color, edge);
}

}  // namespace gpis
