#include "process/realisation_path.h"

#include <Eigen/Eigenvalues>

#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

// Of a symmetric matrix that is singular where the kernel is constant along an axis.
Mat3 pseudo_inverse(const Mat3& m) {
  Eigen::Matrix3d a;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) a(i, j) = m.row[i][j];
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  const double floor = 1e-12 * eigen.eigenvalues()[2];
  Eigen::Vector3d inverse = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > floor) inverse[i] = 1 / eigen.eigenvalues()[i];
  a = eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  Mat3 out;
  for (int i = 0; i < 3; ++i) out.row[i] = {a(i, 0), a(i, 1), a(i, 2)};
  return out;
}

}  // namespace

RealisationPath::Plan::Plan(const GaussianProcess& p, const Box3&)
    : process(std::make_shared<GaussianProcess>(p)), covariance(std::make_shared<Covariance>(p)) {
  if (!covariance->differentiable())
    refuse("The kernel ", p.kernel->describe(),
           " has no gradient: the realisation sampler cannot find its surface.");
}

void RealisationPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double,
                            Counters&) {
  plan_ = &plan;
  line_ = line;
  anchor_ = anchor;
  drawn_ = false;
  pull_ = 0;
  entry_ = own_ = {};
  sign_ = kept_sign_;
  realisation_ = nullptr;
  for (const Pool& entry : pool_)
    if (entry.plan == &plan) realisation_ = entry.realisation.get();
  if (!realisation_) {
    pool_.push_back(
        {&plan, std::make_unique<Realisation>(*plan.process, Realisation::Access::rays)});
    realisation_ = pool_.back().realisation.get();
  }
  counted_ = realisation_->normals();
  // Cells over which the path is off its cubic by .01 (see draw).
  const double expected = realisation_->expected_fourth_derivative(line.direction);
  step_ =
      expected > 0 ? std::pow(0.01 * value_deviation() * 288 / (4.5 * expected), 0.25) : kInfinity;
}

void RealisationPath::draw(Rng& rng, Counters& counters) {
  if (drawn_) return;
  drawn_ = true;
  realisation_->draw(kept_ ? kept_->seed : rng(), plan_->process->time);
  if (kept_) entry_ = kept_->entry;
  realisation_->set_line(line_.origin, line_.direction);
  // The cubic is off by u²(h-u)² |g''''| / 24 <= (4/3)(B₁+B₂) (h/2)⁴ |g''''| / 24; 4.5 standard
  // deviations of g''''.
  deviation_ = 4.5 * realisation_->fourth_derivative() / 288;
  count(counters);
}

void RealisationPath::count(Counters& counters) {
  counters.line_normals += realisation_->normals() - counted_;
  counted_ = realisation_->normals();
}

// G = Cov ∇g at a point (definitions E3).
Mat3 RealisationPath::derivative_covariance(const Vec3& x) const {
  const LocalPoint at = plan_->covariance->at(x);
  const Eigen::Matrix4d block = plan_->covariance->block(at, at);
  Mat3 g;
  for (int i = 0; i < 3; ++i) g.row[i] = {block(1 + i, 1), block(1 + i, 2), block(1 + i, 3)};
  return g;
}

void RealisationPath::slope_law(double, double& mean, double& deviation) const {
  const Vec3& d = line_.direction;
  mean = 0;
  deviation = std::sqrt(dot(d, derivative_covariance(point(anchor_)) * d));
}

void RealisationPath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  draw(rng, counters);
  evaluate(anchor_, g, dg);
  count(counters);
}

double RealisationPath::start(const PathStart& known, Rng& rng, Counters& counters) {
  draw(rng, counters);
  double g, dg;
  evaluate(anchor_, g, dg);
  count(counters);
  if (kept_ && known.gradient_known) {
    dg = known.slope;  // remembered of this very realisation
  } else {
    if (!kept_) {
      own_ = condition(known);
    } else if (!kept_->entry.active) {
      kept_->entry = entry_ = condition(known);
    } else {
      own_ = condition(known);
      ++counters.realisation_moved;
    }
    evaluate(anchor_, g, dg);
  }
  double mean, deviation;
  slope_law(known.value, mean, deviation);
  pull_ = std::max(0.0, -known.value) +
          (deviation > 0 ? 0.61 * std::max(0.0, -dg) * value_deviation() / deviation : 0);
  return dg;
}

// The value and the slopes at one point are independent: the variance is the same everywhere.
RealisationCondition RealisationPath::condition(const PathStart& known) const {
  RealisationCondition out{true, point(anchor_), {0, {}}};
  const FieldSample now = sample(out.at);
  // Of g itself, which a ray inside the body sees reversed.
  out.weight.value = sign_ * (known.value - now.value) / plan_->covariance->variance();
  if (!known.slope_known) return out;
  const Mat3 g = derivative_covariance(out.at);
  if (known.gradient_known) {
    out.weight.slope = pseudo_inverse(g) * (known.gradient - now.gradient) * sign_;
  } else {
    const Vec3& d = line_.direction;
    const double variance = dot(d, g * d);
    if (variance > 0)
      out.weight.slope = d * (sign_ * (known.slope - dot(now.gradient, d)) / variance);
  }
  return out;
}

FieldSample RealisationPath::sample(const Vec3& x) const {
  FieldSample g = realisation_->sample(x);
  entry_.add(*plan_->covariance, x, g);
  own_.add(*plan_->covariance, x, g);
  return {sign_ * g.value, g.gradient * sign_};
}

void RealisationPath::evaluate(double t, double& g, double& dg) {
  realisation_->on_line(t, g, dg);
  FieldSample moved;
  entry_.add(*plan_->covariance, point(t), moved);
  own_.add(*plan_->covariance, point(t), moved);
  g = sign_ * (g + moved.value);
  dg = sign_ * (dg + dot(moved.gradient, line_.direction));
}

PathGradient RealisationPath::gradient(double t, double, double, Rng&) {
  return {sample(point(t)).gradient, {}, {}, 0};
}

std::unique_ptr<LineSampler> make_realisation(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<RealisationPath, Fields::any>(process, bounds);
}

}  // namespace gpis
