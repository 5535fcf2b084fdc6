#include "process/plan.h"

#include "field/check.h"
#include "field/constant_field.h"
#include "field/grid_field.h"
#include "field/sphere_field.h"
#include "process/march.h"

namespace gpis {
namespace {

// A field's line held by value under its concrete type, so that the march calls it directly.
// `breaks`: whether its derivative may jump somewhere.
template <class F, bool breaks>
class DirectLine {
 public:
  static constexpr bool kBreaks = breaks;
  static constexpr int kLookups = std::is_same_v<F, ConstantField> ? 0 : 1;
  DirectLine(const Field& field, const Vec3& o, const Vec3& d)
      : line_(static_cast<const F&>(field), o, d) {}
  double next_break(double t) const { return line_.next_break(t); }
  void enter(double a, double b) { line_.enter(a, b); }
  void evaluate(double t, double& v, double& dv) const { line_.evaluate(t, v, dv); }
  double above_until(double t, double t_end, double threshold) const {
    return line_.above_until(t, t_end, threshold);
  }
  FieldSample sample(double t) const { return line_.sample(t); }

 private:
  typename F::Line line_;
};

// Any other field, through its virtual line.
class AnyLine {
 public:
  static constexpr bool kBreaks = true;
  static constexpr int kLookups = 1;
  AnyLine(const Field& field, const Vec3& o, const Vec3& d) : line_(field.line(o, d)) {}
  double next_break(double t) const { return line_->next_break(t); }
  void enter(double a, double b) { line_->enter(a, b); }
  void evaluate(double t, double& v, double& dv) const { line_->evaluate(t, v, dv); }
  double above_until(double t, double t_end, double threshold) const {
    return line_->above_until(t, t_end, threshold);
  }
  FieldSample sample(double t) const { return line_->sample(t); }

 private:
  std::unique_ptr<FieldLine> line_;
};

ConvolutionPath& path_of(Line::Impl& line, ConvolutionPath*) {
  return line.convolution;
}
DensePath& path_of(Line::Impl& line, DensePath*) {
  return line.dense;
}
ZeroPath& path_of(Line::Impl& line, ZeroPath*) {
  return line.zero;
}

template <class MeanLine, class SigmaLine, class Path>
double march(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
             const Start& start, Rng& rng, Counters& counters) {
  const GaussianProcess& process = *plan.process;
  return March<MeanLine, SigmaLine, Path>(line, path_of(line, static_cast<Path*>(nullptr)),
                                          MeanLine(*process.mean, line.origin, line.direction),
                                          SigmaLine(*process.sigma, line.origin, line.direction),
                                          plan, rng, counters)
      .run(t_begin, t_end, start);
}

template <class Path>
PlannedLine::March choose_march(const GaussianProcess& process) {
  using Constant = DirectLine<ConstantField, false>;
  using Sphere = DirectLine<SphereField, true>;
  using Grid = DirectLine<GridField, true>;
  const Field* mean = process.mean.get();
  const bool constant_sigma = dynamic_cast<const ConstantField*>(process.sigma.get()) != nullptr;
  const bool grid_sigma = dynamic_cast<const GridField*>(process.sigma.get()) != nullptr;
  if (constant_sigma) {
    if (dynamic_cast<const ConstantField*>(mean)) return march<Constant, Constant, Path>;
    if (dynamic_cast<const SphereField*>(mean)) return march<Sphere, Constant, Path>;
    if (dynamic_cast<const GridField*>(mean)) return march<Grid, Constant, Path>;
    return march<AnyLine, Constant, Path>;
  }
  if (grid_sigma && dynamic_cast<const GridField*>(mean)) return march<Grid, Grid, Path>;
  return march<AnyLine, AnyLine, Path>;
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

// The convolution and the dense path know one stationary squared exponential of unit variance.
Mat3 squared_exponential_whitening(const Kernel& kernel) {
  const auto terms = kernel.terms();
  if (!terms || terms->size() != 1 || terms->front().weight != 1 ||
      terms->front().radial.family != Radial::Family::squared_exponential ||
      length(terms->front().wave_vector) != 0 || !(determinant(terms->front().whitening) != 0))
    refuse("No sampler serves the kernel ", kernel.describe(),
           " yet: take a SquaredExponential of finite length scales.");
  return terms->front().whitening;
}

}  // namespace

PlannedLine plan_line(std::shared_ptr<const GaussianProcess> process, Sampler sampler,
                      double missed_root) {
  PlannedLine plan;
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
  const double lengths =
      std::isfinite(diagonal) ? diagonal / process->kernel->min_length_scale() : 1e4;
  plan.skip_deviations =
      std::sqrt(std::max(16.0, 2 * std::log(std::max(1.0, lengths) / (kPi * missed_root))));
  plan.sigma_max = sigma.max;
  // A certain surface (σ = 0) still needs a last step across it: stop a little before the root.
  plan.skip_threshold =
      std::max(plan.skip_deviations * sigma.max, 1e-4 * process->kernel->min_length_scale());
  plan.smooth_scale = std::min(process->mean->smooth_scale(), process->sigma->smooth_scale());
  plan.mean_lipschitz = process->mean->lipschitz();
  plan.sigma_lipschitz = process->sigma->lipschitz();
  plan.whitening = squared_exponential_whitening(*process->kernel);
  // B⁻ᵀ of a diagonal times a rotation.
  plan.unwhitening = transpose(inverse(plan.whitening));

  if (sigma.max == 0) {
    plan.sampler = Sampler::convolution;
    plan.sampler_reason = "none: sigma is 0, the surface is the mean itself";
    plan.march = choose_march<ZeroPath>(*process);
  } else if (sampler == Sampler::dense) {
    if (!(lengths <= DensePath::kMaxReach) || !std::isfinite(diagonal))
      refuse("The dense sampler serves bounds of up to ", DensePath::kMaxReach,
             " length scales across, these have ", std::isfinite(diagonal) ? lengths : kInfinity,
             ": give the process smaller bounds or take the convolution sampler.");
    plan.sampler = Sampler::dense;
    plan.sampler_reason = "dense: asked for";
    plan.march = choose_march<DensePath>(*process);
  } else {
    plan.sampler = Sampler::convolution;
    plan.sampler_reason =
        sampler == Sampler::convolution
            ? "convolution: asked for"
            : "convolution: stationary squared exponential, correlation exact to 9e-8";
    plan.march = choose_march<ConvolutionPath>(*process);
  }
  plan.process = std::move(process);
  return plan;
}

}  // namespace gpis
