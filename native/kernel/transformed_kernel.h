// The kernel of a process moved by an affine map M: k(M⁻¹r), so A becomes M A Mᵀ and wave vectors
// M⁻ᵀk (definitions B12).
#pragma once

#include "kernel/kernel.h"

namespace gpis {

class TransformedKernel final : public Kernel {
 public:
  // `inverse` is the linear part of M⁻¹; `least_stretch` of M.
  TransformedKernel(KernelPtr kernel, const Mat3& inverse, double least_stretch)
      : kernel_(std::move(kernel)), inverse_(inverse), least_stretch_(least_stretch) {}

  double covariance(const Vec3& r) const override { return kernel_->covariance(inverse_ * r); }
  Vec3 gradient(const Vec3& r) const override {
    return transpose(inverse_) * kernel_->gradient(inverse_ * r);
  }
  Mat3 mixed(const Vec3& r) const override {
    return transpose(inverse_) * kernel_->mixed(inverse_ * r) * inverse_;
  }
  bool differentiable() const override { return kernel_->differentiable(); }
  double min_length_scale() const override { return kernel_->min_length_scale() * least_stretch_; }
  std::optional<std::vector<Term>> terms() const override;
  std::optional<std::vector<ProductTerm>> products() const override;
  std::string describe() const override { return kernel_->describe() + " transformed"; }

 private:
  void transform(Term& term) const;

  KernelPtr kernel_;
  Mat3 inverse_;
  double least_stretch_;
};

}  // namespace gpis
