#include "process/plan.h"

#include <algorithm>

#include "field/check.h"
#include "field/constant_field.h"
#include "field/scaled_field.h"
#include "kernel/scaled_kernel.h"
#include "kernel/transformed_kernel.h"
#include "process/conditioned_sampler.h"
#include "process/conditions.h"
#include "process/covariance.h"
#include "process/first_passage.h"
#include "process/gaussian_process.h"
#include "process/realisation.h"
#include "process/sum_path.h"

namespace gpis {
namespace {

// A march ends a line after this many steps (kMaxSteps of process/march.h) and counts it, some
// four of them a length scale.
constexpr double kMostSteps = 1 << 20;
constexpr double kTooManySteps = 1e6;

Box3 intersection(const Box3& a, const Box3& b) {
  Box3 r;
  for (int i = 0; i < 3; ++i) {
    r.min[i] = std::max(a.min[i], b.min[i]);
    r.max[i] = std::min(a.max[i], b.max[i]);
  }
  return r;
}

// A field that is the same everywhere is a constant, however it is held.
FieldPtr constant_if_it_is(const FieldPtr& field) {
  const Range range = field->range();
  const bool known = dynamic_cast<const ConstantField*>(field.get());
  if (known || range.min != range.max || !std::isfinite(range.min)) return field;
  return std::make_shared<ConstantField>(range.min);
}

// L⁻¹ of A = L Lᵀ: what makes length scales √A those of a kernel without any.
Mat3 whitening(const SymMat3& a) {
  const Cholesky3 c(a);
  const double x = 1 / std::sqrt(c.d0), y = 1 / std::sqrt(c.d1), z = 1 / std::sqrt(c.d2);
  return {
      {Vec3{x, 0, 0}, Vec3{-c.l10 * y, y, 0}, Vec3{(c.l10 * c.l21 - c.l20) * z, -c.l21 * z, z}}};
}

// The same f by the least that it takes: a kernel of unit variance (the weight of a kernel
// multiplies σ², definitions E9), and no grid where a constant does.
std::shared_ptr<const GaussianProcess> normalised(const GaussianProcess& process) {
  auto out = std::make_shared<GaussianProcess>(process);
  // Conditions are solved once for the same fields: these stay what they are.
  if (!process.conditions) {
    out->sigma = constant_if_it_is(process.sigma);
    out->mean = constant_if_it_is(process.mean);
  }
  if (const auto support = process.mean->support(); support && out->mean != process.mean)
    out->bounds = intersection(process.bounds.value_or(Box3::everywhere()), *support);
  const bool tensors = process.anisotropy && !process.conditions;
  if (const auto a = tensors ? process.anisotropy->constant() : std::nullopt) {
    const Covariance refuses_what_takes_no_lengths(process);
    out->kernel = std::make_shared<TransformedKernel>(
        process.kernel, whitening(*a), std::sqrt(process.anisotropy->eigenvalues().min));
    out->anisotropy = nullptr;
  }
  const double variance = process.kernel->variance();
  if (variance != 1) {
    out->sigma = scaled(out->sigma, std::sqrt(variance));
    out->kernel = std::make_shared<ScaledKernel>(1 / variance, out->kernel);
  }
  return out;
}

struct Choice {
  std::unique_ptr<LineSampler> (*make)(const GaussianProcess&, const Box3&);
  std::string reason;
};

// What lines are drawn by that something is known of beside their start: conditions, segments.
Choice choose_joint(const GaussianProcess& process, Sampler asked, const std::string& why) {
  if (asked != Sampler::automatic && asked != Sampler::nystrom && asked != Sampler::dense)
    refuse(
        "this sampler draws a line from its start alone; with conditions or memory 'global-n' take "
        "'auto', 'nystrom' or 'dense'.");
  const bool smooth =
      asked == Sampler::nystrom || (asked == Sampler::automatic && Covariance(process).smooth());
  if (smooth) return {make_nystrom, "nystrom: " + why};
  return {make_joint_dense, "dense: " + why};
}

Choice choose(const GaussianProcess& process, Sampler asked) {
  const auto terms = process.kernel->terms();
  const Radial* radial = nullptr;  // of the one term without wave, where that is all
  if (!process.anisotropy && terms && terms->size() == 1 && length(terms->front().wave_vector) == 0)
    radial = &terms->front().radial;
  if (process.anisotropy &&
      (asked == Sampler::convolution || asked == Sampler::markov || asked == Sampler::spectral))
    refuse(
        "this sampler serves length scales that are the same everywhere; with an anisotropy take "
        "'auto', 'nystrom', 'dense' or 'realisation'.");
  const bool sum = !process.anisotropy && terms && SumPath::serves(*terms);
  switch (asked) {
    case Sampler::convolution:
      return {make_convolution, "convolution: asked for"};
    case Sampler::markov:
      if (sum) return {make_sum, "markov: asked for"};
      return {process.kernel->differentiable() ? make_markov : make_ornstein_uhlenbeck,
              "markov: asked for"};
    case Sampler::spectral:
      return {make_spectral, "spectral: asked for"};
    case Sampler::nystrom:
      return {make_nystrom, "nystrom: asked for"};
    case Sampler::dense:
      // One factor serves all lines of one radial correlation.
      return {radial ? make_dense : make_joint_dense, "dense: asked for"};
    case Sampler::realisation:
      return {
          make_realisation,
          "realisation: " + Realisation(process, Realisation::Access::rays, nullptr).describe()};
    case Sampler::first_passage:
    case Sampler::automatic:
      break;
  }
  if (radial) {
    if (radial->family == Radial::Family::squared_exponential)
      return {make_convolution, "convolution: stationary squared exponential"};
    if (!radial->differentiable())
      return {make_ornstein_uhlenbeck, "markov: first passage by its bridges, no gradients"};
    if (radial->markov())
      return {make_markov, "markov: a state of value and slopes carries the line exactly"};
  }
  const auto smooth = [](const Term& term) { return term.radial.smooth(); };
  if (!process.anisotropy && terms && std::all_of(terms->begin(), terms->end(), smooth))
    return {make_spectral, "spectral: a sum of smooth terms"};
  if (sum) return {make_sum, "markov: a sum of independent paths, of its smooth terms by waves"};
  const std::string why = process.anisotropy
                              ? "length scales vary, lines are drawn from their own covariance"
                              : "no other sampler serves " + process.kernel->describe();
  if (Covariance(process).smooth()) return {make_nystrom, "nystrom: " + why};
  return {make_joint_dense, "dense: " + why};
}

// A bound on the standard deviation of ∂_d g over all directions, for a length scale of 1 in A(x).
double steepest(const Kernel& kernel) {
  const Mat3 g = kernel.derivative_covariance();
  double most = 0;
  for (const Vec3& row : g.row)
    most = std::max(most, std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
  return std::sqrt(most);
}

// Of a constant mean and deviation: the probability that a ray meets the surface first behind so
// many of the length scales that its bounds are across (Rice's rate, oracle 2).
double missed_behind(double marched, double lengths, double level) {
  const double rate = std::exp(-0.5 * level * std::max(level, 0.0)) / (2 * kPi);  // a length scale
  return lengths > marched ? std::exp(-rate * marched) * -std::expm1(-rate * (lengths - marched))
                           : 0;
}

// Refuses lines that go on for longer than is marched or known, where that can be told: more of
// them than roots may be missed would end in the middle of the process, or meet what they have met
// before, without a word.
void check_length(const PlannedLine& plan, const Range& mean, const Range& sigma,
                  double missed_root) {
  if (mean.min != mean.max || sigma.min != sigma.max || sigma.min == 0 ||
      mean.min > plan.skip_threshold)
    return;
  const double level = mean.min / sigma.min, lengths = plan.steps / 4;
  if (plan.steps > kMostSteps && missed_behind(kMostSteps / 4, lengths, level) > missed_root)
    refuse(
        "The mean of ", level,
        " standard deviations is rarely met and nowhere certain, and the bounds are ",
        static_cast<long>(lengths), " length scales across: a ray may take more than the ",
        static_cast<long>(kMostSteps),
        " steps that are the most. Take a longer length_scale, smaller bounds, or a smaller mean.");
  const double known = plan.line_sampler ? plan.line_sampler->known_share() : 1;
  if (missed_behind(known * lengths, lengths, level) > missed_root)
    refuse(
        "The mean of ", level,
        " standard deviations is rarely met and nowhere certain, and spectral lines of this kernel "
        "repeat themselves after ",
        known, " of the way across the bounds, ", static_cast<long>(lengths),
        " length scales. Take a longer length_scale, smaller bounds, a smaller mean, or a squared "
        "exponential or Matern kernel (sampler 'auto').");
}

// Puts a table in the place of the march that draws it, where it serves the process.
void plan_first_passage(PlannedLine& plan, const GaussianProcess& process, double missed_root,
                        bool asked) {
  const std::string why = why_no_first_passage(process, plan.bounds, missed_root);
  if (!why.empty() && asked)
    refuse("The sampler first_passage does not serve this process, since ", why, ".");
  if (!why.empty()) return;
  const std::size_t count = FirstPassage::excursions(missed_root);
  plan.line_sampler =
      make_first_passage(process, plan.bounds, missed_root, plan.line_sampler->correlation_error());
  plan.sampler_reason =
      "first_passage: mean and deviation are constant, hits come out of a table of " +
      std::to_string(count) + " excursions (standard deviation of a probability over all slopes: " +
      number_text(std::round(0.5e5 / std::sqrt(count)) / 1e5) + "), nothing is marched";
}

}  // namespace

std::shared_ptr<const GaussianProcess> inside_out(const GaussianProcess& process) {
  auto out = std::make_shared<GaussianProcess>(process);
  out->mean = scaled(process.mean, -1.0);
  if (process.conditions) {
    auto conditions = std::make_shared<Conditions>(process.conditions->points);
    for (Conditions::Point& p : conditions->points) {
      if (p.value) p.value = -*p.value;
      if (p.gradient) p.gradient = -*p.gradient;
    }
    out->conditions = std::move(conditions);
  }
  return out;
}

PlannedLine plan_line(std::shared_ptr<const GaussianProcess> process, Memory memory,
                      Sampler sampler, double missed_root, bool alone) {
  PlannedLine plan;
  process = normalised(*process);
  const Range sigma = process->sigma->range();
  if (sigma.min < 0)
    refuse(
        "sigma must not be negative, it goes down to ", sigma.min,
        ": it is a standard deviation; say meaning=\"variance\" if the grid holds the variance.");
  if (!std::isfinite(sigma.max)) refuse("sigma must be bounded: use .clamped(low, high) on it.");
  if (!(missed_root > 0 && missed_root < 1))
    refuse("missed_root must lie between 0 and 1, it is ", missed_root, ".");

  const Range mean = process->mean->range();
  if (sigma.max == 0 && mean.min == 0 && mean.max == 0)
    refuse("mean and sigma are both 0 everywhere: there is no surface.");

  // Where a grid ends its field is a constant, and a jump there would be a surface of its own: no
  // surface outside.
  plan.bounds = process->bounds.value_or(Box3::everywhere());
  if (const auto support = process->mean->support())
    plan.bounds = intersection(plan.bounds, *support);
  if (plan.bounds.empty())
    refuse("The bounds and the grid of the mean do not meet: there is no surface.");

  // Rice: a crossing where μ > zσ on a length L has probability below L√λ₂/(2πℓ) e^{-z²/2} <= ε/2
  // (definitions B13).
  const double diagonal = length(plan.bounds.max - plan.bounds.min);
  double shortest = process->kernel->min_length_scale(), factor = 1;
  if (process->anisotropy) factor = std::sqrt(process->anisotropy->eigenvalues().min);
  shortest *= factor;
  const double lengths = std::isfinite(diagonal) ? diagonal / shortest : 1e4;
  // A path without slope comes to some 30 crossings a length scale, its excursions above z = 4 to 8
  // counted.
  const double rate =
      process->kernel->differentiable() ? steepest(*process->kernel) / factor : 30 / shortest;
  const double span = std::isfinite(diagonal) ? diagonal : 1e4 * shortest;
  const double crossings = rate > 0 ? std::max(1.0, rate * span) : 1;
  plan.skip_deviations = std::sqrt(std::max(16.0, 2 * std::log(crossings / (kPi * missed_root))));
  plan.caution = std::max(1.0, std::sqrt(std::log(missed_root) / std::log(1e-3)));
  plan.sigma_max = sigma.max;
  // Two to four cells of the path a length scale.
  plan.steps = std::isfinite(diagonal) ? 4 * lengths : 0;
  // A certain surface (σ = 0) still needs a last step across it: stop a little before the root.
  const double scale = std::min(shortest, std::isfinite(diagonal) ? diagonal : 1.0);
  plan.skip_threshold = std::max(plan.skip_deviations * sigma.max, 1e-4 * scale);
  check_length(plan, mean, sigma, missed_root);
  // A ray meets the surface about a deviation behind the place where it may first be, unless it
  // starts behind that.
  const double slope = process->mean->lipschitz();
  const double approach =
      slope * diagonal > plan.skip_threshold ? 4 * sigma.min / (slope * shortest) : 0;
  if (approach > kTooManySteps)
    refuse("The length scale ", shortest, " is so small against the standard deviation ", sigma.min,
           " that a ray takes ", approach, " steps to the surface, and the most is ", kTooManySteps,
           ". Take a longer length_scale or a smaller sigma.");
  plan.smooth_scale = std::min(process->mean->smooth_scale(), process->sigma->smooth_scale());
  plan.mean_lipschitz = process->mean->lipschitz();
  plan.sigma_lipschitz = process->sigma->lipschitz();
  if (sigma.max == 0) {
    plan.line_sampler = make_zero(*process, plan.bounds);
    plan.sampler_reason = "none: sigma is 0, the surface is the mean itself";
  } else {
    if (memory == Memory::segments) {
      const Choice joint =
          choose_joint(*process, sampler, "lines are drawn given earlier segments");
      plan.line_sampler = joint.make(*process, plan.bounds);
      plan.sampler_reason = joint.reason;
    } else if (process->conditions && sampler != Sampler::realisation) {
      const Choice joint = choose_joint(*process, sampler, "rays near conditions");
      auto near = joint.make(*process, plan.bounds);
      plan.sampler_reason = joint.reason;
      if (sampler == Sampler::automatic) {
        GaussianProcess free = *process;
        free.conditions = nullptr;
        const Choice others = choose(free, sampler);
        near = make_conditioned(std::move(near), others.make(free, plan.bounds));
        plan.sampler_reason += "; others " + others.reason;
      }
      plan.line_sampler = std::move(near);
    } else {
      const Choice choice = choose(*process, sampler);
      plan.line_sampler = choice.make(*process, plan.bounds);
      plan.sampler_reason = choice.reason;
      const bool asked = sampler == Sampler::first_passage;
      if (asked || (alone && sampler == Sampler::automatic))
        plan_first_passage(plan, *process, missed_root, asked);
    }
    plan.condition_pull = plan.line_sampler->condition_pull();
    check_length(plan, mean, sigma, missed_root);
  }
  plan.process = std::move(process);
  return plan;
}

}  // namespace gpis
