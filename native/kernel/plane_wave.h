// cos(k·r): g is one cosine of random amplitude and phase, constant across k. Its first passage is
// known exactly (oracle 15).
#pragma once

#include "kernel/kernel.h"

namespace gpis {

class PlaneWave : public Kernel {
 public:
  explicit PlaneWave(const Vec3& wave_vector);

  double covariance(const Vec3& r) const override { return std::cos(dot(k_, r)); }
  Vec3 gradient(const Vec3& r) const override { return k_ * -std::sin(dot(k_, r)); }
  Mat3 mixed(const Vec3& r) const override { return outer(k_, k_) * covariance(r); }
  bool differentiable() const override { return true; }
  double min_length_scale() const override { return 1 / length(k_); }
  std::optional<std::vector<Term>> terms() const override;
  std::string describe() const override { return "PlaneWave(" + vector_text(k_) + ")"; }

 private:
  Vec3 k_;
};

}  // namespace gpis
