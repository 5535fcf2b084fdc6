#include "process/varying_lattice.h"

#include <Eigen/Core>

#include "field/check.h"

namespace gpis {
namespace {

constexpr double kReach2 = 16;  // exp(-16) = 1e-7 is left out
constexpr double kMostNodes = 2e6;
constexpr int kMargin = 4;

}  // namespace

VaryingLattice::VaryingLattice(TensorFieldPtr a, double length, int number)
    : a_(std::move(a)), length2_(length * length), number_(number) {
  const Range eigenvalues = a_->eigenvalues();
  spacing_ = 0.5 * std::sqrt(length2_ * eigenvalues.min);
  const double nodes = std::pow(16 * std::sqrt(eigenvalues.max / eigenvalues.min), 3);
  if (!(nodes <= kMostNodes))
    refuse("The length scales of the anisotropy go from ", std::sqrt(length2_ * eigenvalues.min),
           " to ", std::sqrt(length2_ * eigenvalues.max),
           ": a realisation takes a ratio of up to 8. Let them vary less.");
}

// Taken with a margin that serves the points around too; rows have the strides of size_.
const double* VaryingLattice::window(LatticeNoise& noise, const Node& first,
                                     const std::array<int, 3>& size) {
  bool within = generation_ == noise.generation();
  for (int a = 0; a < 3; ++a)
    within &= first_[a] <= first[a] && first[a] + size[a] <= first_[a] + size_[a];
  if (!within) {
    for (int a = 0; a < 3; ++a) {
      first_[a] = first[a] - kMargin;
      size_[a] = size[a] + 2 * kMargin;
    }
    normals_.resize(static_cast<std::size_t>(size_[0]) * size_[1] * size_[2]);
    noise.window(number_, 0, first_, size_, normals_.data());
    generation_ = noise.generation();
  }
  const auto row = (first[2] - first_[2]) * size_[1] + first[1] - first_[1];
  return normals_.data() + row * size_[0] + first[0] - first_[0];
}

VaryingLattice::Ellipsoid::Ellipsoid(const SymMat3& a, const Vec3& x, double h)
    : factor(a), p(factor.inverse()) {
  for (int axis = 0; axis < 3; ++axis) {
    const double reach = std::sqrt(kReach2 * a[axis]);
    first[axis] = static_cast<std::int64_t>(std::ceil((x[axis] - reach) / h));
    size[axis] = static_cast<int>(static_cast<std::int64_t>(std::floor((x[axis] + reach) / h)) -
                                  first[axis] + 1);
  }
  scale = std::pow(2 / kPi, 0.75) * std::pow(factor.determinant(), -0.25) * std::pow(h, 1.5);
}

// On a row the weights are a Gaussian about u* = -b: exp(-least - p.xx (u + b)²).
template <class Visit>
void VaryingLattice::rows(const Ellipsoid& e, const Vec3& x, const double* normals,
                          const Visit& visit) const {
  const double h = spacing_;
  const SymMat3& p = e.p;
  for (int k = 0; k < e.size[2]; ++k) {
    const double uz = (e.first[2] + k) * h - x.z;
    for (int j = 0; j < e.size[1]; ++j) {
      const double* xi = normals + (static_cast<std::ptrdiff_t>(k) * size_[1] + j) * size_[0];
      const double uy = (e.first[1] + j) * h - x.y;
      const double b = (p.xy * uy + p.xz * uz) / p.xx;
      const double least = p.yy * uy * uy + 2 * p.yz * uy * uz + p.zz * uz * uz - p.xx * b * b;
      if (!(least < kReach2)) continue;
      const double half = std::sqrt((kReach2 - least) / p.xx), left = x.x - b - e.first[0] * h;
      const int begin = std::max(0, static_cast<int>(std::ceil((left - half) / h)));
      const int end = std::min(e.size[0] - 1, static_cast<int>(std::floor((left + half) / h)));
      if (begin > end) continue;
      visit(uy, uz, (e.first[0] + begin) * h - x.x, b, least, xi + begin, end - begin + 1);
    }
  }
}

// Weights of a row as const · exp(-p.xx (ih)²) · exp(-2 p.xx c h)^i from its first node at c: the
// first factor is the same in all rows, the powers of the last go four by four.
double VaryingLattice::value(LatticeNoise& noise, const Vec3& x) {
  using Four = Eigen::Array<double, 4, 1>;
  const Ellipsoid e(a_->value(x) * length2_, x, spacing_);
  const double* normals = window(noise, e.first, e.size);
  const double h = spacing_, rate = e.p.xx * h * h;
  gauss_.resize(e.size[0]);
  for (int i = 0; i < e.size[0]; ++i) gauss_[i] = std::exp(-rate * i * i);
  double sum = 0;
  rows(e, x, normals,
       [&](double, double, double u, double b, double least, const double* xi, int n) {
         const double c = u + b, ratio = std::exp(-2 * e.p.xx * c * h), ratio2 = ratio * ratio;
         Four power(1, ratio, ratio2, ratio2 * ratio), total = Four::Zero();
         const double by_four = ratio2 * ratio2;
         int i = 0;
         for (; i + 4 <= n; i += 4, power *= by_four)
           total +=
               power * Eigen::Map<const Four>(gauss_.data() + i) * Eigen::Map<const Four>(xi + i);
         double row = total.sum();
         for (int rest = 0; i < n; ++i, ++rest) row += power[rest] * gauss_[i] * xi[i];
         sum += std::exp(-least - e.p.xx * c * c) * row;
       });
  return e.scale * sum;
}

FieldSample VaryingLattice::sample(LatticeNoise& noise, const Vec3& x) {
  const TensorSample at = a_->sample(x);
  const Ellipsoid e(at.value * length2_, x, spacing_);
  const double* normals = window(noise, e.first, e.size);

  // Σ w ξ, Σ w ξ u, Σ w ξ u uᵀ, row by row; the weights follow from two exponentials.
  const SymMat3& p = e.p;
  const double h = spacing_, ratio = std::exp(-2 * p.xx * h * h);
  double sum = 0;
  Vec3 moment;
  SymMat3 second;
  rows(e, x, normals,
       [&](double uy, double uz, double u, double b, double least, const double* xi, int n) {
         double w = std::exp(-least - p.xx * (u + b) * (u + b));
         double growth = std::exp(-p.xx * h * (2 * (u + b) + h));
         double s0 = 0, s1 = 0, s2 = 0;
         for (int i = 0; i < n; ++i, u += h) {
           const double value = w * xi[i];
           s0 += value;
           s1 += value * u;
           s2 += value * u * u;
           w *= growth;
           growth *= ratio;
         }
         sum += s0;
         moment += {s1, uy * s0, uz * s0};
         second = second + SymMat3{s2, uy * uy * s0, uz * uz * s0, uy * s1, uz * s1, uy * uz * s0};
       });
  // d = x - s = -u: ∂_i (-dᵀA⁻¹d) = 2(A⁻¹u)_i + uᵀA⁻¹ ∂_iA A⁻¹u, ∂_i |A|^{-¼} = -¼ tr(A⁻¹∂_iA).
  FieldSample g{e.scale * sum, (p * moment) * (2 * e.scale)};
  const SymMat3 spread = congruence(p.matrix(), second);
  for (int axis = 0; axis < 3; ++axis) {
    const SymMat3 da = at.gradient[axis] * length2_;
    g.gradient[axis] +=
        e.scale * (trace_of_product(da, spread) - 0.25 * trace_of_product(p, da) * sum);
  }
  return g;
}

double VaryingLattice::fourth_derivative_variance(const Vec3& d) const {
  const double inverse = dot(d, d) / (length2_ * a_->eigenvalues().min);
  return 105 * inverse * inverse * inverse * inverse;
}

}  // namespace gpis
