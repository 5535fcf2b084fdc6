// First hits of many rays with one process: the process alone, without light (scripts, tests,
// benchmarks).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/counters.h"
#include "process/realisation_memory.h"
#include "process/segment_memory.h"
#include "process/tree_surface.h"

namespace gpis {

struct FirstHitsQuery {
  std::vector<Ray> rays;
  double t_max = kInfinity;
  // Rays that leave a surface point: one a ray and leaf, ray after ray, value NaN where nothing is
  // remembered. Empty: rays that come from outside.
  std::vector<State> start;
  // One a ray and leaf, of memory `global`; empty: fresh ones.
  std::vector<RealisationMemory> realisation;
  std::vector<SegmentMemory> segments;  // the same of memory `segments`
  std::vector<char> inside;             // one a ray: those that travel inside the body; empty: none
  std::uint64_t seed = 0, first_index = 0;  // row i uses the random stream (seed, first_index + i)
  int threads = 0;                          // 0 = all cores
  // Asked by the calling thread a few times a second; true ends all rays early, without hits.
  std::function<bool()> interrupted;
};

struct FirstHits {
  std::vector<double> t;           // infinity where there is none
  std::vector<std::int32_t> leaf;  // that was hit, -1 where there is no hit
  // Of the hit and, drawn from its law, of the tree; NaN where there is no hit.
  std::vector<Vec3> position, gradient;
  // The states to remember, one a ray and leaf: value 0 at the leaf that was hit, NaN where the
  // leaf was not sampled.
  std::vector<double> state_value;
  std::vector<Vec3> state_gradient;
  std::vector<RealisationMemory> realisation;  // that each has seen; memory `global` alone
  std::vector<SegmentMemory> segments;         // and what it kept; memory `segments` alone
  Counters counters;
};

FirstHits first_hits(const TreeSurface& surface, const FirstHitsQuery& query);

// Values of f at `t` along every ray, row after row (t after t and leaf after leaf), on the sample
// paths that first_hits draws; NaN where the path was not sampled (behind the hit, or where the
// surface is certainly absent).
std::vector<double> line_values(const TreeSurface& surface, const FirstHitsQuery& query,
                                const std::vector<double>& t);

}  // namespace gpis
