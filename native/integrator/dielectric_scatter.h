// A smooth dielectric on a stochastic surface, given the line sample (t, ∂_d f): as MirrorScatter,
// with two ways for the light to go. A direction may be met both by reflection at one normal and by
// refraction at another, and the path goes on outside of the body or inside: so these are two
// strategies, each with a density, a gradient and a shadow ray of its own.
#pragma once

#include "integrator/scatter.h"
#include "material/dielectric.h"

namespace gpis {

class DielectricScatter {
 public:
  DielectricScatter(const Material& material, const Vec3& arriving, const GradientLaw& law,
                    const Color& tint)
      : material_(material),
        tint_(tint),
        eta_(material.relative_index()),
        normals_(arriving, law) {}

  // Facets of nearly the index around them send all light on where it was going: no density.
  static bool serves(const Material& material) {
    return std::abs(material.relative_index() - 1) > 1e-3;
  }

  class Way {
   public:
    Way(const DielectricScatter& of, bool transmitted) : of_(of), transmitted_(transmitted) {}
    bool transmitted(const Vec3&) const { return transmitted_; }
    std::optional<Vec3> gradient_for(const Vec3& w) const {
      const std::optional<Vec3> n = normal_for(w);
      if (!n) return std::nullopt;
      return of_.normals_.gradient(*n);
    }
    // Fresnel's share of choosing this way included.
    double pdf(const Vec3& w) const {
      const std::optional<Vec3> n = normal_for(w);
      return n ? share(cosine(*n)) * density(w, *n) : 0;
    }
    Color eval(const Vec3& w) const {
      const std::optional<Vec3> n = normal_for(w);
      return n ? weight(cosine(*n)) * density(w, *n) : Color{};
    }

   private:
    friend DielectricScatter;
    double cosine(const Vec3& n) const { return -dot(n, of_.normals_.arriving()); }
    double share(double cos) const {
      const double reflected = fresnel_dielectric(cos, of_.eta_);
      return transmitted_ ? 1 - reflected : reflected;
    }
    Color weight(double cos) const {
      return transmitted_ ? of_.material_.specular_transmittance(cos, of_.tint_)
                          : of_.material_.specular_reflectance(cos, of_.tint_);
    }
    // Facing the ray.
    std::optional<Vec3> normal_for(const Vec3& w) const {
      const Vec3 wo = -of_.normals_.arriving();
      if (transmitted_) return refracting_normal(wo, w, of_.eta_);
      const Vec3 half = w + wo;
      const double size = length(half);
      if (!(size > 0 && dot(half, wo) > 0)) return std::nullopt;
      return half / size;
    }
    // Of w if all light went this way.
    double density(const Vec3& w, const Vec3& n) const {
      const double normals = of_.normals_.pdf(of_.normals_.gradient(n));
      return normals * (transmitted_ ? refraction_jacobian(-of_.normals_.arriving(), w, n, of_.eta_)
                                     : 1 / (4 * cosine(n)));
    }

    const DielectricScatter& of_;
    bool transmitted_;
  };
  Way reflection() const { return {*this, false}; }
  Way refraction() const { return {*this, true}; }

  // Of a gradient drawn from the law; `u` chooses the way.
  ScatterSample sample(const Vec3& gradient, double u) const {
    const Vec3& d = normals_.arriving();
    const double along = dot(gradient, d);
    const Vec3 n = gradient * ((along < 0 ? 1 : -1) / length(gradient));
    const double cos = -dot(n, d);
    const Way way(*this, !(u < fresnel_dielectric(cos, eta_)));
    const Vec3 w = normalize(way.transmitted_ ? refract(-d, n, eta_) : d + n * (2 * cos));
    const double share = way.share(cos);
    return {w, way.weight(cos) / share, share * way.density(w, n), way.transmitted_};
  }

 private:
  const Material& material_;
  Color tint_;
  double eta_;
  NormalLaw normals_;
};

}  // namespace gpis
