#include "process/varying_lattice.h"

#include <Eigen/Core>

#include "field/check.h"

namespace gpis {
namespace {

constexpr double kReach2 = 16;  // exp(-16) = 1e-7 is left out
constexpr int kMargin = 4;

}  // namespace

VaryingLattice::VaryingLattice(TensorFieldPtr a, double length, int number)
    : a_(std::move(a)), length2_(length * length) {
  white_ = {number, 0.5 * std::sqrt(length2_ * a_->eigenvalues().min)};
}

void VaryingLattice::check(const TensorField& a, const Box3& bounds) {
  const Range anywhere = a.eigenvalues();
  const auto ratio = [&](double most) { return std::sqrt(most / anywhere.min); };
  if (ratio(anywhere.max) <= kMostRatio) return;
  const double most = a.eigenvalues(bounds).max;
  if (ratio(most) <= kMostRatio) return;
  refuse("The longest length scale of the anisotropy within the bounds is ", std::sqrt(most), ", ",
         ratio(most), " times the shortest of the whole field, ", std::sqrt(anywhere.min),
         ": a realisation takes a ratio of up to ", kMostRatio,
         ". Let the lengths vary less, or take smaller bounds.");
}

VaryingLattice::View VaryingLattice::window(LatticeNoise& noise, SmoothedNoise& smoothed,
                                            const Ellipsoid& e) {
  if (e.level + 1 >= static_cast<int>(windows_.size())) windows_.resize(e.level + 2);
  Window& w = windows_[e.level + 1];
  bool within = w.generation == noise.generation();
  for (int a = 0; a < 3; ++a)
    within &= w.first[a] <= e.first[a] && e.first[a] + e.size[a] <= w.first[a] + w.size[a];
  if (!within) {
    for (int a = 0; a < 3; ++a) {
      w.first[a] = e.first[a] - kMargin;
      w.size[a] = e.size[a] + 2 * kMargin;
    }
    const std::size_t nodes = static_cast<std::size_t>(w.size[0]) * w.size[1] * w.size[2];
    w.noise.resize(nodes + 3);  // the last row of a reused window is read in fours
    if (e.level < 0) {
      normals_.resize(nodes);
      noise.window(white_.number, 0, w.first, w.size, normals_.data());
      std::copy(normals_.begin(), normals_.end(), w.noise.begin());
    } else {
      smoothed.window(noise, white_, e.level, w.first, w.size, w.noise.data());
    }
    w.generation = noise.generation();
  }
  const std::ptrdiff_t row = w.size[0], slice = row * w.size[1];
  return {w.noise.data() + (e.first[2] - w.first[2]) * slice + (e.first[1] - w.first[1]) * row +
              e.first[0] - w.first[0],
          row, slice};
}

// The coarsest level with T >= 2S along every axis, T = A/2; level 0 anywhere.
VaryingLattice::Ellipsoid::Ellipsoid(const SymMat3& a, const SmoothedNoise::White& white,
                                     const Vec3& x, bool smoothed)
    : level(smoothed ? 0 : -1) {
  const auto serves = [&](int next) {
    const SymMat3 rest = a - SymMat3::identity(4 * SmoothedNoise::variance(white, next));
    return rest.xx > 0 && Cholesky3(rest).positive;
  };
  while (smoothed && serves(level + 1)) ++level;
  h = smoothed ? SmoothedNoise::spacing(white, level) : white.spacing;
  const SymMat3 m = smoothed ? a - SymMat3::identity(2 * SmoothedNoise::variance(white, level)) : a;
  const Cholesky3 of_a(a), of_m(m);
  inverse_a = of_a.inverse();
  p = of_m.inverse();
  for (int axis = 0; axis < 3; ++axis) {
    const double reach = std::sqrt(kReach2 * m[axis]);
    first[axis] = static_cast<std::int64_t>(std::ceil((x[axis] - reach) / h));
    size[axis] = static_cast<int>(static_cast<std::int64_t>(std::floor((x[axis] + reach) / h)) -
                                  first[axis] + 1);
  }
  scale = std::pow(2 / kPi, 0.75) * std::pow(of_a.determinant(), 0.25) /
          std::sqrt(of_m.determinant()) * (smoothed ? h * h * h : std::pow(h, 1.5));
}

// On a row the weights are a Gaussian about u* = -b: exp(-least - p.xx (u + b)²).
template <class Visit>
void VaryingLattice::rows(const Ellipsoid& e, const Vec3& x, const View& view, const Visit& visit) {
  const double h = e.h, of_x = 1 / e.p.xx, per_h = 1 / h;
  const SymMat3& p = e.p;
  const Vec3 corner{e.first[0] * h - x.x, e.first[1] * h - x.y, e.first[2] * h - x.z};
  for (int k = 0; k < e.size[2]; ++k) {
    const double uz = corner.z + k * h;
    for (int j = 0; j < e.size[1]; ++j) {
      const double uy = corner.y + j * h;
      const double b = (p.xy * uy + p.xz * uz) * of_x;
      const double least = p.yy * uy * uy + 2 * p.yz * uy * uz + p.zz * uz * uz - p.xx * b * b;
      if (!(least < kReach2)) continue;
      // Nodes from -b - half to -b + half; conversions to int round towards zero.
      const double half = std::sqrt((kReach2 - least) * of_x) * per_h,
                   middle = -(b + corner.x) * per_h;
      if (middle + half < 0) continue;
      const int begin = middle > half ? static_cast<int>(middle - half) + 1 : 0;
      const int end = std::min(e.size[0] - 1, static_cast<int>(middle + half));
      if (begin > end) continue;
      visit(Row{corner.x + begin * h, uy, uz, b, least,
                view.noise + k * view.slice + j * view.row + begin, end - begin + 1});
    }
  }
}

// Weights of a row as const · exp(-p.xx (ih)²) · exp(-2 p.xx c h)^i from its first node at c: the
// first factor is the same in all rows, the powers of the last go four by four, in single precision
// (up to e^70, times as little; what is read behind a row is multiplied by next to nothing).
double VaryingLattice::value(LatticeNoise& noise, SmoothedNoise& smoothed, const Vec3& x) {
  using Four = Eigen::Array<float, 4, 1>;
  const Ellipsoid e(a_->value(x) * length2_, white_, x, true);
  const View view = window(noise, smoothed, e);
  const double h = e.h, rate = e.p.xx * h * h;
  gauss_.resize(e.size[0] + 4);
  for (int i = 0; i < e.size[0] + 4; ++i) {
    const double weight = std::exp(-rate * i * i);
    gauss_[i] = weight > 1e-37 ? static_cast<float>(weight) : 0;  // no slow denormal ones
  }
  rows_.clear();
  rows(e, x, view, [&](const Row& row) { rows_.push_back(row); });
  const auto count = static_cast<Eigen::Index>(rows_.size());
  if (first_weight_.size() < count) {
    first_weight_.resize(2 * count);
    ratio_.resize(2 * count);
  }
  for (Eigen::Index r = 0; r < count; ++r) {
    const Row& row = rows_[r];
    const double c = row.x + row.b;
    first_weight_[r] = -row.least - e.p.xx * c * c;
    ratio_[r] = -2 * e.p.xx * c * h;
  }
  first_weight_.head(count) = first_weight_.head(count).exp();  // many at once
  ratio_.head(count) = ratio_.head(count).exp();
  Four sum = Four::Zero();
  for (Eigen::Index r = 0; r < count; ++r) {
    const Row& row = rows_[r];
    const auto ratio = static_cast<float>(ratio_[r]), ratio2 = ratio * ratio;
    Four power(1, ratio, ratio2, ratio2 * ratio), along = Four::Zero();
    const float by_four = ratio2 * ratio2;
    for (int i = 0; i < row.n; i += 4, power *= by_four)
      along +=
          power * Eigen::Map<const Four>(gauss_.data() + i) * Eigen::Map<const Four>(row.noise + i);
    sum += static_cast<float>(first_weight_[r]) * along;
  }
  return e.scale * static_cast<double>(sum.sum());
}

FieldSample VaryingLattice::sample(LatticeNoise& noise, SmoothedNoise& smoothed, const Vec3& x) {
  const TensorSample at = a_->sample(x);
  const Ellipsoid e(at.value * length2_, white_, x, false);
  const View view = window(noise, smoothed, e);

  // Σ w ξ, Σ w ξ u, Σ w ξ u uᵀ, row by row; the weights follow from two exponentials.
  const SymMat3& p = e.p;
  const double h = e.h, ratio = std::exp(-2 * p.xx * h * h);
  double sum = 0;
  Vec3 moment;
  SymMat3 second;
  rows(e, x, view, [&](const Row& row) {
    double u = row.x, w = std::exp(-row.least - p.xx * (u + row.b) * (u + row.b));
    double growth = std::exp(-p.xx * h * (2 * (u + row.b) + h));
    double s0 = 0, s1 = 0, s2 = 0;
    for (int i = 0; i < row.n; ++i, u += h) {
      const double value = w * row.noise[i];
      s0 += value;
      s1 += value * u;
      s2 += value * u * u;
      w *= growth;
      growth *= ratio;
    }
    sum += s0;
    moment += {s1, row.y * s0, row.z * s0};
    second = second + SymMat3{s2,         row.y * row.y * s0, row.z * row.z * s0,
                              row.y * s1, row.z * s1,         row.y * row.z * s0};
  });
  // u = s - x: ∂_i (-uᵀM⁻¹u) = 2(M⁻¹u)_i + uᵀM⁻¹ ∂_iA M⁻¹u; ∂_i log |A|^¼|M|^{-½} =
  // ¼ tr(A⁻¹∂_iA) - ½ tr(M⁻¹∂_iA).
  FieldSample g{e.scale * sum, (p * moment) * (2 * e.scale)};
  const SymMat3 spread = congruence(p.matrix(), second);
  for (int axis = 0; axis < 3; ++axis) {
    const SymMat3 da = at.gradient[axis] * length2_;
    g.gradient[axis] +=
        e.scale *
        (trace_of_product(da, spread) +
         (0.25 * trace_of_product(e.inverse_a, da) - 0.5 * trace_of_product(p, da)) * sum);
  }
  return g;
}

double VaryingLattice::fourth_derivative_variance(const Vec3& d) const {
  const double inverse = dot(d, d) / (length2_ * a_->eigenvalues().min);
  return 105 * inverse * inverse * inverse * inverse;
}

}  // namespace gpis
