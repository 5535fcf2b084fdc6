#include "process/realisation_path.h"

#include "core/symmetric_eigen.h"
#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

constexpr double kNear = 0.01;  // see near_start_reach: lattices have steps of 1e-7

// Of a symmetric matrix that is singular where the kernel is constant along an axis, or conditions
// leave no freedom.
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& matrix) {
  // Values and slopes have units of their own.
  const Eigen::VectorXd unit =
      matrix.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 1.0; });
  const SymmetricEigen eigen(unit.asDiagonal() * matrix * unit.asDiagonal());
  const double floor = 1e-12 * eigen.values.maxCoeff();
  const Eigen::VectorXd inverse =
      eigen.values.unaryExpr([&](double v) { return v > floor ? 1 / v : 0.0; });
  return unit.asDiagonal() * eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose() *
         unit.asDiagonal();
}

Eigen::Vector4d row(double value, const Vec3& slope) {
  return {value, slope.x, slope.y, slope.z};
}

}  // namespace

RealisationPath::Plan::Plan(const GaussianProcess& p, const Box3& bounds)
    : process(std::make_shared<GaussianProcess>(p)), covariance(std::make_shared<Covariance>(p)) {
  if (!covariance->differentiable())
    refuse("The kernel ", p.kernel->describe(),
           " has no gradient: the realisation sampler cannot find its surface.");
  Realisation::check(p, bounds);
  posterior = posterior_of(p);
  correlation_error = Realisation(p, Realisation::Access::rays, nullptr).correlation_error();
}

void RealisationPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double,
                            Counters&) {
  plan_ = &plan;
  line_ = line;
  anchor_ = anchor;
  drawn_ = false;
  near_.forget();
  pull_ = plan.pull();
  entry_ = own_ = {};
  sign_ = kept_sign_;
  realisation_ = nullptr;
  for (const Pool& entry : pool_)
    if (entry.plan == &plan) realisation_ = entry.realisation.get();
  if (!realisation_) {
    pool_.push_back({&plan, std::make_unique<Realisation>(*plan.process, Realisation::Access::rays,
                                                          plan.posterior)});
    realisation_ = pool_.back().realisation.get();
  }
  counted_ = realisation_->normals();
  const LocalPoint at = plan.covariance->at(point(anchor));
  if (plan.posterior) {
    plan.posterior->law(at, mean_, law_);
    law_(0, 0) = std::max(0.0, law_(0, 0));
  } else {
    mean_.setZero();
    law_ = plan.covariance->block(at, at);
  }
  // What conditions add has a norm below theirs and that of what is drawn there.
  added_norm_ = plan.posterior ? plan.pull() + 4.5 + std::sqrt(plan.posterior->most_rows()) : 0;
  // Cells over which the path is off its cubic by .01 (see draw).
  const double expected = realisation_->expected_fourth_derivative(line.direction),
               deviation = std::sqrt(plan.covariance->variance());
  step_ = expected > 0 ? std::pow(0.01 * deviation * 288 / ((4.5 + added_norm_) * expected), 0.25)
                       : kInfinity;
}

void RealisationPath::draw(Rng& rng, Counters& counters) {
  if (drawn_) return;
  drawn_ = true;
  realisation_->draw(kept_ ? kept_->seed : rng(), plan_->process->time);
  met_before_ = kept_ && kept_->met;
  if (kept_) {
    kept_->met = true;
    for (RealisationCondition* c : {&kept_->entry, &kept_->moved})
      if (c->active && c->block < 0) c->solve(plan_->posterior.get());
    entry_ = kept_->entry;
    own_ = kept_->moved;
  }
  realisation_->set_line(line_.origin, line_.direction);
  // The cubic is off by u²(h-u)² |g''''| / 24 <= (4/3)(B₁+B₂) (h/2)⁴ |g''''| / 24; 4.5 standard
  // deviations of g''''.
  deviation_ = (4.5 * realisation_->fourth_derivative() +
                added_norm_ * realisation_->expected_fourth_derivative(line_.direction)) /
               288;
  count(counters);
}

void RealisationPath::count(Counters& counters) {
  counters.line_normals += realisation_->normals() - counted_;
  counted_ = realisation_->normals();
}

void RealisationPath::slope_law(double g0, double& mean, double& deviation) const {
  const Eigen::Vector4d d = row(0, line_.direction);
  const double shared = law_.row(0).dot(d), gain = law_(0, 0) > 0 ? shared / law_(0, 0) : 0;
  mean = sign_ * mean_.dot(d) + gain * (g0 - sign_ * mean_[0]);
  deviation = std::sqrt(std::max(0.0, d.dot(law_ * d) - gain * shared));
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
      own_ = {};
      kept_->moved = own_ = condition(known);
      ++counters.realisation_moved;
    }
    evaluate(anchor_, g, dg);
  }
  double mean, deviation;
  slope_law(known.value, mean, deviation);
  near_.know(anchor_, known.value, dg, near_start_reach(kNear, deviation, deviation_));
  pull_ = plan_->pull() + std::max(0.0, -known.value) +
          (deviation > 0
               ? 0.61 * std::max(0.0, -dg) * std::sqrt(plan_->covariance->variance()) / deviation
               : 0);
  return dg;
}

RealisationCondition RealisationPath::condition(const PathStart& known) const {
  RealisationCondition out{true, point(anchor_), {0, {}}, -1, {}};
  const FieldSample now = sample(out.at);
  // What is known, as rows over (g, ∇g); of g itself, which a ray inside the body sees reversed.
  std::vector<Eigen::Vector4d> rows{row(1, {})};
  std::vector<double> off{known.value - now.value};
  const auto tell = [&](const Vec3& d, double slope) {
    rows.push_back(row(0, d));
    off.push_back(slope - dot(now.gradient, d));
  };
  if (known.gradient_known) {
    tell({1, 0, 0}, known.gradient.x);
    tell({0, 1, 0}, known.gradient.y);
    tell({0, 0, 1}, known.gradient.z);
  } else if (known.slope_known) {
    tell(line_.direction, known.slope);
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd f(n, 4);
  Eigen::VectorXd delta(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    f.row(i) = rows[i];
    delta[i] = sign_ * off[i];
  }
  const Eigen::Vector4d weight = f.transpose() * (pseudo_inverse(f * law_ * f.transpose()) * delta);
  out.weight = {weight[0], {weight[1], weight[2], weight[3]}};
  out.solve(plan_->posterior.get());
  return out;
}

FieldSample RealisationPath::sample(const Vec3& x) const {
  FieldSample g = realisation_->sample(x);
  entry_.add(*plan_->covariance, plan_->posterior.get(), x, g);
  own_.add(*plan_->covariance, plan_->posterior.get(), x, g);
  return {sign_ * g.value, g.gradient * sign_};
}

void RealisationPath::evaluate(double t, double& g, double& dg) {
  const auto field = [this](double at, double& v, double& dv) { realised(at, v, dv); };
  near_.holds(t) ? near_.read(t, g, dg, field) : field(t, g, dg);
}

void RealisationPath::realised(double t, double& g, double& dg) {
  realisation_->on_line(t, g, dg);
  FieldSample moved;
  entry_.add(*plan_->covariance, plan_->posterior.get(), point(t), moved);
  own_.add(*plan_->covariance, plan_->posterior.get(), point(t), moved);
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
