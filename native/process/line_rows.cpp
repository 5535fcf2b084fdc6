#include "process/line_rows.h"

namespace gpis {
namespace {

// a = L diag Lᵀ with the line last: the rows of L⁻¹ are (1, 0, 0), (-l, 1, 0) and (u, v, 1), so
// that a⁻¹ = i₀ e eᵀ + i₁ m mᵀ + i₂ b bᵀ with these. As Cholesky3, it loses no digits to minors.
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
  SymMat3 inverse() const {
    return {i0 + l * l * i1 + u * u * i2, i1 + v * v * i2, i2,
            -l * i1 + u * v * i2,         u * i2,          v * i2};
  }
};

// A matrix between e, m and b.
struct Between {
  double ee, mm, bb, em, eb, mb;

  Between(const Split& s, const SymMat3& a) {
    ee = a.xx;
    em = a.xy - s.l * a.xx;
    mm = a.yy - s.l * (a.xy + em);
    eb = a.xx * s.u + a.xy * s.v + a.xz;
    const double yb = a.xy * s.u + a.yy * s.v + a.yz;
    mb = yb - s.l * eb;
    bb = s.u * eb + s.v * yb + (a.xz * s.u + a.yz * s.v + a.zz);
  }
};

double trace(const Split& s, const Between& a) {  // of S⁻¹a
  return s.i0 * a.ee + s.i1 * a.mm + s.i2 * a.bb;
}

SymMat3 turned(const Mat3& axes, const SymMat3& a, double factor) {
  const Vec3 &s = axes.row[0], &t = axes.row[1], &n = axes.row[2];
  const Vec3 as = a * s * factor, at = a * t * factor, an = a * n * factor;
  return {dot(s, as), dot(t, at), dot(n, an), dot(s, at), dot(s, an), dot(t, an)};
}

// |A|^¼ and the derivative of its logarithm.
void fill_roots(LinePoint& p) {
  const Split split(p.half_a);
  p.root = 1 / std::sqrt(std::sqrt(0.125 * split.i0 * split.i1 * split.i2));
  p.root_slope = 0.25 * trace(split, Between(split, p.half_slope));
}

constexpr int kChunk = 32;

}  // namespace

void LineRows::Columns::resize(int n) {
  if (static_cast<int>(k.size()) >= n) return;
  for (auto* column : {&k, &by_x, &by_y, &by_both}) column->resize(2 * n);
}

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
  fill_roots(p);
  return p;
}

LinePoint LineRows::at(double t, const LocalPoint& same) const {
  const Vec3& d = axes_.row[2];
  LinePoint p;
  p.t = t;
  p.half_a = turned(axes_, same.a, 0.5);
  p.half_slope = turned(axes_, same.da[0] * d.x + same.da[1] * d.y + same.da[2] * d.z, 0.5);
  fill_roots(p);
  return p;
}

LocalPoint LineRows::local(const LinePoint& p) const {
  LocalPoint out;
  out.x = origin_ + direction_ * p.t;
  out.a = turned(transpose(axes_), p.half_a, 2);
  out.root = p.root;
  return out;
}

void LineRows::lengths(const LinePoint& p, double& inverse_a, double& changes) {
  const Split s(p.half_a);
  const Between a(s, p.half_slope);
  const double ee = s.i0 * a.ee, mm = s.i1 * a.mm, bb = s.i2 * a.bb;
  inverse_a = 0.5 * s.i2;
  changes = ee * ee + mm * mm + bb * bb +
            2 * (s.i0 * s.i1 * a.em * a.em + s.i0 * s.i2 * a.eb * a.eb + s.i1 * s.i2 * a.mb * a.mb);
}

double LineRows::length_scale(const LinePoint& p) const {
  double inverse_a, changes;
  lengths(p, inverse_a, changes);
  return 1 / (speed_ * std::sqrt(inverse_a * covariance_->shortest_inverse2() + 0.125 * changes));
}

double LineRows::plain_length_scale(const LinePoint& p) const {
  double inverse_a, changes;
  lengths(p, inverse_a, changes);
  return 1 / (speed_ * std::sqrt(inverse_a * covariance_->shortest_inverse2()));
}

double LineRows::slope_variance(const LinePoint& p) const {
  double inverse_a, changes;
  lengths(p, inverse_a, changes);
  const Covariance::Profile f = covariance_->profile(0);
  return speed_ * speed_ * (0.125 * changes * f.psi - 2 * inverse_a * f.psi1);
}

void LineRows::truncate(int count) {
  std::size_t points = 0, others = 0;
  rows_.resize(static_cast<std::size_t>(count));
  for (const Row& row : rows_) {
    const auto next = static_cast<std::size_t>(row.index) + 1;
    if (row.kind == Kind::other)
      others = std::max(others, next);
    else if (row.kind != Kind::elsewhere)
      points = std::max(points, next);
  }
  for (auto& numbers : numbers_) numbers.resize(points);
  others_.resize(others);
  columns_end_ = -1;
}

LineRows::Other LineRows::other(const LinePoint& at, const LocalPoint& local,
                                const Functional& what) const {
  const SymMat3 along =
      local.da[0] * what.slope.x + local.da[1] * what.slope.y + local.da[2] * what.slope.z;
  return {at, what.value, axes_ * what.slope, turned(axes_, along, 0.5),
          0.25 * trace_of_product(local.inverse_a, along)};
}

void LineRows::add(const LinePoint* point, const LocalPoint& local, const Functional& what) {
  if (!point) return rows_.push_back({Kind::elsewhere, 0});
  const bool value = is_value(what);
  if (!value && !is_slope(what)) {
    rows_.push_back({Kind::other, static_cast<int>(others_.size())});
    return others_.push_back(other(*point, local, what));
  }
  if (points() == 0 || numbers_[0].back() != point->t) {
    numbers_[0].push_back(point->t);
    numbers_[1].push_back(point->root);
    numbers_[2].push_back(point->root_slope);
    for (int e = 0; e < 6; ++e) {
      numbers_[3 + e].push_back(point->half_a[e]);
      numbers_[9 + e].push_back(point->half_slope[e]);
    }
  }
  rows_.push_back({value ? Kind::value : Kind::slope, points() - 1});
}

void LineRows::add_copy(int row) {
  const Row copied = rows_[static_cast<std::size_t>(row)];
  if (copied.kind == Kind::other) {
    rows_.push_back({Kind::other, static_cast<int>(others_.size())});
    return others_.push_back(others_[static_cast<std::size_t>(copied.index)]);
  }
  const LinePoint point = point_at(copied.index);
  Functional what;
  if (copied.kind == Kind::slope) what = {0, direction_};
  add(&point, {}, what);
}

LinePoint LineRows::point_at(int index) const {
  const auto i = static_cast<std::size_t>(index);
  LinePoint p;
  p.t = numbers_[0][i];
  p.root = numbers_[1][i];
  p.root_slope = numbers_[2][i];
  for (int e = 0; e < 6; ++e) {
    p.half_a[e] = numbers_[3 + e][i];
    p.half_slope[e] = numbers_[9 + e][i];
  }
  return p;
}

LinePoint LineRows::point(int row) const {
  const Row& r = rows_[static_cast<std::size_t>(row)];
  return r.kind == Kind::other ? others_[static_cast<std::size_t>(r.index)].at : point_at(r.index);
}

// C10 with both derivatives along the line: p = c b, c = (x - y) i₂.
void LineRows::columns(const LinePoint& x, int begin, int end) {
  if (columns_end_ < columns_begin_ || columns_of_.t != x.t || columns_begin_ != begin) {
    columns_of_ = x;
    columns_begin_ = columns_end_ = begin;
  }
  columns_.resize(end - begin);
  while (columns_end_ < end) {
    const int first = columns_end_, n = std::min(kChunk, end - first);
    double Q[kChunk], asked[kChunk], psi[kChunk], psi1[kChunk], psi2[kChunk];
    double N[kChunk], nu_x[kChunk], nu_y[kChunk], nu_xy[kChunk], q_x[kChunk], q_y[kChunk],
        q_xy[kChunk];
    const double* y[kNumbers];
    for (int e = 0; e < kNumbers; ++e) y[e] = numbers_[e].data() + first;
    const SymMat3 h = x.half_a, slope = x.half_slope;
    for (int j = 0; j < n; ++j) {
      const Split s({h.xx + y[3][j], h.yy + y[4][j], h.zz + y[5][j], h.xy + y[6][j], h.xz + y[7][j],
                     h.yz + y[8][j]});
      const Between a(s, slope), b(s, {y[9][j], y[10][j], y[11][j], y[12][j], y[13][j], y[14][j]});
      const double r = speed_ * (x.t - y[0][j]), c = r * s.i2;
      Q[j] = r * c;
      N[j] = x.root * y[1][j] * std::sqrt(s.i0 * s.i1 * s.i2);
      const double ee = s.i0 * a.ee, mm = s.i1 * a.mm, bb = s.i2 * a.bb;
      nu_x[j] = x.root_slope - 0.5 * (ee + mm + bb);
      nu_y[j] = y[2][j] - 0.5 * trace(s, b);
      const double eb = s.i0 * a.eb * b.eb, mb = s.i1 * a.mb * b.mb;
      nu_xy[j] = 0.5 * (ee * s.i0 * b.ee + mm * s.i1 * b.mm + bb * s.i2 * b.bb) +
                 s.i0 * s.i1 * a.em * b.em + s.i2 * (eb + mb);
      q_x[j] = c * (2 - c * a.bb);
      q_y[j] = -c * (2 + c * b.bb);
      q_xy[j] = 2 * (c * c * (eb + mb + bb * b.bb) + s.i2 * (c * (a.bb - b.bb) - 1));
    }
    std::copy_n(Q, n, asked);  // an address that others know would cost the loop its vectors
    covariance_->profiles(asked, n, psi, psi1, psi2);
    const int at = first - begin;
    double *k = columns_.k.data() + at, *by_x = columns_.by_x.data() + at,
           *by_y = columns_.by_y.data() + at, *by_both = columns_.by_both.data() + at;
    for (int j = 0; j < n; ++j) {
      k[j] = N[j] * psi[j];
      by_x[j] = N[j] * (nu_x[j] * psi[j] + psi1[j] * q_x[j]);
      by_y[j] = N[j] * (nu_y[j] * psi[j] + psi1[j] * q_y[j]);
      by_both[j] = N[j] * ((nu_x[j] * nu_y[j] + nu_xy[j]) * psi[j] +
                           (nu_x[j] * q_y[j] + nu_y[j] * q_x[j] + q_xy[j]) * psi1[j] +
                           q_x[j] * q_y[j] * psi2[j]);
    }
    columns_end_ = first + n;
  }
}

// C10 with x's derivative along the line.
void LineRows::with(const LinePoint& x, const Other& y, double& of_value, double& of_slope) const {
  const Split s(x.half_a + y.at.half_a);
  const SymMat3 inverse = s.inverse();
  const Between a(s, x.half_slope), b(s, y.half_along);
  const double r = speed_ * (x.t - y.at.t), c = r * s.i2;
  const Vec3 p = Vec3{s.u, s.v, 1} * c;
  const double N = x.root * y.at.root * std::sqrt(s.i0 * s.i1 * s.i2);
  const Covariance::Profile f = covariance_->profile(r * c);
  const Vec3 a_p = x.half_slope * p, b_p = y.half_along * p, u_b = inverse * (y.slope + b_p);
  const double nu_x = x.root_slope - 0.5 * trace(s, a), q_x = c * (2 - c * a.bb);
  const double nu_y = y.root_slope - 0.5 * trace(s, b), q_y = -2 * dot(p, y.slope) - dot(p, b_p);
  const double nu_xy =
      0.5 * (s.i0 * s.i0 * a.ee * b.ee + s.i1 * s.i1 * a.mm * b.mm + s.i2 * s.i2 * a.bb * b.bb) +
      s.i0 * s.i1 * a.em * b.em + s.i0 * s.i2 * a.eb * b.eb + s.i1 * s.i2 * a.mb * b.mb;
  const double q_xy = -2 * (u_b.z - dot(a_p, u_b));
  of_value = N * (y.value * f.psi + nu_y * f.psi + f.psi1 * q_y);
  of_slope = speed_ * N *
             (y.value * (nu_x * f.psi + f.psi1 * q_x) + (nu_x * nu_y + nu_xy) * f.psi +
              (nu_x * q_y + nu_y * q_x + q_xy) * f.psi1 + q_x * q_y * f.psi2);
}

void LineRows::covariances(const LinePoint& x, bool slope, int first, int count, double* out) {
  int begin = points(), end = 0;
  const Row* rows = rows_.data() + first;
  for (int i = 0; i < count; ++i)
    if (rows[i].kind == Kind::value || rows[i].kind == Kind::slope) {
      begin = std::min(begin, rows[i].index);
      end = std::max(end, rows[i].index + 1);
    }
  if (begin < end) columns(x, begin, end);
  const double* with_value = (slope ? columns_.by_x : columns_.k).data();
  const double* with_slope = (slope ? columns_.by_both : columns_.by_y).data();
  const double of_value = slope ? speed_ : 1, of_slope = speed_ * of_value;
  for (int i = 0; i < count; ++i) {
    out[i] = 0;
    if (rows[i].kind == Kind::value) {
      out[i] = of_value * with_value[rows[i].index - begin];
    } else if (rows[i].kind == Kind::slope) {
      out[i] = of_slope * with_slope[rows[i].index - begin];
    } else if (rows[i].kind == Kind::other) {
      double k, dk;
      with(x, others_[static_cast<std::size_t>(rows[i].index)], k, dk);
      out[i] = slope ? dk : k;
    }
  }
}

// Across the line a point sees x as x's functional sees it.
LineRows::Gradient LineRows::gradient(const LinePoint& x, const LocalPoint& same) {
  columns(x, 0, points());
  Gradient out;
  const Other across[2] = {other(x, same, {0, axes_.row[0]}), other(x, same, {0, axes_.row[1]})};
  for (int i = 0; i < points(); ++i) {
    const auto j = static_cast<std::size_t>(i);
    const LinePoint y = point_at(i);
    double by_s[2], by_t[2];
    with(y, across[0], by_s[0], by_s[1]);
    with(y, across[1], by_t[0], by_t[1]);
    const Vec3 value =
        axes_.row[0] * by_s[0] + axes_.row[1] * by_t[0] + axes_.row[2] * columns_.by_x[j];
    const Vec3 slope = axes_.row[0] * by_s[1] + axes_.row[1] * by_t[1] +
                       axes_.row[2] * (columns_.by_both[j] * speed_);
    out.with_value.push_back({columns_.k[j], value.x, value.y, value.z});
    out.with_slope.push_back({columns_.by_y[j] * speed_, slope.x, slope.y, slope.z});
  }
  return out;
}

bool LineRows::cross(const Gradient& of_points, int row, Eigen::Vector4d& out) const {
  const Row& r = rows_[static_cast<std::size_t>(row)];
  if (r.kind != Kind::value && r.kind != Kind::slope) return false;
  out = (r.kind == Kind::value ? of_points.with_value
                               : of_points.with_slope)[static_cast<std::size_t>(r.index)];
  return true;
}

void LineRows::weigh(int first, const std::vector<double>& weights, Weights& out) const {
  const Row* rows = rows_.data() + first;
  const int count = static_cast<int>(weights.size());
  out.first_point = points();
  for (int i = 0; i < count; ++i)
    if (rows[i].kind == Kind::value || rows[i].kind == Kind::slope)
      out.first_point = std::min(out.first_point, rows[i].index);
  out.value.assign(static_cast<std::size_t>(points() - out.first_point), 0);
  out.slope = out.value;
  out.others.clear();
  for (int i = 0; i < count; ++i) {
    const double w = weights[static_cast<std::size_t>(i)];
    if (rows[i].kind == Kind::other) {
      const Other& y = others_[static_cast<std::size_t>(rows[i].index)];
      if (out.others.empty() || out.others.back().at.t != y.at.t)
        out.others.push_back({y.at, 0, {}, {}, 0});
      Other& s = out.others.back();
      s.value += w * y.value;
      s.slope += y.slope * w;
      s.half_along = s.half_along + y.half_along * w;
      s.root_slope += w * y.root_slope;
    } else if (rows[i].kind != Kind::elsewhere) {
      const auto point = static_cast<std::size_t>(rows[i].index - out.first_point);
      if (rows[i].kind == Kind::value)
        out.value[point] = w;
      else
        out.slope[point] = w * speed_;
    }
  }
}

void LineRows::sum(const LinePoint& x, const Weights& weights, double& g, double& dg) {
  const int n = static_cast<int>(weights.value.size());
  columns_end_ = -1;
  columns(x, weights.first_point, weights.first_point + n);
  double slope = 0;
  for (std::size_t j = 0; j < weights.value.size(); ++j) {
    g += weights.value[j] * columns_.k[j] + weights.slope[j] * columns_.by_y[j];
    slope += weights.value[j] * columns_.by_x[j] + weights.slope[j] * columns_.by_both[j];
  }
  dg += speed_ * slope;
  for (const Other& y : weights.others) {
    double k, dk;
    with(x, y, k, dk);
    g += k;
    dg += dk;
  }
}

}  // namespace gpis
