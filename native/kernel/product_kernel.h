// k₁ · k₂.
#pragma once

#include "field/check.h"
#include "kernel/kernel.h"

namespace gpis {

class ProductKernel : public Kernel {
 public:
  ProductKernel(KernelPtr a, KernelPtr b) : a_(std::move(a)), b_(std::move(b)) {
    check_positive("The variance of a product of kernels", variance());
  }

  double covariance(const Vec3& r) const override { return a_->covariance(r) * b_->covariance(r); }
  Vec3 gradient(const Vec3& r) const override {
    return a_->gradient(r) * b_->covariance(r) + b_->gradient(r) * a_->covariance(r);
  }
  Mat3 mixed(const Vec3& r) const override;
  bool differentiable() const override { return a_->differentiable() && b_->differentiable(); }
  double min_length_scale() const override {
    return 1 / std::hypot(1 / a_->min_length_scale(), 1 / b_->min_length_scale());
  }
  // Squared exponentials multiply to one with the sum of the A⁻¹, cosines to a half of each of two
  // cosines, a constant to the other factor; what else there is has no normal form.
  std::optional<std::vector<Term>> terms() const override;
  std::optional<std::vector<ProductTerm>> products() const override;
  std::string describe() const override { return a_->describe() + " * " + b_->describe(); }

 private:
  KernelPtr a_, b_;
};

}  // namespace gpis
