// What a light path keeps of a process under the memory `global`: which realisation of g it sees.
#pragma once

#include <cstdint>

#include "field/field.h"
#include "process/covariance.h"

namespace gpis {

// g made to have given values at one point, by Matheron's rule (math.md §3): g(x) += the covariance
// of g(x) with the functional weight.value g + weight.slope · ∇g at that point.
struct RealisationCondition {
  bool active = false;
  Vec3 at;
  Functional weight;

  void add(const Covariance& covariance, const Vec3& x, FieldSample& g) const {
    if (!active) return;
    const Eigen::Vector4d c = covariance.cross(covariance.at(x), covariance.at(at), weight);
    g.value += c[0];
    g.gradient += Vec3{c[1], c[2], c[3]};
  }
};

struct RealisationMemory {
  std::uint64_t seed = 0;
  // The first ray of the path that met the process found itself inside: the realisation was moved
  // outside there (definitions B4).
  RealisationCondition entry;
};

}  // namespace gpis
