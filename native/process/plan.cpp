#include "process/plan.h"

#include "field/check.h"
#include "field/constant_field.h"
#include "field/scaled_field.h"
#include "kernel/scaled_kernel.h"
#include "process/gaussian_process.h"
#include "process/realisation.h"

namespace gpis {
namespace {

// The same f with a kernel of unit variance: the weight of a kernel multiplies σ² (definitions E9).
std::shared_ptr<const GaussianProcess> normalised(std::shared_ptr<const GaussianProcess> process) {
  const double variance = process->kernel->variance();
  if (variance == 1) return process;
  auto out = std::make_shared<GaussianProcess>(*process);
  const double factor = std::sqrt(variance);
  if (const auto* constant = dynamic_cast<const ConstantField*>(process->sigma.get()))
    out->sigma = std::make_shared<ConstantField>(factor * constant->value({}));
  else
    out->sigma = std::make_shared<ScaledField>(process->sigma, factor);
  out->kernel = std::make_shared<ScaledKernel>(1 / variance, process->kernel);
  return out;
}

Box3 everywhere() {
  return {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
}

Box3 intersection(const Box3& a, const Box3& b) {
  Box3 r;
  for (int i = 0; i < 3; ++i) {
    r.min[i] = std::max(a.min[i], b.min[i]);
    r.max[i] = std::min(a.max[i], b.max[i]);
  }
  return r;
}

}  // namespace

PlannedLine plan_line(std::shared_ptr<const GaussianProcess> process, Sampler sampler,
                      double missed_root) {
  PlannedLine plan;
  process = normalised(std::move(process));
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
  plan.bounds = process->bounds.value_or(everywhere());
  if (const auto support = process->mean->support())
    plan.bounds = intersection(plan.bounds, *support);
  if (plan.bounds.empty())
    refuse("The bounds and the grid of the mean do not meet: there is no surface.");

  // Rice: a crossing where μ > zσ on a length L has probability below L√λ₂/(2πℓ) e^{-z²/2} <= ε/2
  // (definitions B13).
  const double diagonal = length(plan.bounds.max - plan.bounds.min);
  const double shortest = process->kernel->min_length_scale();
  const double lengths = std::isfinite(diagonal) ? diagonal / shortest : 1e4;
  plan.skip_deviations =
      std::sqrt(std::max(16.0, 2 * std::log(std::max(1.0, lengths) / (kPi * missed_root))));
  plan.sigma_max = sigma.max;
  // A certain surface (σ = 0) still needs a last step across it: stop a little before the root.
  const double scale = std::min(shortest, std::isfinite(diagonal) ? diagonal : 1.0);
  plan.skip_threshold = std::max(plan.skip_deviations * sigma.max, 1e-4 * scale);
  plan.smooth_scale = std::min(process->mean->smooth_scale(), process->sigma->smooth_scale());
  plan.mean_lipschitz = process->mean->lipschitz();
  plan.sigma_lipschitz = process->sigma->lipschitz();
  if (sigma.max == 0) {
    plan.line_sampler = make_zero(*process, plan.bounds);
    plan.sampler_reason = "none: sigma is 0, the surface is the mean itself";
  } else if (sampler == Sampler::dense) {
    plan.line_sampler = make_dense(*process, plan.bounds);
    plan.sampler_reason = "dense: asked for";
  } else if (sampler == Sampler::realisation) {
    plan.line_sampler = make_realisation(*process, plan.bounds);
    plan.sampler_reason =
        "realisation: " + Realisation(*process->kernel, Realisation::Access::rays).describe();
  } else {
    plan.line_sampler = make_convolution(*process, plan.bounds);
    plan.sampler_reason = sampler == Sampler::convolution
                              ? "convolution: asked for"
                              : "convolution: stationary squared exponential";
  }
  plan.process = std::move(process);
  return plan;
}

}  // namespace gpis
