#include "process/line_rows.h"

namespace gpis {
namespace {

// a = L diag(d) Lᵀ with the line last: rows of L⁻¹ are (1, 0, 0), (-l, 1, 0) and (u, v, 1), so that
// a⁻¹ = i₀ e₁e₁ᵀ + i₁ (-l,1,0)(-l,1,0)ᵀ + i₂ (u,v,1)(u,v,1)ᵀ. As Cholesky3, in which it loses no
// digits to minors.
struct Split {
  double l, u, v, i0, i1, i2;

  explicit Split(const SymMat3& a) {
    i0 = 1 / a.xx;
    l = a.xy * i0;
    const double l20 = a.xz * i0, e = a.yz - l20 * a.xy;
    i1 = 1 / (a.yy - l * a.xy);
    v = -e * i1;
    u = -l * v - l20;
    i2 = 1 / (a.zz - l20 * a.xz + v * e);
  }
  // bᵀ m b of the last row.
  double along(const SymMat3& m) const {
    return m.zz + u * (m.xx * u + 2 * (m.xz + m.xy * v)) + v * (m.yy * v + 2 * m.yz);
  }
  // tr(a⁻¹ m), given that.
  double trace(const SymMat3& m, double along) const {
    return i2 * along + i1 * (l * (l * m.xx - 2 * m.xy) + m.yy) + i0 * m.xx;
  }
  SymMat3 inverse() const {
    return {i0 + l * l * i1 + u * u * i2, i1 + v * v * i2, i2,
            -l * i1 + u * v * i2,         u * i2,          v * i2};
  }
};

SymMat3 turned(const Mat3& axes, const SymMat3& a, double factor) {
  const Vec3 &s = axes.row[0], &t = axes.row[1], &n = axes.row[2];
  const Vec3 as = a * s * factor, at = a * t * factor, an = a * n * factor;
  return {dot(s, as), dot(t, at), dot(n, an), dot(s, at), dot(s, an), dot(t, an)};
}

}  // namespace

void LineRows::reset(const Covariance& covariance, const LineGeometry& line) {
  covariance_ = &covariance;
  origin_ = line.origin;
  direction_ = line.direction;
  speed_ = length(direction_);
  const Frame frame(direction_ / speed_);
  axes_ = {{frame.s, frame.t, frame.n}};
  truncate(0);
}

LinePoint LineRows::at(double t, double side) const {
  const TensorSlope a = covariance_->anisotropy()->along(origin_, direction_, t, side);
  LinePoint p;
  p.t = t;
  p.half_a = turned(axes_, a.value, 0.5);
  p.half_slope = turned(axes_, a.slope, 0.5 / speed_);
  const Split split(p.half_a);
  p.root = 1 / std::sqrt(std::sqrt(0.125 * split.i0 * split.i1 * split.i2));
  p.root_slope = 0.25 * split.trace(p.half_slope, split.along(p.half_slope));
  return p;
}

double LineRows::length_scale(const LinePoint& p) const {
  const Split split(p.half_a);
  const Mat3 m = split.inverse().matrix() * p.half_slope.matrix(), mt = transpose(m);
  const double squares =
      dot(m.row[0], mt.row[0]) + dot(m.row[1], mt.row[1]) + dot(m.row[2], mt.row[2]);
  const double inverse2 = 0.5 * split.i2 * covariance_->shortest_inverse2() + 0.125 * squares;
  return 1 / (speed_ * std::sqrt(inverse2));
}

void LineRows::truncate(int count) {
  const auto n = static_cast<std::size_t>(count);
  t_.resize(n);
  root_.resize(n);
  for (auto& a : a_) a.resize(n);
  while (!slopes_.empty() && slopes_.back().row >= count) slopes_.pop_back();
}

void LineRows::push(const LinePoint& p, double root) {
  t_.push_back(p.t);
  root_.push_back(root);
  for (int e = 0; e < 6; ++e) a_[e].push_back(p.half_a[e]);
}

void LineRows::add(const LinePoint* point, const LocalPoint& local, const Functional& what) {
  if (!point) {
    LinePoint nowhere;
    nowhere.half_a = SymMat3::identity();
    return push(nowhere, 0);
  }
  if (what.value_only() && what.value == 1) return push(*point, point->root);
  const SymMat3 along =
      local.da[0] * what.slope.x + local.da[1] * what.slope.y + local.da[2] * what.slope.z;
  slopes_.push_back({count(), *point, what.value, axes_ * what.slope, turned(axes_, along, 0.5),
                     0.25 * trace_of_product(local.inverse_a, along)});
  push(*point, 0);
}

LinePoint LineRows::point(int row) const {
  for (const Slopes& s : slopes_)
    if (s.row == row) return s.at;
  const auto i = static_cast<std::size_t>(row);
  LinePoint p;
  p.t = t_[i];
  p.root = root_[i];
  for (int e = 0; e < 6; ++e) p.half_a[e] = a_[e][i];
  return p;
}

LocalPoint LineRows::local(const LinePoint& p) const {
  LocalPoint out;
  out.x = origin_ + direction_ * p.t;
  out.a = turned(transpose(axes_), p.half_a, 2);
  out.root = p.root;
  return out;
}

void LineRows::add_copy(int row) {
  const auto i = static_cast<std::size_t>(row);
  for (const Slopes& s : slopes_)
    if (s.row == row) {
      Slopes copy = s;
      copy.row = count();
      slopes_.push_back(copy);
      break;
    }
  t_.push_back(t_[i]);
  root_.push_back(root_[i]);
  for (auto& a : a_) a.push_back(a[i]);
}

template <bool with_slope>
void LineRows::chunk(const LinePoint& x, int first, int n, double* of_value,
                     double* of_slope) const {
  Chunk Q{}, N, nu, Qx, psi, psi1;
  const double *t = t_.data() + first, *root = root_.data() + first;
  const double* a[6];
  for (int e = 0; e < 6; ++e) a[e] = a_[e].data() + first;
  const SymMat3 &h = x.half_a, m = x.half_slope;
  for (int j = 0; j < n; ++j) {
    const Split s({h.xx + a[0][j], h.yy + a[1][j], h.zz + a[2][j], h.xy + a[3][j], h.xz + a[4][j],
                   h.yz + a[5][j]});
    const double r = speed_ * (x.t - t[j]), p = r * s.i2;
    Q[j] = r * p;
    N[j] = x.root * root[j] * std::sqrt(s.i0 * s.i1 * s.i2);
    if constexpr (with_slope) {
      const double along = s.along(m);
      nu[j] = x.root_slope - 0.5 * s.trace(m, along);
      Qx[j] = p * (2 - p * along);
    }
  }
  if constexpr (with_slope) {
    covariance_->profiles(Q.data(), n, psi.data(), psi1.data());
    for (int j = 0; j < n; ++j) {
      of_value[j] = N[j] * psi[j];
      of_slope[j] = speed_ * N[j] * (nu[j] * psi[j] + psi1[j] * Qx[j]);
    }
  } else {
    covariance_->profiles(Q.data(), n, psi.data(), nullptr);
    for (int j = 0; j < n; ++j) of_value[j] = N[j] * psi[j];
  }
}

// C10 with x's derivative along the line; S⁻¹ is applied where needed.
void LineRows::with(const LinePoint& x, const Slopes& y, double& of_value, double& of_slope) const {
  const Split s(x.half_a + y.at.half_a);
  const SymMat3 inverse = s.inverse();
  const double r = speed_ * (x.t - y.at.t), along = s.along(x.half_slope);
  const Vec3 p = Vec3{s.u, s.v, 1} * (r * s.i2);
  const double N = x.root * y.at.root * std::sqrt(s.i0 * s.i1 * s.i2);
  const Covariance::Profile f = covariance_->profile(r * p.z);
  const Vec3 a_p = x.half_slope * p, b_p = y.half_along * p, u_b = inverse * (y.slope + b_p);
  const double nu_x = x.root_slope - 0.5 * s.trace(x.half_slope, along);
  const double q_x = p.z * (2 - r * s.i2 * along);
  const double nu_y = y.root_slope - 0.5 * trace_of_product(inverse, y.half_along);
  const double q_y = -2 * dot(p, y.slope) - dot(p, b_p);
  const Mat3 sa = inverse.matrix() * x.half_slope.matrix();
  const Mat3 sb = transpose(inverse.matrix() * y.half_along.matrix());
  const double nu_xy =
      0.5 * (dot(sa.row[0], sb.row[0]) + dot(sa.row[1], sb.row[1]) + dot(sa.row[2], sb.row[2]));
  const double q_xy = -2 * (u_b.z - dot(a_p, u_b));
  of_value = N * (y.value * f.psi + nu_y * f.psi + f.psi1 * q_y);
  of_slope = speed_ * N *
             (y.value * (nu_x * f.psi + f.psi1 * q_x) + (nu_x * nu_y + nu_xy) * f.psi +
              (nu_x * q_y + nu_y * q_x + q_xy) * f.psi1 + q_x * q_y * f.psi2);
}

void LineRows::covariances(const LinePoint& x, int first, int count, double* of_value) const {
  for (int i = 0; i < count; i += kChunk)
    chunk<false>(x, first + i, std::min(kChunk, count - i), of_value + i, nullptr);
  double unused;
  for (const Slopes& y : slopes_)
    if (y.row >= first && y.row < first + count) with(x, y, of_value[y.row - first], unused);
}

void LineRows::covariances(const LinePoint& x, int first, int count, double* of_value,
                           double* of_slope) const {
  for (int i = 0; i < count; i += kChunk)
    chunk<true>(x, first + i, std::min(kChunk, count - i), of_value + i, of_slope + i);
  for (const Slopes& y : slopes_)
    if (y.row >= first && y.row < first + count)
      with(x, y, of_value[y.row - first], of_slope[y.row - first]);
}

std::vector<LineRows::Slopes> LineRows::weighted(int first,
                                                 const std::vector<double>& weights) const {
  std::vector<Slopes> out;
  const int end = first + static_cast<int>(weights.size());
  for (const Slopes& y : slopes_) {
    if (y.row < first || y.row >= end) continue;
    const double w = weights[static_cast<std::size_t>(y.row - first)];
    if (out.empty() || out.back().at.t != y.at.t) out.push_back({y.row, y.at, 0, {}, {}, 0});
    Slopes& s = out.back();
    s.value += w * y.value;
    s.slope += y.slope * w;
    s.half_along = s.half_along + y.half_along * w;
    s.root_slope += w * y.root_slope;
  }
  return out;
}

void LineRows::sum(const LinePoint& x, int first, const std::vector<double>& weights,
                   const std::vector<Slopes>& slopes, double& g, double& dg) const {
  Chunk value, slope;
  const int count = static_cast<int>(weights.size());
  for (int i = 0; i < count; i += kChunk) {
    const int n = std::min(kChunk, count - i);
    chunk<true>(x, first + i, n, value.data(), slope.data());
    for (int j = 0; j < n; ++j) {
      g += weights[static_cast<std::size_t>(i + j)] * value[j];
      dg += weights[static_cast<std::size_t>(i + j)] * slope[j];
    }
  }
  for (const Slopes& y : slopes) {
    double k, dk;
    with(x, y, k, dk);
    g += k;
    dg += dk;
  }
}

}  // namespace gpis
