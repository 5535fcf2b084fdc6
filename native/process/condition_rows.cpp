#include "process/condition_rows.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "core/symmetric_eigen.h"
#include "field/check.h"
#include "process/conditions.h"

namespace gpis {
namespace {

constexpr int kLeafPoints = 8;

// In directions in which g is constant the gradient is that of the mean.
void check_gradient(const GaussianProcess& process, const Covariance& covariance, std::size_t i,
                    const LocalPoint& at, const std::array<Functional, 3>& what, const Vec3& asked,
                    const Vec3& of_mean) {
  constexpr double kConstant = 1e-14, kSame = 1e-6;
  const auto between = [&](int a, int b) { return covariance.between(at, what[a], at, what[b]); };
  const SymmetricEigen3 eigen(
      {between(0, 0), between(1, 1), between(2, 2), between(0, 1), between(0, 2), between(1, 2)});
  for (int k = 0; k < 3; ++k) {
    const Vec3& d = eigen.vectors[k];
    if (eigen.values[k] > kConstant * eigen.values[2]) continue;
    if (std::abs(dot(asked - of_mean, d)) <= kSame * (length(asked) + length(of_mean))) continue;
    refuse("conditions.points[", i, "] at ", at.x, " asks for a slope of ", dot(asked, d),
           " along ", d, ", where ", process.kernel->describe(), " is constant and the mean has ",
           dot(of_mean, d),
           ". Give a normal and a slope that agree with it there, or the kernel a finite length "
           "scale.");
  }
}

}  // namespace

ConditionRows::ConditionRows(const GaussianProcess& process, const Covariance& covariance)
    : metrics_(covariance.reach_metrics(kNegligible)) {
  if (!covariance.differentiable())
    refuse("Conditions take a differentiable kernel, not ", process.kernel->describe(), ".");
  for (const Mat3& m : metrics_) {
    const Mat3 square = transpose(m) * m;
    const double least = eigenvalues_of({square.row[0].x, square.row[1].y, square.row[2].z,
                                         square.row[0].y, square.row[0].z, square.row[1].z})[0];
    // Of a metric that flattens an axis it is rounding.
    least_stretch_ = std::min(least_stretch_, 0.999 * std::sqrt(std::max(0.0, least)));
  }
  const auto& points = process.conditions->points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Conditions::Point& p = points[i];
    first_row_.push_back(static_cast<int>(rows_.size()));
    const FieldSample mean = process.mean->sample(p.at), sigma = process.sigma->sample(p.at);
    if (!(sigma.value > 0))
      refuse("conditions.points[", i, "] at ", p.at,
             " lies where sigma is 0: the surface is certain there. Leave the point out, or give "
             "sigma a value there.");
    const LocalPoint at = covariance.at(p.at);
    const int row = static_cast<int>(i);
    if (p.value) {
      const double noise = p.noise / sigma.value;
      rows_.push_back({at, {}, (*p.value - mean.value) / sigma.value, noise * noise, row});
    }
    // ∂_j f = ∂_j μ + g ∂_j σ + σ ∂_j g (math.md §2).
    if (!p.gradient) continue;
    std::array<Functional, 3> what;
    for (int j = 0; j < 3; ++j) {
      what[j].value = sigma.gradient[j] / sigma.value;
      what[j].slope[j] = 1;
      rows_.push_back({at, what[j], ((*p.gradient)[j] - mean.gradient[j]) / sigma.value, 0, row});
    }
    check_gradient(process, covariance, i, at, what, *p.gradient, mean.gradient);
  }
  first_row_.push_back(static_cast<int>(rows_.size()));
  order_.resize(points.size());
  std::iota(order_.begin(), order_.end(), 0);
  build(0, static_cast<int>(points.size()));
}

int ConditionRows::build(int first, int last) {
  Box3 box;
  for (int i = first; i < last; ++i) box.include(point(order_[i]));
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back({(box.min + box.max) * 0.5, (box.max - box.min) * 0.5, first, last});
  if (last - first <= kLeafPoints) return index;
  int axis = 0;
  const Vec3 half = nodes_[index].half;
  for (int k = 1; k < 3; ++k)
    if (half[k] > half[axis]) axis = k;
  const int middle = (first + last) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) { return point(a)[axis] < point(b)[axis]; });
  const int left = build(first, middle), right = build(middle, last);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

double ConditionRows::distance(const Vec3& x, const Vec3& y) const {
  double least = metrics_.empty() ? 0 : kInfinity;
  for (const Mat3& m : metrics_) least = std::min(least, length(m * (x - y)));
  return least;
}

double ConditionRows::distance_at_least(const Vec3& x, const Box3& box) const {
  if (metrics_.empty()) return 0;
  Vec3 away = x;
  for (int k = 0; k < 3; ++k) away[k] -= std::clamp(x[k], box.min[k], box.max[k]);
  return least_stretch_ * length(away);
}

// Each coordinate in turn: a convex problem of three variables, solved to its first digits, which
// is all that it is asked for.
double ConditionRows::distance(const Vec3& x, const Box3& box) const {
  double least = metrics_.empty() ? 0 : kInfinity;
  for (const Mat3& m : metrics_) {
    Vec3 y;
    for (int k = 0; k < 3; ++k) y[k] = std::clamp(x[k], box.min[k], box.max[k]);
    for (int sweep = 0; sweep < 12; ++sweep)
      for (int k = 0; k < 3; ++k) {
        const Vec3 column{m.row[0][k], m.row[1][k], m.row[2][k]};
        const double c2 = dot(column, column);
        if (c2 > 0) y[k] = std::clamp(y[k] + dot(column, m * (x - y)) / c2, box.min[k], box.max[k]);
      }
    least = std::min(least, length(m * (x - y)));
  }
  return least;
}

bool ConditionRows::ball_near(const Vec3& centre, const Vec3& half, const LineGeometry& line,
                              double t_begin, double t_end) const {
  if (metrics_.empty()) return true;
  for (const Mat3& m : metrics_) {
    // All of the box lies in a ball about its centre.
    double radius = 0;
    for (int k = 0; k < 3; ++k)
      radius += half[k] * length(Vec3{m.row[0][k], m.row[1][k], m.row[2][k]});
    const Vec3 o = m * (line.origin - centre), d = m * line.direction;
    const double speed2 = dot(d, d);
    const double t = speed2 > 0 ? std::clamp(-dot(o, d) / speed2, t_begin, t_end) : 0;
    if (length(o + d * t) <= 1 + radius) return true;
  }
  return false;
}

bool ConditionRows::near(int node, const LineGeometry& line, double t_begin, double t_end) const {
  const Node& n = nodes_[node];
  if (!ball_near(n.centre, n.half, line, t_begin, t_end)) return false;
  if (n.left >= 0) return near(n.left, line, t_begin, t_end) || near(n.right, line, t_begin, t_end);
  for (int i = n.first; i < n.last; ++i)
    if (ball_near(point(order_[i]), {}, line, t_begin, t_end)) return true;
  return false;
}

bool ConditionRows::near(const LineGeometry& line, double t_begin, double t_end) const {
  return near(0, line, t_begin, t_end);
}

}  // namespace gpis
