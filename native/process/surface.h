// A process placed in the world and planned for rendering: the one face of native/process that the
// integrator sees. Immutable while rendering; shared by all threads. Spaces: everything named
// `object` is in the process's own space, the ray parameter t is common to both (a world ray maps
// to object space without normalising its direction, B12).
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "core/counters.h"
#include "core/rng.h"
#include "process/gaussian_process.h"

namespace gpis {

struct RealisationMemory;
struct SegmentMemory;
struct PlannedLine;  // tables and function pointers chosen once per object (process/plan.h)

// f and ∇f (object space) at a point: what Renewal+ remembers. Renewal uses the value alone.
struct State {
  double value = 0;
  Vec3 gradient;
};

// What a new line is conditioned on at t = 0 (definitions B1-B4).
struct Start {
  enum class Kind {
    outside,  // f > 0 and nothing else: camera rays, entry into bounds, memory none
    value,  // f = value; value 0 is the surface itself: slope flux-weighted (B3); value > 0: slope
            // free
    value_slope,  // f = value and ∇f = gradient (Renewal+)
  };
  Kind kind = Kind::outside;
  State state;
  // The ray travels inside the body (dielectrics): the same laws for -f (definitions B7).
  bool inside = false;
  // The realisation that the ray is to see; null: a fresh path. Memory `global` alone, which takes
  // note here where the path entered it.
  RealisationMemory* realisation = nullptr;
  // What the ray knows of earlier segments; null: nothing. Memory `segments` alone.
  const SegmentMemory* segments = nullptr;
};

// Gradient at a point of a line, given the line sample (t, ∂_d f): ∇f = mean + ξ₁ b1 + ξ₂ b2, ξ iid
// N(0,1), world space. b1, b2 are orthogonal to the ray direction in the sense b·d = 0, so every
// draw has the same ∂_d f. `degenerate`: no density is to be used (B10), since the gradient is (all
// but) determined across some direction: σ = 0, a remembered gradient over a very short flight, or
// a kernel that is constant along an axis. It may still vary along another one.
struct GradientLaw {
  Vec3 mean, b1, b2;
  bool degenerate = false;

  bool certain() const { return dot(b1, b1) + dot(b2, b2) == 0; }

  Vec3 draw(Rng& rng) const {
    const double xi1 = rng.normal(), xi2 = rng.normal();
    return mean + b1 * xi1 + b2 * xi2;
  }
};

// One ray through one process. Reused from ray to ray (keeps its buffers); `first_hit` starts a new
// sample path.
class Line {
 public:
  Line();
  ~Line();
  Line(Line&&) noexcept;
  Line& operator=(Line&&) noexcept;

  // Rays end, with no hit, soon after *stop becomes true: what they found is then to be dropped.
  void stop_when(const std::atomic<bool>* stop);

  struct Impl;
  Impl& impl() { return *impl_; }
  const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

class ProcessSurface {
 public:
  // Throws std::invalid_argument with a sentence where the process cannot be rendered (σ negative,
  // singular transform, …).
  ProcessSurface(std::shared_ptr<const GaussianProcess> process, const Affine& object_to_world,
                 Memory memory, Sampler sampler, double missed_root);

  // Plans rays that travel inside the body too; before the first of them.
  void serve_inside();

  // Whether hits come out of a table of first passages, whose lines say nothing of the way there,
  // if no ray ends inside the bounds on anything else; and whether they are asked to.
  bool gains_alone() const;
  bool must_stand_alone() const { return sampler_ == Sampler::first_passage; }
  // It is so; before the first ray.
  void stands_alone();

  Memory memory() const { return memory_; }
  const PlannedLine& planned() const { return *planned_; }
  const Affine& world_to_object() const { return world_to_object_; }
  // World-space box outside of which there is certainly no surface (infinite where unbounded).
  const Box3& bounds() const { return world_bounds_; }

  // The first t in (0, t_max) where f changes to f <= 0 (inside: to f >= 0), infinity if there is
  // none. `line` holds
  // the sample path afterwards. `ray.direction` has unit length.
  double first_hit(Line& line, const Ray& ray, double t_max, const Start& start, Rng& rng,
                   Counters& counters) const;

  // True if the line of the last first_hit was sampled at t (so that its state there must be
  // remembered, B1/B5).
  bool sampled_at(const Line& line, double t) const;
  // Law of the world gradient at t given the sample path. Only where sampled_at(line, t) or t is
  // the hit. A path may have to draw what it holds between the points that were met.
  GradientLaw gradient_law(Line& line, double t, Rng& rng) const;
  // f at t on the sample path (0 at the hit).
  double value(Line& line, double t, Rng& rng) const;

  // A world gradient, drawn from gradient_law or chosen by light sampling, as the state to remember
  // (object space).
  State state(double value, const Vec3& world_gradient) const;
  Vec3 world_gradient(const State& state) const;

  // The start of a ray that leaves a point with this remembered state, under this object's memory
  // model.
  Start start_from(const State* remembered, bool inside = false,
                   RealisationMemory* realisation = nullptr,
                   const SegmentMemory* segments = nullptr) const;

  // Under memory `segments`: keeps the line of the last first_hit up to t as the newest segment;
  // and the state (object space) at a point where that segment ends.
  void keep_segment(Line& line, double t, SegmentMemory& segments) const;
  void keep_end(const Vec3& world_position, const State& state, SegmentMemory& segments) const;

  // Human-readable facts for scene.plan().
  std::vector<std::pair<std::string, std::string>> plan() const;

 private:
  Affine object_to_world_, world_to_object_;
  Memory memory_;
  Box3 world_bounds_;
  Sampler sampler_;
  double missed_root_;
  bool alone_ = false;
  std::shared_ptr<const PlannedLine> planned_, planned_inside_;
};

// Random starts (also used by tests): N(0,1) truncated to (a, ∞) and to (low, high), the logarithm
// of its mass above a, and the flux-weighted normal z ~ z₊ N(z; a, 1) (formulas C5, C6).
double truncated_normal(double a, Rng& rng);
double truncated_normal(double low, double high, Rng& rng);
double log_normal_tail(double a);
double flux_weighted_normal(double a, Rng& rng);

}  // namespace gpis
