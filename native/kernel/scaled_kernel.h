// w·k: g times √w, so its variance is no longer 1 and multiplies σ² (definitions E9: a weight).
#pragma once

#include "field/check.h"
#include "kernel/kernel.h"

namespace gpis {

class ScaledKernel : public Kernel {
 public:
  ScaledKernel(double weight, KernelPtr kernel) : weight_(weight), kernel_(std::move(kernel)) {
    check_positive("The weight of a kernel", weight);
    check_positive("The variance of a kernel times its weight", variance());
  }

  double covariance(const Vec3& r) const override { return weight_ * kernel_->covariance(r); }
  Vec3 gradient(const Vec3& r) const override { return kernel_->gradient(r) * weight_; }
  Mat3 mixed(const Vec3& r) const override { return kernel_->mixed(r) * weight_; }
  bool differentiable() const override { return kernel_->differentiable(); }
  double min_length_scale() const override { return kernel_->min_length_scale(); }
  std::optional<std::vector<Term>> terms() const override { return scaled(kernel_->terms()); }
  std::optional<std::vector<ProductTerm>> products() const override {
    return scaled(kernel_->products());
  }
  std::string describe() const override {
    return number_text(weight_) + " * " + kernel_->describe();
  }

 private:
  template <class T>
  std::optional<std::vector<T>> scaled(std::optional<std::vector<T>> terms) const {
    if (terms)
      for (T& term : *terms) term.weight *= weight_;
    return terms;
  }

  double weight_;
  KernelPtr kernel_;
};

}  // namespace gpis
