#include "process/covariance.h"

#include "field/check.h"

namespace gpis {
namespace {

// The isotropic length scale of a term, 0 if it has none.
double isotropic_length(const Term& term) {
  const Mat3 inverse_a = transpose(term.whitening) * term.whitening;
  const double s = inverse_a.row[0].x;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (!(std::abs(inverse_a.row[i][j] - (i == j ? s : 0)) <= 1e-12 * s)) return 0;
  return s > 0 && length(term.wave_vector) == 0 ? 1 / std::sqrt(s) : 0;
}

// Where κ has fallen to `correlation` for good.
double reach_of(const Radial& radial, double correlation) {
  double high = 1;
  while (radial.value(high) > correlation) {
    high *= 2;
    if (high > 1e6) return kInfinity;
  }
  double low = high / 2;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (radial.value(middle) > correlation ? low : high) = middle;
  }
  return high;
}

Vec3 to_vec(const Eigen::Vector3d& v) {
  return {v[0], v[1], v[2]};
}
Eigen::Vector3d to_eigen(const Vec3& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

Covariance::Covariance(const GaussianProcess& process)
    : kernel_(process.kernel),
      anisotropy_(process.anisotropy),
      variance_(process.kernel->variance()),
      differentiable_(process.kernel->differentiable()) {
  const auto terms = kernel_->terms();
  if (terms) {
    terms_ = *terms;
    smooth_ = true;
    for (const Term& term : terms_) smooth_ &= term.radial.smooth();
  }
  if (differentiable_) derivative_covariance_ = kernel_->derivative_covariance();
  if (!anisotropy_) {
    for (const Term& term : terms_)
      for (const Vec3& row : term.whitening.row)
        longest_ = std::max(longest_, length(row) > 0 ? 1 / length(row) : kInfinity);
    if (!terms) longest_ = kInfinity;
    return;
  }
  for (const Term& term : terms_) {
    const double l = isotropic_length(term);
    if (l == 0) terms_.clear();
    scales_.push_back({term.radial, term.weight, 1 / (l * l)});
    longest_ = std::max(longest_, l);
  }
  if (terms_.empty())
    refuse(
        "The kernel ", kernel_->describe(),
        " cannot take an anisotropy: that gives length scales and axes at every point, and takes "
        "a kernel of one distance (squared exponential, Matern, rational quadratic, Wong, or "
        "their sums) whose own length_scale is one number, a factor on it.");
  longest_ *= std::sqrt(anisotropy_->eigenvalues().max);
}

LocalPoint Covariance::at(const Vec3& x) const {
  LocalPoint p;
  p.x = x;
  if (!anisotropy_) return p;
  const TensorSample sample = anisotropy_->sample(x);
  const Cholesky3 factor(sample.value);
  p.a = sample.value;
  p.da = sample.gradient;
  p.inverse_a = factor.inverse();
  p.root = std::sqrt(std::sqrt(factor.determinant()));
  return p;
}

template <int derivatives>
Covariance::Profile Covariance::profile(double Q) const {
  Profile sum{0, 0, 0};
  for (const Scale& s : scales_) {
    const double q2 = Q * s.inverse_length2, q = std::sqrt(q2);
    if constexpr (derivatives == 0) {
      sum.psi += s.weight * s.radial.value(q);
    } else {
      double slope_over_q;
      sum.psi += s.weight * s.radial.value_and_slope_over_q(q, slope_over_q);
      sum.psi1 += s.weight * s.inverse_length2 * 0.5 * slope_over_q;
    }
    // Matérn 3/2 and Wong: ψ'' ~ 1/q at 0, where what multiplies it is of order q².
    if constexpr (derivatives > 1)
      if (q2 > 1e-200)
        sum.psi2 += s.weight * s.inverse_length2 * s.inverse_length2 * s.radial.psi2(q2);
  }
  return sum;
}

// For the header.
template Covariance::Profile Covariance::profile<2>(double Q) const;

void Covariance::profiles(const double* Q, int n, double* psi, double* psi1, double* psi2) const {
  if (scales_.size() == 1 && scales_[0].radial.family == Radial::Family::squared_exponential) {
    using Array = Eigen::Map<Eigen::ArrayXd>;
    const double slope = -0.5 * scales_[0].inverse_length2;
    Array(psi, n) = scales_[0].weight * (slope * Eigen::Map<const Eigen::ArrayXd>(Q, n)).exp();
    Array(psi1, n) = slope * Array(psi, n);
    Array(psi2, n) = slope * Array(psi1, n);
    return;
  }
  for (int i = 0; i < n; ++i) {
    const Profile f = profile<2>(Q[i]);
    psi[i] = f.psi;
    psi1[i] = f.psi1;
    psi2[i] = f.psi2;
  }
}

double Covariance::shortest_inverse2() const {
  double largest = 0;
  for (const Scale& s : scales_) largest = std::max(largest, s.inverse_length2);
  return largest;
}

// C10 for one pair: S = (A_x + A_y)/2, r = x - y, p = S⁻¹r, Q = rᵀp, N = |A_x|^¼|A_y|^¼/|S|^½.
struct Covariance::Pair {
  Cholesky3 s;
  Vec3 p;
  double Q, N;

  Pair(const LocalPoint& x, const LocalPoint& y) : s((x.a + y.a) * 0.5) {
    const Vec3 r = x.x - y.x;
    p = s.solve(r);
    Q = std::max(0.0, dot(r, p));
    N = x.root * y.root / std::sqrt(s.determinant());
  }
};

double Covariance::value(const LocalPoint& x, const LocalPoint& y) const {
  if (!anisotropy_) return kernel_->covariance(x.x - y.x);
  const Pair pair(x, y);
  return pair.N * profile<0>(pair.Q).psi;
}

double Covariance::along(const LocalPoint& x, const Vec3& d, const SymMat3& da, const LocalPoint& y,
                         const Functional& of_y, double& slope) const {
  if (!of_y.value_only()) {
    const Eigen::Vector4d c = cross(x, y, of_y);
    slope = dot(d, to_vec(c.tail<3>()));
    return c[0];
  }
  if (!anisotropy_) {
    Vec3 slopes;
    const double k = kernel_->covariance_and_gradient(x.x - y.x, slopes);
    slope = of_y.value * dot(d, slopes);
    return of_y.value * k;
  }
  const Pair pair(x, y);
  const Profile f = profile<1>(pair.Q);
  const double nu = 0.25 * trace_of_product(x.inverse_a - pair.s.inverse(), da);
  const double dQ = 2 * dot(pair.p, d) - 0.5 * dot(pair.p, da * pair.p);
  slope = of_y.value * pair.N * (nu * f.psi + f.psi1 * dQ);
  return of_y.value * pair.N * f.psi;
}

Eigen::Matrix4d Covariance::block(const LocalPoint& x, const LocalPoint& y) const {
  Eigen::Matrix4d b;
  if (!anisotropy_) {
    const Vec3 r = x.x - y.x;
    Vec3 g;
    b(0, 0) = kernel_->covariance_and_gradient(r, g);
    const Mat3 m = kernel_->mixed(r);
    for (int i = 0; i < 3; ++i) {
      b(1 + i, 0) = g[i];
      b(0, 1 + i) = -g[i];
      for (int j = 0; j < 3; ++j) b(1 + i, 1 + j) = m.row[i][j];
    }
    return b;
  }
  const Pair pair(x, y);
  const Profile f = profile<2>(pair.Q);
  const SymMat3 s = pair.s.inverse();
  const Vec3& p = pair.p;
  const SymMat3 of_x = x.inverse_a - s, of_y = y.inverse_a - s;
  const Mat3 sm = s.matrix();
  double nu_x[3], q_x[3], nu_y[3], q_y[3];
  Vec3 s_ap[3], s_bp[3];  // S⁻¹ a_i p, S⁻¹ b_j p
  Mat3 s_a[3];
  for (int i = 0; i < 3; ++i) {
    const Vec3 ap = x.da[i] * p, bp = y.da[i] * p;
    nu_x[i] = 0.25 * trace_of_product(of_x, x.da[i]);
    nu_y[i] = 0.25 * trace_of_product(of_y, y.da[i]);
    q_x[i] = 2 * p[i] - 0.5 * dot(p, ap);
    q_y[i] = -2 * p[i] - 0.5 * dot(p, bp);
    s_ap[i] = s * ap;
    s_bp[i] = s * bp;
    s_a[i] = sm * x.da[i].matrix() * sm;
  }
  b(0, 0) = pair.N * f.psi;
  for (int i = 0; i < 3; ++i) {
    b(1 + i, 0) = pair.N * (nu_x[i] * f.psi + f.psi1 * q_x[i]);
    b(0, 1 + i) = pair.N * (nu_y[i] * f.psi + f.psi1 * q_y[i]);
    for (int j = 0; j < 3; ++j) {
      const double nu_xy = 0.125 * trace_of_product(y.da[j], SymMat3::of(s_a[i]));
      const double q_xy =
          -2 * sm.row[i][j] - s_bp[j][i] + s_ap[i][j] + 0.5 * dot(x.da[i] * p, s_bp[j]);
      b(1 + i, 1 + j) = pair.N * ((nu_x[i] * nu_y[j] + nu_xy) * f.psi +
                                  (nu_x[i] * q_y[j] + nu_y[j] * q_x[i] + q_xy) * f.psi1 +
                                  q_x[i] * q_y[j] * f.psi2);
    }
  }
  return b;
}

Eigen::Vector4d Covariance::cross(const LocalPoint& x, const LocalPoint& y,
                                  const Functional& of_y) const {
  if (!of_y.value_only()) {
    Eigen::Vector4d w;
    w << of_y.value, to_eigen(of_y.slope);
    return block(x, y) * w;
  }
  Eigen::Vector4d c;
  if (!anisotropy_) {
    Vec3 slopes;
    const double k = kernel_->covariance_and_gradient(x.x - y.x, slopes);
    c << k, to_eigen(slopes);
    return c * of_y.value;
  }
  const Pair pair(x, y);
  const Profile f = profile<1>(pair.Q);
  const SymMat3 of_x = x.inverse_a - pair.s.inverse();
  c[0] = f.psi;
  for (int i = 0; i < 3; ++i)
    c[1 + i] = 0.25 * trace_of_product(of_x, x.da[i]) * f.psi +
               f.psi1 * (2 * pair.p[i] - 0.5 * dot(pair.p, x.da[i] * pair.p));
  return c * (pair.N * of_y.value);
}

double Covariance::between(const LocalPoint& x, const Functional& of_x, const LocalPoint& y,
                           const Functional& of_y) const {
  if (of_x.value_only()) {
    if (of_y.value_only()) return of_x.value * of_y.value * value(x, y);
    const Eigen::Vector4d c = cross(y, x, of_x);
    return of_y.value * c[0] + dot(of_y.slope, to_vec(c.tail<3>()));
  }
  const Eigen::Vector4d c = cross(x, y, of_y);
  return of_x.value * c[0] + dot(of_x.slope, to_vec(c.tail<3>()));
}

double Covariance::length_scale(const LocalPoint& x, const Vec3& d) const {
  double inverse2 = 0;  // 1/ℓ_d²
  if (anisotropy_) {
    inverse2 = shortest_inverse2() * dot(d, x.inverse_a * d);
  } else {
    for (const Term& term : terms_) {
      const Vec3 w = term.whitening * d;
      inverse2 = std::max(inverse2, dot(w, w));
    }
    if (terms_.empty())
      inverse2 = dot(d, d) / (kernel_->min_length_scale() * kernel_->min_length_scale());
    // Modulation, of which a length scale says nothing. Matérn 3/2 has slopes of √3 per length.
    if (differentiable_)
      inverse2 =
          std::max(inverse2, dot(d, derivative_covariance_ * d) / variance_ / (smooth_ ? 1 : 3));
  }
  return 1 / std::sqrt(inverse2);
}

double Covariance::reach(double correlation) const {
  double farthest = 0;
  if (terms_.empty()) return kInfinity;
  for (const Term& term : terms_) farthest = std::max(farthest, reach_of(term.radial, correlation));
  return farthest;
}

std::vector<Mat3> Covariance::reach_metrics(double correlation) const {
  std::vector<Mat3> metrics;
  if (anisotropy_) {
    const double inverse = 1 / (reach(correlation) * longest_);
    metrics.push_back({{Vec3{inverse, 0, 0}, Vec3{0, inverse, 0}, Vec3{0, 0, inverse}}});
    return metrics;
  }
  for (const Term& term : terms_) {
    Mat3 m = term.whitening;
    const double reach = reach_of(term.radial, correlation);  // infinite: all is near
    for (Vec3& row : m.row) row = row * (1 / reach);
    metrics.push_back(m);
  }
  return metrics;
}

}  // namespace gpis
