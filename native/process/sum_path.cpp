#include "process/sum_path.h"

#include "core/symmetric_eigen.h"
#include "field/check.h"
#include "process/across.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

// More rough terms than this are drawn jointly: each costs a path.
constexpr std::ptrdiff_t kMostRough = 8;

bool rough(const Term& term) {
  return !term.radial.smooth();
}

// Cov ∇g of a term at a point: w (λ₂ BᵀB + k kᵀ).
void add_slopes(const Term& term, std::vector<Vec3>& slopes) {
  const double size = std::sqrt(term.weight * term.radial.lambda2());
  for (const Vec3& row : term.whitening.row)
    if (size > 0 && length(row) > 0) slopes.push_back(row * size);
  if (term.modulated()) slopes.push_back(term.wave_vector * std::sqrt(term.weight));
}

}  // namespace

bool SumPath::serves(const std::vector<Term>& terms) {
  const auto served = [](const Term& term) {
    return !rough(term) || (term.radial.differentiable() && !term.modulated());
  };
  const auto count = std::count_if(terms.begin(), terms.end(), rough);
  return terms.size() > 1 && count > 0 && count <= kMostRough &&
         std::all_of(terms.begin(), terms.end(), served);
}

SumPath::Plan::Plan(const GaussianProcess& process, const Box3& bounds) {
  const auto terms = process.kernel->terms();
  if (!terms || !serves(*terms))
    refuse("The Markov sampler does not serve ", process.kernel->describe(),
           ": take sampler 'auto'.");
  std::vector<Term> smooth;
  for (const Term& term : *terms) {
    if (rough(term))
      add(markov_path(term), {term}, std::sqrt(term.weight), term.weight);
    else
      smooth.push_back(term);
  }
  if (!smooth.empty()) {
    SpectralPath::Plan plan(smooth, bounds);
    const double share = plan.variance;
    reach = plan.reach;
    add(Of<SpectralPath>{std::move(plan)}, smooth, 1, share);
  }
  correlation_error /= variance;
  Mat3 covariance = Mat3{} * 0;
  for (const Part& part : parts) covariance = covariance + part.covariance;
  // Where nothing changes along an axis no gradient has a part along it.
  precision = pseudo_inverse(covariance);
}

SumPath::Plan::Kinds SumPath::Plan::markov_path(const Term& term) {
  if (term.radial.family == Radial::Family::matern52)
    return Of<MarkovPath<Matern52>>{MarkovPath<Matern52>::Plan(term)};
  if (term.radial.family == Radial::Family::wong)
    return Of<MarkovPath<Wong>>{MarkovPath<Wong>::Plan(term)};
  return Of<MarkovPath<Matern32>>{MarkovPath<Matern32>::Plan(term)};
}

void SumPath::Plan::add(Kinds path, const std::vector<Term>& terms, double scale, double share) {
  Part part{std::move(path), scale, share, {}, Mat3{} * 0};
  for (const Term& term : terms) add_slopes(term, part.slopes);
  for (const Vec3& slope : part.slopes) part.covariance = part.covariance + outer(slope, slope);
  variance += share;
  correlation_error +=
      share * std::visit([](const auto& of) { return of.plan.correlation_error; }, part.path);
  parts.push_back(std::move(part));
}

void SumPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                    Counters& counters) {
  plan_ = &plan;
  direction_ = line.direction;
  anchor_ = anchor;
  last_cell_ = 0;
  parts_.resize(plan.parts.size());
  step_ = kInfinity;
  slope_variance_ = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    part.scale = plan.parts[i].scale;
    std::visit(
        [&]<class Path>(const Plan::Of<Path>& of) {
          if (!std::holds_alternative<Path>(part.path)) part.path.template emplace<Path>();
          Path& path = std::get<Path>(part.path);
          path.reset(of.plan, line, anchor, t_end, counters);
          step_ = std::min(step_, path.step());
          double mean, deviation;
          path.slope_law(0, mean, deviation);
          part.slope_variance = part.scale * part.scale * deviation * deviation;
          slope_variance_ += part.slope_variance;
        },
        plan.parts[i].path);
  }
  each([&](Part&, auto& path) {
    if (path.step() > step_) path.shorten(step_);
  });
}

void SumPath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  g = dg = 0;
  each([&](Part& part, auto& path) {
    double value, slope;
    path.start_free(rng, counters, value, slope);
    g += part.scale * value;
    dg += part.scale * slope;
  });
}

// Fills the parts' starts: free draws, moved by what the sum lacks.
void SumPath::split(const PathStart& known, Rng& rng, Counters& counters) {
  double value = known.value, slope = known.slope;
  Vec3 gradient = known.gradient;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Plan::Part& plan = plan_->parts[i];
    PathStart& start = parts_[i].start;
    start = {};
    start.value = std::sqrt(plan.variance) * rng.normal();
    ++counters.line_normals;
    value -= start.value;
    if (known.gradient_known) {
      start.gradient_known = start.slope_known = true;
      for (const Vec3& root : plan.slopes) start.gradient += root * rng.normal();
      counters.line_normals += static_cast<long>(plan.slopes.size());
      gradient = gradient - start.gradient;
    } else if (known.slope_known) {
      start.slope_known = true;
      start.slope = std::sqrt(parts_[i].slope_variance) * rng.normal();
      ++counters.line_normals;
      slope -= start.slope;
    }
  }
  const Vec3 weighted = plan_->precision * gradient;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Plan::Part& plan = plan_->parts[i];
    PathStart& start = parts_[i].start;
    start.value += plan.variance / plan_->variance * value;
    if (known.gradient_known) {
      start.gradient += plan.covariance * weighted;
      start.slope = dot(direction_, start.gradient);
    } else if (known.slope_known && slope_variance_ > 0) {
      start.slope += parts_[i].slope_variance / slope_variance_ * slope;
    }
    start.value /= plan.scale;
    start.slope /= plan.scale;
    start.gradient = start.gradient / plan.scale;
  }
}

double SumPath::start(const PathStart& known, Rng& rng, Counters& counters) {
  split(known, rng, counters);
  double slope = 0;
  each(
      [&](Part& part, auto& path) { slope += part.scale * path.start(part.start, rng, counters); });
  return slope;
}

double SumPath::pull(double t) const {
  double sum = 0;
  each([&](const Part& part, const auto& path) { sum += part.scale * path.pull(t); });
  return sum;
}

void SumPath::prepare(long cell, Rng& rng, Counters& counters) {
  last_cell_ = std::max(last_cell_, cell);
  each([&](Part&, auto& path) { path.prepare(cell, rng, counters); });
}

void SumPath::at_right(long cell, double& g, double& dg) {
  g = dg = 0;
  each([&](Part& part, auto& path) {
    double value, slope;
    path.at_right(cell, value, slope);
    g += part.scale * value;
    dg += part.scale * slope;
  });
}

void SumPath::at(long cell, double t, Rng& rng, double& g, double& dg) {
  g = dg = 0;
  each([&](Part& part, auto& path) {
    double value, slope;
    path.at(cell, t, rng, value, slope);
    g += part.scale * value;
    dg += part.scale * slope;
  });
}

// Of independent Gaussians: the variances add up.
double SumPath::deviation(double h) const {
  double sum = 0;
  each([&](const Part& part, const auto& path) {
    const double one = part.scale * path.deviation(h);
    sum += one * one;
  });
  return std::sqrt(sum);
}

PathGradient SumPath::gradient(double t, double, double dg, Rng& rng) {
  const double place = std::floor((t - anchor_) / step_);
  const long cell = std::clamp(static_cast<long>(place), 0l, last_cell_);
  PathGradient law;
  Across across(direction_);
  each([&](Part& part, auto& path) {
    double value, slope;
    path.at(cell, t, rng, value, slope);
    const PathGradient one = path.gradient(t, value, slope, rng);
    law.mean += one.mean * part.scale;
    if (one.free_variance > 0) {
      const double all = part.scale / std::sqrt(one.free_variance);
      across.add(one.b1 * all, one.free_variance);
      across.add(one.b2 * all, one.free_variance);
    }
  });
  across.write(law);
  // The slope that the march found, which rounds where the parts round otherwise.
  law.mean += direction_ * ((dg - dot(direction_, law.mean)) / dot(direction_, direction_));
  return law;
}

std::unique_ptr<LineSampler> make_sum(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<SumPath, Fields::any>(process, bounds);
}

}  // namespace gpis
