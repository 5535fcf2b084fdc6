// The GGX (Trowbridge-Reitz) microfacet distribution with Smith's height-correlated masking (Walter
// et al. 2007, Heitz 2014). α = roughness², as in Blender. Local frame, macro normal +z.
#pragma once

#include "core/vec.h"
#include "core/warp.h"

namespace gpis {

class Ggx {
 public:
  explicit Ggx(double roughness) : alpha_(roughness * roughness) {}

  // Density of facets per projected macro area.
  double distribution(const Vec3& h) const {
    const double a2 = alpha_ * alpha_;
    const double e = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    return 1 / (kPi * a2 * e * e);
  }
  double masking(const Vec3& w) const { return 1 / (1 + lambda(w)); }
  double masking_shadowing(const Vec3& wo, const Vec3& wi) const {
    return 1 / (1 + lambda(wo) + lambda(wi));
  }
  // Visible normals: density masking(wo) (wo·h)₊ D(h) / wo.z (Dupuy & Benyoub 2023, spherical
  // caps).
  Vec3 sample_visible(const Vec3& wo, SquarePoint at) const {
    const Vec3 v = normalize({alpha_ * wo.x, alpha_ * wo.y, wo.z});
    const double phi = 2 * kPi * at.v;
    const double z = 1 - at.u * (1 + v.z);
    const double sin = std::sqrt(std::max(0.0, 1 - z * z));
    const Vec3 h = Vec3{sin * std::cos(phi), sin * std::sin(phi), z} + v;
    return normalize({alpha_ * h.x, alpha_ * h.y, h.z});
  }

  double visible_pdf(const Vec3& wo, const Vec3& h) const {
    return masking(wo) * std::max(0.0, dot(wo, h)) * distribution(h) / wo.z;
  }

  // Of reflected light: BRDF·cos θ_i without the Fresnel factor, and the density of reflecting
  // about a visible normal.
  double reflect_eval(const Vec3& wo, const Vec3& wi) const {
    if (wi.z <= 0) return 0;
    return distribution(normalize(wo + wi)) * masking_shadowing(wo, wi) / (4 * wo.z);
  }
  double reflect_pdf(const Vec3& wo, const Vec3& wi) const {
    if (wi.z <= 0) return 0;
    return distribution(normalize(wo + wi)) * masking(wo) / (4 * wo.z);
  }
  // Masking-shadowing of what has been masked: reflect_eval / reflect_pdf, and the same for
  // refracted light.
  double weight(const Vec3& wo, const Vec3& wi) const {
    return (1 + lambda(wo)) / (1 + lambda(wo) + lambda(wi));
  }

 private:
  double lambda(const Vec3& w) const {
    const double tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    return 0.5 * (std::sqrt(1 + alpha_ * alpha_ * tan2) - 1);
  }
  double alpha_;
};

inline Vec3 reflect(const Vec3& w, const Vec3& h) {
  return h * (2 * dot(w, h)) - w;
}

// Schlick's approximation of Fresnel reflectance.
inline double schlick_weight(double cos) {
  const double c = std::clamp(1 - cos, 0.0, 1.0);
  return c * c * c * c * c;
}

}  // namespace gpis
