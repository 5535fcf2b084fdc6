// A line through a process of ONE radial correlation κ(q), q² = rᵀA⁻¹r, A constant: frame and
// length scale of the line, and the gradient across it, which is independent of the path (math.md
// §4).
#pragma once

#include "kernel/kernel.h"
#include "process/path.h"

namespace gpis {

class RadialLine {
 public:
  struct Plan {
    explicit Plan(const Term& term);
    Radial radial;
    double lambda2;
    Mat3 whitening;    // B, A⁻¹ = BᵀB, rows orthogonal; a zero row: constant along that axis
    Mat3 gradient_of;  // Bᵀ: from slopes in whitened space to a gradient
    Mat3 slopes_of;    // its inverse on the axes that are not constant
    Vec3 constant;     // a whitened axis along which nothing changes, if there is one
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor) {
    plan_ = &plan;
    anchor_ = anchor;
    remembered_ = false;
    whitened_ = plan.whitening * line.direction;
    inverse_length_ = length(whitened_);
  }

  // 1/ℓ_d per t; 0 where g is constant along the line.
  double inverse_length() const { return inverse_length_; }
  double anchor() const { return anchor_; }
  // Distance from the anchor in length scales, and a slope per length scale.
  double q(double t) const { return (t - anchor_) * inverse_length_; }
  double per_length(double slope) const {
    return inverse_length_ > 0 ? slope / inverse_length_ : 0;
  }
  double slope_deviation() const { return std::sqrt(plan_->lambda2) * inverse_length_; }

  // The gradient at the anchor is known: slopes across the line start from it.
  void remember(const Vec3& gradient) {
    const Vec3 slopes = plan_->slopes_of * gradient;
    const Frame e = frame();
    gamma1_ = dot(e.s, slopes);
    gamma2_ = dot(e.t, slopes);
    remembered_ = true;
  }

  // ∇g = Bᵀ(γ₁s + γ₂t + g'n); γ(q) = cγ(0) + √(λ₂(1-c²)) ξ.
  PathGradient gradient(double t, double slope) const;

 private:
  const Plan* plan_ = nullptr;
  // Orthonormal in whitened space, n along the line; most lines end without needing it.
  Frame frame() const {
    return Frame(inverse_length_ > 0 ? whitened_ / inverse_length_ : plan_->constant);
  }

  Vec3 whitened_;  // the direction
  double inverse_length_ = 1, anchor_ = 0;
  double gamma1_ = 0, gamma2_ = 0;
  bool remembered_ = false;
};

struct GaussianProcess;
// The one term of a kernel that has but one, without wave; refuses any other kernel for `sampler`.
Term single_term(const GaussianProcess& process, const char* sampler);

}  // namespace gpis
