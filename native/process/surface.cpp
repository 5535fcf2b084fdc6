#include "process/surface.h"

#include <sstream>
#include <stdexcept>

#include "process/line_impl.h"
#include "process/plan.h"

namespace gpis {

Line::Line() : impl_(std::make_unique<Impl>()) {}
Line::~Line() = default;
Line::Line(Line&&) noexcept = default;
Line& Line::operator=(Line&&) noexcept = default;

ProcessSurface::ProcessSurface(std::shared_ptr<const GaussianProcess> process,
                               const Affine& object_to_world, Memory memory, Sampler sampler,
                               double missed_root)
    : process_(process),
      object_to_world_(object_to_world),
      memory_(memory),
      planned_(std::make_shared<PlannedLine>(plan_line(std::move(process), sampler, missed_root))) {
  const double volume = determinant(object_to_world.linear);
  if (!std::isfinite(volume) || std::abs(volume) < 1e-300)
    throw std::invalid_argument(
        "The transform has no volume (a scale of zero?): it cannot be inverted. Give every axis a "
        "scale.");
  world_to_object_ = inverse(object_to_world);
  const Box3& box = planned_->bounds;
  if (std::isfinite(length(box.max - box.min))) {
    for (int corner = 0; corner < 8; ++corner)
      world_bounds_.include(object_to_world.point({corner & 1 ? box.max.x : box.min.x,
                                                   corner & 2 ? box.max.y : box.min.y,
                                                   corner & 4 ? box.max.z : box.min.z}));
  } else {
    world_bounds_ = {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
  }
}

double ProcessSurface::first_hit(Line& line, const Ray& ray, double t_max, const Start& start,
                                 Rng& rng, Counters& counters) const {
  Line::Impl& l = line.impl();
  l.stretches.clear();
  l.hit_t = kInfinity;
  l.conditioned = l.has_gamma = false;
  l.origin = world_to_object_.point(ray.origin);
  l.direction = world_to_object_.vector(ray.direction);
  auto [t_begin, t_end] = clip(planned_->bounds, l.origin, l.direction, 0, t_max);
  // A start on the surface lies inside the bounds, whatever rounding says.
  if (start.kind != Start::Kind::outside && t_begin < t_end) t_begin = 0;
  if (!(t_begin < t_end)) {
    ++counters.line_skipped;
    return kInfinity;
  }
  const Vec3 whitened = planned_->whitening * l.direction;
  l.inverse_length = length(whitened);
  const Frame frame(whitened / l.inverse_length);
  l.e1 = frame.s;
  l.e2 = frame.t;
  l.ed = frame.n;
  if (start.kind == Start::Kind::value_slope) {
    // γ(0) = wᵢᵀ∇g with ∇g = (∇f - ∇μ - g∇σ)/σ (definitions B1).
    const FieldSample mean = process_->mean->sample(l.origin),
                      sigma = process_->sigma->sample(l.origin);
    if (sigma.value > 0) {
      const double g = (start.state.value - mean.value) / sigma.value;
      const Vec3 gradient =
          (start.state.gradient - mean.gradient - sigma.gradient * g) / sigma.value;
      const Vec3 whitened_gradient = planned_->unwhitening * gradient;
      l.gamma1 = dot(l.e1, whitened_gradient);
      l.gamma2 = dot(l.e2, whitened_gradient);
      l.has_gamma = true;
    }
  }
  return planned_->march(*planned_, l, t_begin, t_end, start, rng, counters);
}

namespace {

// g and dg/dq at t, on the stretch that holds it.
void path_at(const PlannedLine& plan, const Line::Impl& line, double t, double& g, double& dg) {
  if (plan.sigma_max == 0) {
    g = dg = 0;
    return;
  }
  const Line::Impl::Stretch* stretch = &line.stretches.front();
  for (const auto& s : line.stretches)
    if (s.begin <= t) stretch = &s;
  const double q = line.q_of(t);
  auto evaluate = [&](const auto& path) {
    const long cell = std::min(static_cast<long>(std::floor(q / path.kStep)), stretch->last_cell);
    path.at(std::max(cell, 0l), q, g, dg);
  };
  if (plan.sampler == Sampler::dense)
    evaluate(line.dense);
  else
    evaluate(line.convolution);
  line.condition(q, g, dg);
}

}  // namespace

bool ProcessSurface::sampled_at(const Line& line, double t) const {
  for (const auto& s : line.impl().stretches)
    if (s.begin <= t && t <= s.end) return true;
  return false;
}

double ProcessSurface::value(const Line& line, double t) const {
  const Line::Impl& l = line.impl();
  if (t == l.hit_t) return 0;
  double g, dg;
  path_at(*planned_, l, t, g, dg);
  const Vec3 p = l.origin + l.direction * t;
  return process_->mean->value(p) + process_->sigma->value(p) * g;
}

GradientLaw ProcessSurface::gradient_law(const Line& line, double t) const {
  const Line::Impl& l = line.impl();
  FieldSample mean, sigma;
  double g, dg;
  if (t == l.hit_t) {
    mean = l.hit_mean;
    sigma = l.hit_sigma;
    g = l.hit_g;
    dg = l.hit_dg;
  } else {
    const Vec3 p = l.origin + l.direction * t;
    mean = process_->mean->sample(p);
    sigma = process_->sigma->sample(p);
    path_at(*planned_, l, t, g, dg);
  }
  // ∇f = ∇μ + g∇σ + σ∇g, ∇g = Bᵀ(γ₁e₁ + γ₂e₂ + g'e_d); γ(q) = cγ(0) + √(1-c²)ξ, c = exp(-q²/2)
  // (math.md §2, §4).
  const double q = l.q_of(t);
  const double c = l.has_gamma ? std::exp(-0.5 * q * q) : 0;
  const double one_minus_c2 = l.has_gamma ? -std::expm1(-q * q) : 1;
  const Mat3 bt = transpose(planned_->whitening);
  const Mat3 to_world = transpose(world_to_object_.linear);
  const Vec3 known = bt * (l.e1 * (c * l.gamma1) + l.e2 * (c * l.gamma2) + l.ed * dg);
  GradientLaw law;
  law.mean = to_world * (mean.gradient + sigma.gradient * g + known * sigma.value);
  const double spread = sigma.value * std::sqrt(one_minus_c2);
  law.b1 = to_world * (bt * (l.e1 * spread));
  law.b2 = to_world * (bt * (l.e2 * spread));
  // A spread below a millionth of the gradient (σ falling to 0, a short flight) has no density
  // worth the name.
  const double smaller = std::min(dot(law.b1, law.b1), dot(law.b2, law.b2));
  law.degenerate = one_minus_c2 < 1e-6 || !(smaller > 1e-12 * dot(law.mean, law.mean));
  return law;
}

State ProcessSurface::state(double value, const Vec3& world_gradient) const {
  return {value, transpose(object_to_world_.linear) * world_gradient};
}

Vec3 ProcessSurface::world_gradient(const State& state) const {
  return transpose(world_to_object_.linear) * state.gradient;
}

Start ProcessSurface::start_from(const State* remembered) const {
  if (!remembered) return {};
  // A certain surface has nothing to forget (B2): the ray starts on it and leaves along its
  // gradient.
  if (planned_->sigma_max == 0) return {Start::Kind::value_slope, *remembered};
  if (memory_ == Memory::none) return {};
  if (memory_ == Memory::renewal) return {Start::Kind::value, *remembered};
  return {Start::Kind::value_slope, *remembered};
}

std::vector<std::pair<std::string, std::string>> ProcessSurface::plan() const {
  auto number = [](double v) {
    std::ostringstream text;
    text << v;
    return text.str();
  };
  const char* memories[] = {"none", "renewal", "renewal+"};
  const Range sigma = process_->sigma->range();
  return {{"sampler", planned_->sampler_reason},
          {"memory", memories[static_cast<int>(memory_)]},
          {"sigma", sigma.min == sigma.max
                        ? "constant " + number(sigma.min)
                        : "varies, " + number(sigma.min) + " to " + number(sigma.max)},
          {"certainly_absent", "where the mean exceeds " + number(planned_->skip_threshold) + " (" +
                                   number(planned_->skip_deviations) +
                                   " standard deviations): nothing is drawn"}};
}

}  // namespace gpis
