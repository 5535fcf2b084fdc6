// First hits of many rays with one process: the process alone, without light (scripts, tests,
// benchmarks).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/counters.h"
#include "process/realisation_memory.h"
#include "process/surface.h"

namespace gpis {

struct FirstHitsQuery {
  std::vector<Ray> rays;
  double t_max = kInfinity;
  std::vector<State>
      start;  // one a ray: rays that leave a surface point; empty: rays that come from outside
  std::vector<RealisationMemory> realisation;  // one a row, of memory `global`; empty: fresh ones
  std::vector<char> inside;  // one a ray: those that travel inside the body; empty: none
  std::uint64_t seed = 0, first_index = 0;  // row i uses the random stream (seed, first_index + i)
  int threads = 0;                          // 0 = all cores
  // Asked by the calling thread a few times a second; true ends all rays early, without hits.
  std::function<bool()> interrupted;
};

struct FirstHits {
  std::vector<double> t;     // infinity where there is none
  std::vector<State> state;  // value 0 and a gradient drawn from its law; NaN where there is no hit
  std::vector<RealisationMemory> realisation;  // that each row has seen; memory `global` alone
  Counters counters;
};

FirstHits first_hits(const ProcessSurface& surface, const FirstHitsQuery& query);

// Values of f at `t` along every ray, row after row, on the sample paths that first_hits draws; NaN
// where the path was not sampled (behind the hit, or where the surface is certainly absent).
std::vector<double> line_values(const ProcessSurface& surface, const FirstHitsQuery& query,
                                const std::vector<double>& t);

}  // namespace gpis
