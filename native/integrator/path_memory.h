// What a light path knows of the stochastic bodies of a scene. A body costs something where a ray
// reaches its bounds, and nothing elsewhere: neither a path nor a ray goes through all of them.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "process/realisation_memory.h"
#include "process/segment_memory.h"
#include "scene/scene_impl.h"

namespace gpis {

class PathMemory {
 public:
  explicit PathMemory(const Scene::Impl& scene)
      : scene_(scene),
        states_(scene.stochastic.size()),
        realisations_(scene.stochastic.size()),
        segments_(scene.stochastic.size()),
        bodies_(scene.bodies.size()) {
    for (const auto& body : scene.bodies) global_ |= body.surface.memory() == Memory::global;
  }

  void begin_path(Rng& rng) {
    for (const int b : begun_) {
      for (std::optional<State>& state : states(b)) state.reset();
      for (SegmentMemory& kept : segments(b)) kept.segments.clear();
      bodies_[b] = {};
    }
    begun_.clear();
    entered_.clear();
    left_.clear();
    if (global_) realisation_seed_ = rng();
  }
  // What was remembered for the ray that begins, of bodies that the one before it has entered.
  void begin_ray() {
    entered_.swap(left_);
    entered_.clear();
  }
  // Before anything is asked of a body.
  void meet(int b) {
    if (bodies_[b].begun) return;
    bodies_[b].begun = true;
    begun_.push_back(b);
    if (scene_.bodies[b].surface.memory() != Memory::global) return;
    for (std::size_t i = scene_.bodies[b].first; RealisationMemory & kept : realisations(b)) {
      kept = {};
      kept.seed = realisation_seed_ + kGolden * i++;
    }
  }
  // A ray of the path (not one towards a light) reaches its bounds.
  void enter(int b) {
    meet(b);
    entered_.push_back(b);
  }
  // All that is remembered from the ray before.
  void forget() {
    for (const int b : left_)
      for (std::optional<State>& state : states(b)) state.reset();
  }

  // Bodies that the ray in hand has entered; those that any ray of the path has met.
  const std::vector<int>& entered() const { return entered_; }
  const std::vector<int>& begun() const { return begun_; }

  // One a leaf. States at the point that the path leaves; nothing: a fresh start outside of it.
  std::span<std::optional<State>> states(int b) { return of(states_, b); }
  // That the path sees, of memory `global`; a shadow ray sees a copy.
  std::span<RealisationMemory> realisations(int b) { return of(realisations_, b); }
  // What it has met, of memory `segments`; shadow rays read it alone.
  std::span<SegmentMemory> segments(int b) { return of(segments_, b); }

  // Whether the ray in hand travels inside. Every body is a medium in air: where two overlap, each
  // refracts as if the other were not there (no priorities). The sides of meshes are told by the
  // order of their corners.
  bool inside(int b) const { return bodies_[b].inside; }
  void cross(int b) { bodies_[b].inside = !bodies_[b].inside; }

 private:
  template <class T>
  std::span<T> of(std::vector<T>& all, int b) {
    const auto& body = scene_.bodies[b];
    return std::span(all).subspan(body.first, body.surface.leaves().size());
  }
  struct PerBody {
    bool begun = false, inside = false;
  };

  const Scene::Impl& scene_;
  bool global_ = false;
  std::uint64_t realisation_seed_ = 0;
  std::vector<std::optional<State>> states_;
  std::vector<RealisationMemory> realisations_;
  std::vector<SegmentMemory> segments_;
  std::vector<PerBody> bodies_;
  std::vector<int> begun_, entered_, left_;
};

}  // namespace gpis
