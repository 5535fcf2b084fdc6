// The two ways light scatters at a surface point. Each gives the three verbs that both strategies
// of direct lighting need: `eval` (times radiance over pdf), `pdf` per solid angle, `sample`.
#pragma once

#include <optional>

#include "core/vec.h"
#include "core/warp.h"
#include "material/material.h"
#include "process/surface.h"

namespace gpis {

struct ScatterSample {
  Vec3 direction;
  Color weight;            // eval / pdf
  double pdf = kInfinity;  // infinite: a delta distribution, without alternative in MIS
};

// A micro-BRDF about a known normal.
//
// Where the shading normal differs from the geometric one, directions that a BRDF about the shading
// normal sends below the geometric surface are reflected up again in it. eval and pdf are then sums
// over a direction and its reflection; nothing is lost, so a white surface stays white under any
// interpolated normals.
class SurfaceScatter {
 public:
  // `arriving` is the direction of the ray; the geometric normal faces it.
  SurfaceScatter(const Material& material, const Vec3& arriving, const Vec3& geometric_normal,
                 const Vec3& shading_normal, const Color& tint = kNoTint)
      : material_(material),
        tint_(tint),
        normal_(geometric_normal),
        // Seen from behind the shading normal only the geometric one makes sense.
        frame_(dot(shading_normal, arriving) < 0 ? shading_normal : geometric_normal),
        wo_(frame_.to_local(-arriving)),
        bent_(dot(frame_.n - geometric_normal, frame_.n - geometric_normal) > 1e-24) {}

  bool specular() const { return material_.specular(); }
  Color eval(const Vec3& w) const {
    if (dot(w, normal_) <= 0) return {};
    Color f = material_.eval(wo_, frame_.to_local(w), tint_);
    if (bent_) f += material_.eval(wo_, frame_.to_local(flipped(w)), tint_);
    return f;
  }
  double pdf(const Vec3& w) const {
    if (dot(w, normal_) <= 0) return 0;
    double p = material_.pdf(wo_, frame_.to_local(w), tint_);
    if (bent_) p += material_.pdf(wo_, frame_.to_local(flipped(w)), tint_);
    return p;
  }
  std::optional<ScatterSample> sample(SquarePoint at) const {
    const std::optional<MaterialSample> s = material_.sample(wo_, at, tint_);
    if (!s) return std::nullopt;
    const Vec3 w = frame_.to_world(s->wi);
    if (!bent_) return ScatterSample{w, s->weight, s->specular ? kInfinity : s->pdf};
    const Vec3 up = dot(w, normal_) < 0 ? flipped(w) : w;
    if (s->specular) return ScatterSample{up, s->weight};
    const double density = pdf(up);
    if (!(density > 0)) return std::nullopt;  // exactly along the surface
    return ScatterSample{up, eval(up) / density, density};
  }

 private:
  Vec3 flipped(const Vec3& w) const { return w - normal_ * (2 * dot(w, normal_)); }

  const Material& material_;
  Color tint_;
  Vec3 normal_;
  Frame frame_;
  Vec3 wo_;
  bool bent_;
};

// A mirror on a stochastic surface, given the line sample (t, ∂_d f) (definitions B10). The
// gradient is mean + ξ₁b₁ + ξ₂b₂, a plane at g·d = ∂_d f; the gradient D n on it that mirrors the
// ray's direction d to ω has n = (ω-d)/|ω-d| and D = ∂_d f/(n·d). With
//   dA = D² dΩ_n / |n·d|  (plane to normals),   dω = 4 |n·d| dΩ_n  (normals to directions)
// the density of ω is q = p(ξ) D² / (4 (n·d)² |b₁×b₂|), p the standard normal density in two
// dimensions.
class MirrorScatter {
 public:
  MirrorScatter(const Material& material, const Vec3& arriving, const GradientLaw& law,
                const Color& tint = kNoTint)
      : material_(material),
        tint_(tint),
        arriving_(arriving),
        law_(law),
        across_(cross(law.b1, law.b2)),
        slope_(dot(law.mean, arriving)) {
    area_ = length(across_);
  }

  // The gradient that reflects the ray to w; nothing for the direction of the ray itself.
  std::optional<Vec3> gradient_for(const Vec3& w) const {
    const Vec3 half = w - arriving_;
    const double cos = dot(half, arriving_);  // n·d |half|
    if (!(cos < 0)) return std::nullopt;
    return half * (slope_ / cos);
  }
  double pdf(const Vec3& w) const {
    const std::optional<Vec3> g = gradient_for(w);
    if (!g) return 0;
    const Vec3 off = *g - law_.mean;
    const double x1 = dot(cross(off, law_.b2), across_) / (area_ * area_);
    const double x2 = dot(cross(law_.b1, off), across_) / (area_ * area_);
    const double distance2 = dot(*g, *g);
    const double cos2 = slope_ * slope_ / distance2;  // (n·d)²
    return std::exp(-0.5 * (x1 * x1 + x2 * x2)) / (2 * kPi) * distance2 / (4 * cos2 * area_);
  }
  Color eval(const Vec3& w) const { return reflectance(w) * pdf(w); }
  // Towards the direction that a gradient drawn from the law reflects to.
  ScatterSample sample(const Vec3& gradient) const {
    const Vec3 n = normalize(gradient);
    const Vec3 w = normalize(arriving_ - n * (2 * dot(arriving_, n)));
    return {w, reflectance(w), pdf(w)};
  }

 private:
  Color reflectance(const Vec3& w) const {
    return material_.specular_reflectance(std::sqrt(std::max(0.0, (1 - dot(w, arriving_)) / 2)),
                                          tint_);
  }

  const Material& material_;
  Color tint_;
  Vec3 arriving_;
  const GradientLaw& law_;
  Vec3 across_;
  double slope_;  // ∂_d f < 0
  double area_;
};

}  // namespace gpis
