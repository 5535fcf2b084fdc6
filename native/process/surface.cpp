#include "process/surface.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "core/box_image.h"
#include "process/bounds_cut.h"
#include "process/conditions.h"
#include "process/joint_line.h"
#include "process/line_impl.h"
#include "process/plan.h"
#include "process/realisation_path.h"

namespace gpis {

Line::Line() : impl_(std::make_unique<Impl>()) {}
Line::~Line() = default;
Line::Line(Line&&) noexcept = default;
Line& Line::operator=(Line&&) noexcept = default;
void Line::stop_when(const std::atomic<bool>* stop) {
  impl_->stop = stop;
}

namespace {

Sampler sampler_for(Memory memory, Sampler sampler) {
  if (memory == Memory::segments && (memory.count < 1 || memory.count > Memory::kMostSegments))
    throw std::invalid_argument("memory 'global-n' keeps 1 to " +
                                std::to_string(Memory::kMostSegments) + " segments, not " +
                                std::to_string(memory.count) + ".");
  if (memory != Memory::global) return sampler;
  if (sampler != Sampler::automatic && sampler != Sampler::realisation)
    throw std::invalid_argument(
        "memory 'global' is one realisation for the whole path: it takes sampler 'auto' or "
        "'realisation'.");
  return Sampler::realisation;
}

}  // namespace

ProcessSurface::ProcessSurface(std::shared_ptr<const GaussianProcess> process,
                               const Affine& object_to_world, Memory memory, Sampler sampler,
                               double missed_root)
    : object_to_world_(object_to_world),
      memory_(memory),
      sampler_(sampler_for(memory, sampler)),
      missed_root_(missed_root),
      planned_(std::make_shared<PlannedLine>(
          plan_line(std::move(process), memory, sampler_, missed_root))) {
  const double volume = determinant(object_to_world.linear);
  if (!std::isfinite(volume) || std::abs(volume) < 1e-300)
    throw std::invalid_argument(
        "The transform has no volume (a scale of zero?): it cannot be inverted. Give every axis a "
        "scale.");
  world_to_object_ = inverse(object_to_world);
  const Box3& box = planned_->bounds;
  if (std::isfinite(length(box.max - box.min))) {
    world_bounds_ = image_of(box, object_to_world);
  } else {
    world_bounds_ = Box3::everywhere();
  }
}

void ProcessSurface::serve_inside() {
  if (planned_inside_) return;
  planned_inside_ = std::make_shared<PlannedLine>(
      plan_line(inside_out(*planned_->process), memory_, sampler_, missed_root_, alone_));
}

bool ProcessSurface::gains_alone() const {
  if (must_stand_alone()) return true;
  const bool planned =
      memory_ == Memory::none || memory_ == Memory::renewal || memory_ == Memory::renewal_plus;
  return planned && sampler_ == Sampler::automatic && planned_->sigma_max > 0 &&
         why_no_first_passage(*planned_->process, planned_->bounds, missed_root_).empty();
}

void ProcessSurface::stands_alone() {
  alone_ = true;
  planned_ = std::make_shared<PlannedLine>(
      plan_line(planned_->process, memory_, sampler_, missed_root_, alone_));
  if (!planned_inside_) return;
  planned_inside_ = nullptr;
  serve_inside();
}

double ProcessSurface::first_hit(Line& line, const Ray& ray, double t_max, const Start& start,
                                 Rng& rng, Counters& counters) const {
  Line::Impl& l = line.impl();
  l.stretches.clear();
  l.hit_t = kInfinity;
  l.hit_value = 0;
  l.inside = start.inside;
  l.plan = start.inside ? planned_inside_.get() : planned_.get();
  l.shared = nullptr;
  const auto& [origin, direction] =
      l.geometry = {world_to_object_.point(ray.origin), world_to_object_.vector(ray.direction)};
  auto [t_begin, t_end] = clip(planned_->bounds, origin, direction, 0, t_max);
  // A start on the surface lies inside the bounds, whatever rounding says.
  if (start.kind != Start::Kind::outside && t_begin < t_end) t_begin = 0;
  if (!(t_begin < t_end)) {
    ++counters.line_skipped;
    return kInfinity;
  }
  if (memory_ == Memory::global) l.path<RealisationPath>().keep(start.realisation, start.inside);
  JointLine* joint = memory_ == Memory::segments ? l.plan->line_sampler->joint(l) : nullptr;
  if (joint) joint->recall(start.segments, start.inside ? -1 : 1);
  Start turned;
  const Start* seen = &start;
  if (start.inside) {
    turned = start;
    turned.state = {-start.state.value, -start.state.gradient};
    seen = &turned;
  }
  const double t =
      l.plan->line_sampler->first_hit(*l.plan, l, t_begin, t_end, *seen, rng, counters);
  if (memory_ == Memory::global) l.path<RealisationPath>().keep(nullptr, false);
  if (joint) joint->recall(nullptr, start.inside ? -1 : 1);
  return t;
}

namespace {

// Where a line has its path: a leaf of a tree may see another leaf's.
struct PathOf {
  explicit PathOf(Line::Impl& l)
      : line(l.shared ? *l.shared : l), sampler(*line.plan->line_sampler) {}
  Line::Impl& line;
  const LineSampler& sampler;
};

}  // namespace

bool ProcessSurface::sampled_at(const Line& line, double t) const {
  const Line::Impl& l = line.impl();
  for (const auto& s : (l.shared ? *l.shared : l).stretches)
    if (s.begin <= t && t <= s.end) return true;
  return false;
}

double ProcessSurface::value(Line& line, double t, Rng& rng) const {
  Line::Impl& l = line.impl();
  if (t == l.hit_t) return l.hit_value;
  double g, dg;
  const PathOf path(l);
  path.sampler.path_at(path.line, t, rng, g, dg);
  const Vec3 p = l.geometry.origin + l.geometry.direction * t;
  const double f = l.plan->process->mean->value(p) + l.plan->process->sigma->value(p) * g;
  return l.inside ? -f : f;
}

GradientLaw ProcessSurface::gradient_law(Line& line, double t, Rng& rng) const {
  Line::Impl& l = line.impl();
  const PathOf path_of(l);
  FieldSample mean, sigma;
  double g, dg;
  if (t == l.hit_t) {
    mean = l.hit_mean;
    sigma = l.hit_sigma;
    g = l.hit_g;
    dg = l.hit_dg;
  } else {
    const Vec3 p = l.geometry.origin + l.geometry.direction * t;
    mean = l.plan->process->mean->sample(p);
    sigma = l.plan->process->sigma->sample(p);
    path_of.sampler.path_at(path_of.line, t, rng, g, dg);
  }
  // ∇f = ∇μ + g∇σ + σ∇g (math.md §2).
  const PathGradient path = path_of.sampler.gradient(path_of.line, t, g, dg, rng);
  const Mat3 to_world = transpose(world_to_object_.linear);
  GradientLaw law;
  law.mean = to_world * (mean.gradient + sigma.gradient * g + path.mean * sigma.value);
  law.b1 = to_world * (path.b1 * sigma.value);
  law.b2 = to_world * (path.b2 * sigma.value);
  if (l.inside) law = {-law.mean, -law.b1, -law.b2};
  // The smaller axis of the spread: one below a millionth of the gradient (σ falling to 0, a short
  // flight, a kernel that is constant along an axis) has no density worth the name.
  const double area2 = dot(cross(law.b1, law.b2), cross(law.b1, law.b2));
  const double larger2 = std::max(dot(law.b1, law.b1), dot(law.b2, law.b2));
  law.degenerate =
      path.free_variance < 1e-6 || !(area2 > 1e-12 * larger2 * dot(law.mean, law.mean));
  return law;
}

State ProcessSurface::state(double value, const Vec3& world_gradient) const {
  return {value, transpose(object_to_world_.linear) * world_gradient};
}

Vec3 ProcessSurface::world_gradient(const State& state) const {
  return transpose(world_to_object_.linear) * state.gradient;
}

Start ProcessSurface::start_from(const State* remembered, bool inside,
                                 RealisationMemory* realisation,
                                 const SegmentMemory* segments) const {
  const Start fresh{Start::Kind::outside, {}, inside, realisation, segments};
  if (!remembered) return fresh;
  // A certain surface has nothing to forget (B2): the ray starts on it and leaves along its
  // gradient.
  if (planned_->sigma_max == 0 || memory_ == Memory::global)
    return {Start::Kind::value_slope, *remembered, inside, realisation, segments};
  if (memory_ == Memory::none) return fresh;
  if (memory_ == Memory::renewal) return {Start::Kind::value, *remembered, inside, realisation};
  return {Start::Kind::value_slope, *remembered, inside, realisation, segments};
}

void ProcessSurface::keep_segment(Line& line, double t, SegmentMemory& segments) const {
  Line::Impl& l = line.impl();
  Line::Impl& drawn = l.shared ? *l.shared : l;
  if (drawn.stretches.empty()) return;
  const JointLine* joint = drawn.plan->line_sampler->joint(drawn);
  if (!joint) return;  // a certain surface
  std::vector<SegmentMemory::Row> rows;
  joint->record(t, rows);
  segments.keep(std::move(rows), memory_.count);
}

void ProcessSurface::keep_end(const Vec3& world_position, const State& state,
                              SegmentMemory& segments) const {
  if (segments.segments.empty()) return;
  const Vec3 at = world_to_object_.point(world_position);
  const FieldSample mean = planned_->process->mean->sample(at),
                    sigma = planned_->process->sigma->sample(at);
  if (!(sigma.value > 0)) return;
  const double g = (state.value - mean.value) / sigma.value;
  const Vec3 slope = (state.gradient - mean.gradient - sigma.gradient * g) / sigma.value;
  std::vector<SegmentMemory::Row>& rows = segments.segments.back();
  rows.push_back({at, {}, g, 0});
  for (int i = 0; i < 3; ++i) {
    Functional along{0, {}};
    along.slope[i] = 1;
    rows.push_back({at, along, slope[i], 0});
  }
}

std::vector<std::pair<std::string, std::string>> ProcessSurface::plan() const {
  auto number = [](double v) {
    std::ostringstream text;
    text << v;
    return text.str();
  };
  const std::string segments = "global-" + std::to_string(memory_.count) +
                               ": the last segments on which the process was drawn";
  const char* memories[] = {"none", "renewal", "renewal+", segments.c_str(),
                            "global: one realisation for the whole path and its shadow rays"};
  const GaussianProcess& process = *planned_->process;
  const auto range = [&](const Range& r) {
    return r.min == r.max ? "constant " + number(r.min)
                          : "varies, " + number(r.min) + " to " + number(r.max);
  };
  const auto lengths = [&] {
    const std::string kernel = process.kernel->describe();
    if (!process.anisotropy) return "the same everywhere (A(x) left out): " + kernel;
    const Range a = process.anisotropy->eigenvalues();
    return "A(x) varies, lengths within " + number(std::sqrt(a.min)) + " and " +
           number(std::sqrt(a.max)) + ", times those of " + kernel;
  };
  std::vector<std::pair<std::string, std::string>> facts = {
      {"sampler", planned_->sampler_reason},
      {"correlation_error", number(planned_->line_sampler->correlation_error())},
      {"memory", memories[memory_.kind]},
      {"mean", range(process.mean->range())},
      {"sigma", range(process.sigma->range())},
      {"length_scales", lengths()},
      {"certainly_absent",
       "where the mean exceeds " + number(planned_->skip_threshold) +
           (process.sigma->range().max > 0
                ? " (" + number(planned_->skip_deviations) + " standard deviations)"
                : "") +
           ": nothing is drawn"},
      {"bounds", describe_bounds(process, planned_->bounds, planned_->skip_deviations)}};
  if (const auto posterior = planned_->line_sampler->posterior())
    facts.push_back(
        {"conditions", std::to_string(posterior->conditions().points()) + " points, " +
                           std::to_string(posterior->conditions().rows().size()) +
                           " values and slopes in " + std::to_string(posterior->blocks()) +
                           " blocks, solved with a truncation error of " +
                           number(posterior->truncation_error()) + " standard deviations"});
  else
    facts.emplace_back("conditions", process.conditions
                                         ? std::to_string(process.conditions->points.size()) +
                                               " points, in the realisation itself"
                                         : "left out: no condition points");
  if (planned_->process->time)
    facts.push_back(
        {"time", "now " + number(*planned_->process->time) +
                     " time scales: a realisation (memory global, gp.realisation) flows "
                     "from frame to frame under one seed; the other memories draw "
                     "every path anew, whose expectation does not change with time"});
  if (const double error = planned_->line_sampler->correlation_error(); error > 0.01)
    facts.emplace_back("warning_covariance",
                       "Correlations along a ray may be off by " + number(error) +
                           ": what this kernel does changes too fast for the sampler. Let "
                           "lengths change more slowly, take a squared exponential, or the "
                           "sampler 'realisation'.");
  if (planned_->line_sampler->reach() < kInfinity)
    facts.emplace_back(
        "line_reach", "A ray that meets no surface for more than " +
                          number(planned_->line_sampler->reach()) +
                          " length scales comes to see the noise again that it has seen: how often "
                          "such rays get through is off. Give the process smaller bounds, or take "
                          "the sampler 'nystrom'.");
  if (planned_->steps > 1e5)
    facts.emplace_back("warning",
                       "A ray across the bounds may take " + number(planned_->steps) +
                           " steps: the length scale is tiny against them. Take a longer "
                           "length_scale or smaller bounds.");
  return facts;
}

}  // namespace gpis
