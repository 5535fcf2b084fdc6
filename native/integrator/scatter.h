// The ways light scatters at a surface point. Each gives the verbs that both strategies of direct
// lighting need: `eval` (times radiance over pdf), `pdf` per solid angle, `sample`, and which
// directions go through the surface.
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
  bool transmitted = false;
};

// A micro-BRDF about a known normal.
//
// Where the shading normal differs from the geometric one, directions that a BRDF about the shading
// normal sends to the wrong side of the geometric surface are reflected in it. eval and pdf are
// then sums over a direction and its reflection; nothing is lost, so a white surface stays white
// under any interpolated normals.
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
        bent_(dot(frame_.n - geometric_normal, frame_.n - geometric_normal) > 1e-24),
        opaque_(material.relative_index() == 0) {}

  bool specular() const { return material_.specular(); }
  bool transmitted(const Vec3& w) const { return dot(w, normal_) < 0; }
  Color eval(const Vec3& w) const {
    if (opaque_ && dot(w, normal_) <= 0) return {};
    Color f;
    for_local(w, [&](const Vec3& wi) { f += material_.eval(wo_, wi, tint_); });
    return f;
  }
  double pdf(const Vec3& w) const {
    if (opaque_ && dot(w, normal_) <= 0) return 0;
    double p = 0;
    for_local(w, [&](const Vec3& wi) { p += material_.pdf(wo_, wi, tint_); });
    return p;
  }
  std::optional<ScatterSample> sample(SquarePoint at) const {
    const std::optional<MaterialSample> s = material_.sample(wo_, at, tint_);
    if (!s) return std::nullopt;
    const Vec3 w = frame_.to_world(s->wi);
    // Rounding may have turned a normal away from a grazing ray.
    const bool through = !opaque_ && s->wi.z < 0;
    if (!bent_) return ScatterSample{w, s->weight, s->specular ? kInfinity : s->pdf, through};
    const Vec3 sent = transmitted(w) == through ? w : flipped(w);
    if (s->specular) return ScatterSample{sent, s->weight, kInfinity, through};
    const double density = pdf(sent);
    if (!(density > 0)) return std::nullopt;  // exactly along the surface
    return ScatterSample{sent, eval(sent) / density, density, through};
  }

 private:
  Vec3 flipped(const Vec3& w) const { return w - normal_ * (2 * dot(w, normal_)); }
  // The directions of the BRDF's own frame that are sent to w.
  template <class Visit>
  void for_local(const Vec3& w, const Visit& visit) const {
    const Vec3 wi = frame_.to_local(w);
    if (!bent_) return visit(wi);
    const bool through = transmitted(w);
    if ((wi.z < 0) == through) visit(wi);
    const Vec3 other = frame_.to_local(flipped(w));
    if ((other.z < 0) == through) visit(other);
  }

  const Material& material_;
  Color tint_;
  Vec3 normal_;
  Frame frame_;
  Vec3 wo_;
  bool bent_, opaque_;
};

// Normals of a stochastic surface given the line sample (t, ∂_d f) (definitions B10). The gradient
// is mean + ξ₁b₁ + ξ₂b₂, a plane at g·d = ∂_d f; the gradient D n on it along a unit normal n has D
// = ∂_d f/(n·d), and dA = D² dΩ_n / |n·d| takes the plane to normals.
class NormalLaw {
 public:
  NormalLaw(const Vec3& arriving, const GradientLaw& law)
      : arriving_(arriving),
        law_(law),
        across_(cross(law.b1, law.b2)),
        area_(length(across_)),
        slope_(dot(law.mean, arriving)) {}

  const Vec3& arriving() const { return arriving_; }
  // Along `normal` of any length.
  Vec3 gradient(const Vec3& normal) const { return normal * (slope_ / dot(normal, arriving_)); }
  // Of the gradient's direction: p(ξ) D² / (|n·d| |b₁×b₂|), p the standard normal density in two
  // dimensions.
  double pdf(const Vec3& gradient) const {
    const Vec3 off = gradient - law_.mean;
    const double x1 = dot(cross(off, law_.b2), across_) / (area_ * area_);
    const double x2 = dot(cross(law_.b1, off), across_) / (area_ * area_);
    const double distance2 = dot(gradient, gradient);
    const double cos = std::abs(slope_) / std::sqrt(distance2);
    return std::exp(-0.5 * (x1 * x1 + x2 * x2)) / (2 * kPi) * distance2 / (cos * area_);
  }

 private:
  Vec3 arriving_;
  const GradientLaw& law_;
  Vec3 across_;
  double area_;
  double slope_;  // ∂_d f: negative outside
};

// A mirror on a stochastic surface. The normal that mirrors the ray's direction d to ω is along
// ω-d, and dω = 4 |n·d| dΩ_n.
class MirrorScatter {
 public:
  MirrorScatter(const Material& material, const Vec3& arriving, const GradientLaw& law,
                const Color& tint = kNoTint)
      : material_(material), tint_(tint), arriving_(arriving), normals_(arriving, law) {}

  bool transmitted(const Vec3&) const { return false; }
  // The gradient that reflects the ray to w; nothing for the direction of the ray itself.
  std::optional<Vec3> gradient_for(const Vec3& w) const {
    const Vec3 half = w - arriving_;
    if (!(dot(half, arriving_) < 0)) return std::nullopt;
    return normals_.gradient(half);
  }
  double pdf(const Vec3& w) const {
    const std::optional<Vec3> g = gradient_for(w);
    if (!g) return 0;
    return normals_.pdf(*g) * length(*g) / (4 * std::abs(dot(*g, arriving_)));
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
  NormalLaw normals_;
};

}  // namespace gpis
