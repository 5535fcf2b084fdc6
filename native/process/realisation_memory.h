// What a light path keeps of a process under the memory `global`: which realisation of g it sees.
#pragma once

#include <cstdint>

#include "field/field.h"
#include "kernel/kernel.h"

namespace gpis {

// g made to have given values at one point, by Matheron's rule (math.md §3): g(x) += value ·
// cov(g(x), g(at)) + Σ_j slope_j · cov(g(x), ∂_j g(at)).
struct RealisationCondition {
  bool active = false;
  Vec3 at;
  double value = 0;
  Vec3 slope;

  void add(const Kernel& kernel, const Vec3& x, FieldSample& g) const {
    if (!active) return;
    const Vec3 r = x - at, gradient = kernel.gradient(r);
    g.value += value * kernel.covariance(r) - dot(slope, gradient);
    g.gradient += gradient * value + kernel.mixed(r) * slope;
  }
};

struct RealisationMemory {
  std::uint64_t seed = 0;
  // The first ray of the path that met the process found itself inside: the realisation was moved
  // outside there (definitions B4).
  RealisationCondition entry;
};

}  // namespace gpis
