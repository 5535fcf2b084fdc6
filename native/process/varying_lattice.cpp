#include "process/varying_lattice.h"

#include "field/check.h"

namespace gpis {
namespace {

constexpr double kReach2 = 16;  // exp(-16) = 1e-7 is left out
constexpr double kMostNodes = 2e6;

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

const double* VaryingLattice::window(LatticeNoise& noise, const Node& first,
                                     const std::array<int, 3>& size) {
  if (generation_ != noise.generation() || first_ != first || size_ != size) {
    normals_.resize(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
    noise.window(number_, 0, first, size, normals_.data());
    generation_ = noise.generation();
    first_ = first;
    size_ = size;
  }
  return normals_.data();
}

FieldSample VaryingLattice::sample(LatticeNoise& noise, const Vec3& x) {
  const TensorSample at = a_->sample(x);
  const SymMat3 a = at.value * length2_;
  const Cholesky3 factor(a);
  const SymMat3 p = factor.inverse();  // A⁻¹

  // The box about the ellipsoid uᵀA⁻¹u <= kReach2.
  Node first;
  std::array<int, 3> size;
  for (int axis = 0; axis < 3; ++axis) {
    const double reach = std::sqrt(kReach2 * a[axis]);
    first[axis] = static_cast<std::int64_t>(std::ceil((x[axis] - reach) / spacing_));
    size[axis] = static_cast<int>(
        static_cast<std::int64_t>(std::floor((x[axis] + reach) / spacing_)) - first[axis] + 1);
  }
  const double* normals = window(noise, first, size);

  // Σ w ξ, Σ w ξ u, Σ w ξ u uᵀ, row by row; on a row the weights are a Gaussian about u* and follow
  // from two exponentials.
  const double h = spacing_, ratio = std::exp(-2 * p.xx * h * h);
  double sum = 0;
  Vec3 moment;
  SymMat3 second;
  for (int k = 0; k < size[2]; ++k) {
    const double uz = (first[2] + k) * h - x.z;
    for (int j = 0; j < size[1]; ++j, normals += size[0]) {
      const double uy = (first[1] + j) * h - x.y;
      const double b = (p.xy * uy + p.xz * uz) / p.xx;  // -u*
      const double least = p.yy * uy * uy + 2 * p.yz * uy * uz + p.zz * uz * uz - p.xx * b * b;
      if (!(least < kReach2)) continue;
      const double half = std::sqrt((kReach2 - least) / p.xx);
      const int begin = std::max(
          0, static_cast<int>(std::ceil((x.x - b - half) / h - static_cast<double>(first[0]))));
      const int end = std::min(
          size[0] - 1,
          static_cast<int>(std::floor((x.x - b + half) / h - static_cast<double>(first[0]))));
      double u = (first[0] + begin) * h - x.x;
      double w = std::exp(-least - p.xx * (u + b) * (u + b));
      double growth = std::exp(-p.xx * h * (2 * (u + b) + h));
      double s0 = 0, s1 = 0, s2 = 0;
      for (int i = begin; i <= end; ++i, u += h) {
        const double value = w * normals[i];
        s0 += value;
        s1 += value * u;
        s2 += value * u * u;
        w *= growth;
        growth *= ratio;
      }
      sum += s0;
      moment += {s1, uy * s0, uz * s0};
      second = second + SymMat3{s2, uy * uy * s0, uz * uz * s0, uy * s1, uz * s1, uy * uz * s0};
    }
  }
  const double scale =
      std::pow(2 / kPi, 0.75) * std::pow(factor.determinant(), -0.25) * std::pow(h, 1.5);
  // d = x - s = -u: ∂_i (-dᵀA⁻¹d) = 2(A⁻¹u)_i + uᵀA⁻¹ ∂_iA A⁻¹u, ∂_i |A|^{-¼} = -¼ tr(A⁻¹∂_iA).
  FieldSample g{scale * sum, (p * moment) * (2 * scale)};
  const SymMat3 spread = congruence(p.matrix(), second);
  for (int axis = 0; axis < 3; ++axis) {
    const SymMat3 da = at.gradient[axis] * length2_;
    g.gradient[axis] +=
        scale * (trace_of_product(da, spread) - 0.25 * trace_of_product(p, da) * sum);
  }
  return g;
}

double VaryingLattice::fourth_derivative_variance(const Vec3& d) const {
  const double inverse = dot(d, d) / (length2_ * a_->eigenvalues().min);
  return 105 * inverse * inverse * inverse * inverse;
}

}  // namespace gpis
