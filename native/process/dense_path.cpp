#include "process/dense_path.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <map>
#include <mutex>
#include <tuple>

#include "core/symmetric_eigen.h"
#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

constexpr double kMaxReach = 64;
constexpr int kHalvings = 8;  // of a rough cell
// Length scales: nearer to what is drawn, a rough path is its cubic, off by 1e-10 standard
// deviations at most.
constexpr double kFinest = 1e-8;

// Covariance of (g, g') at two points, q = x - y: rows x, columns y.
Eigen::Matrix2d block(const Radial& radial, double q) {
  const double a = std::abs(q), slope = q * radial.slope_over_q(a);
  Eigen::Matrix2d b;
  b << radial.value(a), -slope, slope, -radial.curvature(a);
  return b;
}

// The law of the midpoint given value and slope at both ends. What Matérn and Wong leave open falls
// off as h³ and faster, and would cancel in double: long double throughout.
DensePath::Plan::Halving halving(const Radial& radial, double h) {
  using Real = long double;
  const Real points[] = {0, h, Real(h) / 2};
  // κ and its derivatives in long double.
  const auto covariance = [&](Real q, int dx, int dy) -> Real {
    const Real a = std::abs(q), sign = q < 0 ? -1 : 1;
    Real value, slope, curvature;
    const Real r3 = std::sqrt(Real(3)), r5 = std::sqrt(Real(5));
    if (radial.family == Radial::Family::matern32) {
      const Real e = std::exp(-r3 * a);
      value = (1 + r3 * a) * e;
      slope = -3 * a * e;
      curvature = (-3 + 3 * r3 * a) * e;
    } else if (radial.family == Radial::Family::matern52) {
      const Real e = std::exp(-r5 * a);
      value = (1 + r5 * a + 5 * a * a / 3) * e;
      slope = -Real(5) / 3 * a * (1 + r5 * a) * e;
      curvature = (-Real(5) / 3 * (1 + r5 * a) + Real(25) / 3 * a * a) * e;
    } else {
      const Real ea = std::exp(-a / r3), eb = std::exp(-r3 * a);
      value = (3 * ea - eb) / 2;
      slope = r3 / 2 * (eb - ea);
      curvature = (ea - 3 * eb) / 2;
    }
    if (dx + dy == 0) return value;
    if (dx + dy == 2) return -curvature;
    return dx ? sign * slope : -sign * slope;
  };
  Eigen::Matrix<Real, 6, 6> all;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) all(i, j) = covariance(points[i / 2] - points[j / 2], i % 2, j % 2);
  const Eigen::Matrix<Real, 4, 4> ends = all.topLeftCorner<4, 4>();
  const Eigen::Matrix<Real, 2, 4> cross = all.bottomLeftCorner<2, 4>();
  const Eigen::Matrix<Real, 2, 4> mean = ends.fullPivLu().solve(cross.transpose()).transpose();
  const Eigen::Matrix<Real, 2, 2> rest = all.bottomRightCorner<2, 2>() - mean * cross.transpose();
  DensePath::Plan::Halving out;
  out.mean = mean.cast<double>();
  // Value and slope of the midpoint are independent: symmetry.
  out.factor << std::sqrt(std::max(Real(0), rest(0, 0))), 0, 0,
      std::sqrt(std::max(Real(0), rest(1, 1)));
  return out;
}

// Covariance of (g, g') at both ends of an interval.
Eigen::Matrix4d covariance_of_ends(const Radial& radial, double h) {
  Eigen::Matrix4d k;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) k.block<2, 2>(2 * i, 2 * j) = block(radial, (i - j) * h);
  return k;
}

// … and of g at a fraction s of the interval with them.
Eigen::Vector4d covariance_with_ends(const Radial& radial, double h, double s) {
  Eigen::Vector4d c;
  for (int i = 0; i < 2; ++i) c.segment<2>(2 * i) = block(radial, (s - i) * h).row(0).transpose();
  return c;
}

// The weights of (g, g') at both ends in the cubic through them.
Eigen::Vector4d cubic(double h, double s) {
  const double r = 1 - s;
  return {r * r * (r + 3 * s), r * r * s * h, s * s * (s + 3 * r), -r * s * s * h};
}

// A cubic alone makes g'' a twelfth of h²g'''' too small, and as that is correlated with g'', its
// variance h²/2 (SE) too large: 6% close to a start with known slope. The quintic cubic +
// s²r²(α r + β s) that has the mean of g given both ends at s = ¼ and ¾ leaves h⁴/12. Rows α, β.
Eigen::Matrix<double, 2, 4> bend_of_smooth(const Radial& radial, double h) {
  const Eigen::FullPivLU<Eigen::Matrix4d> ends(covariance_of_ends(radial, h));
  Eigen::Matrix2d terms;
  Eigen::Matrix<double, 2, 4> missing;
  for (int i = 0; i < 2; ++i) {
    const double s = i == 0 ? 0.25 : 0.75, r = 1 - s;
    terms.row(i) << s * s * r * r * r, s * s * r * r * s;
    missing.row(i) = ends.solve(covariance_with_ends(radial, h, s)) - cubic(h, s);
  }
  return terms.inverse() * missing;
}

// Standard deviation of g from such a quintic in the middle of an interval, where it is largest.
double rest_in_middle(const Radial& radial, double h, const Eigen::Matrix<double, 2, 4>& bend) {
  const Eigen::Vector4d w = cubic(h, 0.5) + (bend.row(0) + bend.row(1)).transpose() / 32;
  return std::sqrt(std::max(0.0, 1 - 2 * w.dot(covariance_with_ends(radial, h, 0.5)) +
                                     w.dot(covariance_of_ends(radial, h) * w)));
}

// Halves know the ends of their interval alone. For Matérn 5/2, whose state has g'' too, that
// leaves out the covariance of a middle with points outside, once for each of two middles; the
// largest.
double hidden_from_halves(const Radial& radial, double h) {
  const Eigen::Vector4d weights =
      covariance_of_ends(radial, h).fullPivLu().solve(covariance_with_ends(radial, h, 0.5));
  double largest = 0;
  for (double s = 1; s < 40; s += 0.25)
    largest = std::max(largest, std::abs(radial.value((s - 0.5) * h) -
                                         weights.dot(covariance_with_ends(radial, h, s))));
  return largest;
}

}  // namespace

class DenseFactor {
 public:
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  DenseFactor(const Radial& radial, double step, int points)
      : radial_(radial), step_(step), points_(points) {}

  const Matrix& matrix(Counters& counters) {
    std::call_once(once_, [&] {
      Eigen::MatrixXd k(2 * points_, 2 * points_);
      for (int r = 0; r < points_; ++r)
        for (int c = 0; c < points_; ++c)
          k.block<2, 2>(2 * r, 2 * c) = block(radial_, (r - c) * step_);
      const SymmetricEigen eigen(k);
      // Eigenvalues below 1e-14 of the largest are rounding noise of the matrix itself.
      const auto& values = eigen.values;
      const double floor = 1e-14 * values[values.size() - 1];
      Eigen::Index rank = 0;
      while (rank < values.size() && values[values.size() - 1 - rank] > floor) ++rank;
      const Eigen::MatrixXd root =
          eigen.vectors.rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal();
      const Eigen::MatrixXd qr = root.transpose().householderQr().matrixQR();
      matrix_ = qr.triangularView<Eigen::Upper>().transpose();
      ++counters.factorisations;
    });
    return matrix_;
  }

  // Processes of one correlation share it.
  static std::shared_ptr<DenseFactor> shared(const Radial& radial, double step, int points) {
    static std::mutex mutex;
    static std::map<std::tuple<Radial::Family, double, double, int>, std::shared_ptr<DenseFactor>>
        factors;
    std::lock_guard lock(mutex);
    auto& factor = factors[{radial.family, radial.alpha, step, points}];
    if (!factor) factor = std::make_shared<DenseFactor>(radial, step, points);
    return factor;
  }

 private:
  Radial radial_;
  double step_;
  int points_;
  std::once_flag once_;
  Matrix matrix_;
};

DensePath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : line(single_term(process, "The dense sampler")) {
  const Radial& radial = line.radial;
  if (!radial.differentiable())
    refuse("The dense sampler serves correlations with a derivative, not ",
           process.kernel->describe(), ".");
  const double lengths = length(bounds.max - bounds.min) / process.kernel->min_length_scale();
  if (!(lengths <= kMaxReach))
    refuse("The dense sampler serves bounds of up to ", kMaxReach,
           " length scales across, these have ", lengths,
           ": give the process smaller bounds or take sampler 'auto'.");
  if (radial.smooth()) {
    double rest = 0;
    for (step = 0.25;; step /= 2) {
      bend = bend_of_smooth(radial, step);
      rest = rest_in_middle(radial, step, bend);
      if (rest <= 1e-4 || step < 1e-2) break;
    }
    correlation_error = 2 * rest;
    // |p - its cubic| <= max|p''''| h⁴/24 s²(1-s)², and s²(1-s)² <= (B₁+B₂)/12; p'''' is linear.
    const Eigen::Vector4d fourth = (72 * bend.row(0) - 48 * bend.row(1)).transpose();
    power = 4;
    deviation = 4.5 / 288 * std::sqrt(fourth.dot(covariance_of_ends(radial, step) * fourth)) /
                std::pow(step, power);
  } else {
    power = radial.family == Radial::Family::matern52 ? 2.5 : 1.5;
    while (power > 2 && hidden_from_halves(radial, step) > 1e-4) step /= 2;
    const double rest = rest_in_middle(radial, step, bend);
    // (B₁+B₂)(½) = ¾; 5% for what smaller intervals deviate more, relative to h^power.
    deviation = 4.5 * 1.05 * rest / 0.75 / std::pow(step, power);
    for (int i = 0; i < kHalvings; ++i) halvings.push_back(halving(radial, std::ldexp(step, -i)));
    // An integrated Brownian motion of intensity q has slopes of variance q h/16 in the middle.
    const double last = std::ldexp(step, 1 - kHalvings), slope = halvings.back().factor(1, 1);
    if (power < 2) intensity = 16 * slope * slope / last;
    const double finest = deviation / 4.5 * std::pow(last / 2, power);
    correlation_error = power > 2 ? 2 * finest + 2 * hidden_from_halves(radial, step) : 1e-9;
  }
  for (reach = 8; reach < lengths;) reach *= 2;
  factor = DenseFactor::shared(radial, step, static_cast<int>(std::lround(reach / step)) + 2);
}

void DensePath::reset(const Plan& plan, const LineGeometry& line, double anchor, double,
                      Counters& counters) {
  plan_ = &plan;
  counters_ = &counters;
  line_.reset(plan.line, line, anchor);
  step_ = plan.step / line_.inverse_length();
  factor_ = &plan.factor->matrix(counters);
  conditioned_ = false;
  modes_.clear();
  nodes_.clear();
}

void DensePath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  nodes_.assign(1, point(0, rng, counters));
  read(nodes_.front(), g, dg);
}

// By Matheron's rule (math.md §5.1): g(q) += κ(q)Δ₀ - κ'(q)/λ₂ Δ₁.
double DensePath::start(const PathStart& known, Rng& rng, Counters& counters) {
  conditioned_ = false;
  const Node prior = point(0, rng, counters);
  start_value_ = known.value;
  start_slope_ = known.slope_known ? line_.per_length(known.slope) : prior.dg;
  delta_value_ = start_value_ - prior.g;
  delta_slope_ = start_slope_ - prior.dg;
  conditioned_ = true;
  if (known.gradient_known) line_.remember(known.gradient);
  nodes_.assign(1, {0, start_value_, start_slope_});
  return start_slope_ * line_.inverse_length();
}

double DensePath::pull(double t) const {
  if (!conditioned_) return 0;
  const Radial& radial = plan_->line.radial;
  // κ and, beyond its peak at q < 1, -κ' fall.
  const double q = std::max(line_.q(t), 1.0);
  return std::max(0.0, -start_value_) * radial.value(q == 1 ? 0 : q) +
         std::max(0.0, -start_slope_) * std::max(q == 1 ? 0.61 : 0, q * radial.transverse(q));
}

// The joint sample and what the start adds to it at point k.
DensePath::Node DensePath::point(long k, Rng& rng, Counters& counters) {
  const long used = std::min<long>(2 * k + 2, factor_->cols());
  while (static_cast<long>(modes_.size()) < used) {
    modes_.push_back(rng.normal());
    ++counters.line_normals;
  }
  const Eigen::Map<const Eigen::VectorXd> modes(modes_.data(), used);
  Node node{k * plan_->step, factor_->row(2 * k).head(used).dot(modes),
            factor_->row(2 * k + 1).head(used).dot(modes)};
  if (conditioned_) {
    const Radial& radial = plan_->line.radial;
    const double c = radial.transverse(node.t), slope = -plan_->line.lambda2 * node.t * c;
    node.g += radial.value(node.t) * delta_value_ + node.t * c * delta_slope_;
    node.dg += slope * delta_value_ - radial.curvature(node.t) / plan_->line.lambda2 * delta_slope_;
  }
  return node;
}

void DensePath::prepare(long cell, Rng& rng, Counters& counters) {
  const double left = cell * plan_->step;
  if (nodes_.back().t < left) nodes_.push_back(point(cell, rng, counters));
  if (nodes_.back().t < left + plan_->step) nodes_.push_back(point(cell + 1, rng, counters));
}

void DensePath::at(long cell, double t, Rng& rng, double& g, double& dg) {
  const double q = std::clamp(line_.q(t), cell * plan_->step, (cell + 1) * plan_->step);
  auto right = std::upper_bound(nodes_.begin(), nodes_.end(), q,
                                [](double x, const Node& node) { return x < node.t; });
  if ((right - 1)->t == q) return read(*(right - 1), g, dg);
  // A rough path: halve as far as that is tabulated.
  for (double width = right->t - (right - 1)->t; !plan_->halvings.empty();) {
    const auto level = static_cast<std::size_t>(std::lround(std::log2(plan_->step / width)));
    if (level >= plan_->halvings.size()) break;
    const Node &a = *(right - 1), &b = *right;
    const Plan::Halving& by = plan_->halvings[level];
    const Eigen::Vector2d z = by.mean * Eigen::Vector4d(a.g, a.dg, b.g, b.dg) +
                              by.factor * Eigen::Vector2d(rng.normal(), rng.normal());
    counters_->line_normals += 2;
    width /= 2;
    right = nodes_.insert(right, {a.t + width, z[0], z[1]});
    if (right->t == q) return read(*right, g, dg);
    if (right->t < q) ++right;
  }
  const Node &a = *(right - 1), &b = *right;
  if (plan_->intensity > 0 && std::min(q - a.t, b.t - q) > kFinest) {
    const Node node = draw_between(a, b, plan_->intensity, q, rng);
    counters_->line_normals += 2;
    nodes_.insert(right, node);
    return read(node, g, dg);
  }
  read(cubic_between(a, b, q), g, dg);
  if (!plan_->halvings.empty()) return;
  // A smooth path is a quintic: s²r²(α r + β s) on top.
  const double h = b.t - a.t, s = (q - a.t) / h, r = 1 - s;
  const Eigen::Vector2d bend = plan_->bend * Eigen::Vector4d(a.g, a.dg, b.g, b.dg);
  const double top = bend[0] * r + bend[1] * s;
  g += s * s * r * r * top;
  dg += s * r * (2 * (r - s) * top + s * r * (bend[1] - bend[0])) / h * line_.inverse_length();
}

std::unique_ptr<LineSampler> make_dense(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<DensePath, Fields::any>(process, bounds);
}

}  // namespace gpis
