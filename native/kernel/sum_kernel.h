// k₁ + k₂: g is the sum of two independent processes.
#pragma once

#include "field/check.h"
#include "kernel/kernel.h"

namespace gpis {

class SumKernel : public Kernel {
 public:
  SumKernel(KernelPtr a, KernelPtr b) : a_(std::move(a)), b_(std::move(b)) {
    check_positive("The variance of a sum of kernels", variance());
  }

  double covariance(const Vec3& r) const override { return a_->covariance(r) + b_->covariance(r); }
  Vec3 gradient(const Vec3& r) const override { return a_->gradient(r) + b_->gradient(r); }
  Mat3 mixed(const Vec3& r) const override { return a_->mixed(r) + b_->mixed(r); }
  bool differentiable() const override { return a_->differentiable() && b_->differentiable(); }
  double min_length_scale() const override {
    return std::min(a_->min_length_scale(), b_->min_length_scale());
  }
  std::optional<std::vector<Term>> terms() const override {
    return joined(a_->terms(), b_->terms());
  }
  std::optional<std::vector<ProductTerm>> products() const override {
    return joined(a_->products(), b_->products());
  }
  std::string describe() const override {
    return "(" + a_->describe() + " + " + b_->describe() + ")";
  }

 private:
  template <class T>
  static std::optional<std::vector<T>> joined(std::optional<std::vector<T>> terms,
                                              const std::optional<std::vector<T>>& more) {
    if (!terms || !more || terms->size() + more->size() > kMaxTerms) return std::nullopt;
    terms->insert(terms->end(), more->begin(), more->end());
    return terms;
  }

  KernelPtr a_, b_;
};

}  // namespace gpis
