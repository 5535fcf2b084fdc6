// What a light path keeps of a process under the memory `global`: which realisation of g it sees.
#pragma once

#include <cstdint>

#include "field/field.h"
#include "process/posterior.h"

namespace gpis {

// g made to have given values at one point, by Matheron's rule (math.md §3): g(x) += the covariance
// of g(x) with the functional weight.value g + weight.slope · ∇g at that point, under what is known
// of g already.
struct RealisationCondition {
  bool active = false;
  Vec3 at;
  Functional weight;
  // Of the rows of the block there, where the process has conditions: what they take back.
  int block = -1;
  std::vector<double> taken;

  // `posterior` null: no conditions.
  void solve(const Posterior* posterior) {
    if (!active || !posterior) return;
    block = posterior->block(at);
    const JointRows& rows = posterior->rows(block);
    const Eigen::VectorXd v = rows.whitened(posterior->covariance().at(at), weight);
    taken = rows.weights({v.begin(), v.end()});
  }

  void add(const Covariance& covariance, const Posterior* posterior, const Vec3& x,
           FieldSample& g) const {
    if (!active) return;
    const LocalPoint here = covariance.at(x);
    Eigen::Vector4d c = covariance.cross(here, covariance.at(at), weight);
    if (block >= 0) c -= posterior->sum(block, taken, here);
    g.value += c[0];
    g.gradient += Vec3{c[1], c[2], c[3]};
  }
};

struct RealisationMemory {
  std::uint64_t seed = 0;
  bool met = false;  // by a ray of the path
  // The first ray of the path that met the process found itself inside: the realisation was moved
  // outside there (definitions B4).
  RealisationCondition entry;
  // And the last later ray that did: for it and what follows, until the next one.
  RealisationCondition moved;
};

}  // namespace gpis
