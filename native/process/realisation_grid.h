// Realisations of a process f = mean + sigma·g, on a grid of nodes or at points.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "process/gaussian_process.h"

namespace gpis {

struct RealisationGrid {
  std::array<int, 3> resolution;  // nodes
  double voxel_size;
  Vec3 origin;
  std::vector<float> values;  // [(i·Y + j)·Z + k] at origin + (i, j, k)·voxel_size
};

struct RealisationQuery {
  Box3 bounds;
  int resolution = 64;  // nodes along the longest side, the first and last on its ends
  std::uint64_t seed = 0;
  int threads = 0;  // 0 = all cores
};

// In parallel; the values depend on process, bounds, resolution and seed alone. `progress`
// (fraction) is called from the calling thread and returns false to cancel: then there is nothing.
std::optional<RealisationGrid> realise(const GaussianProcess& process,
                                       const RealisationQuery& query,
                                       const std::function<bool(double)>& progress);

// f and ∇f at points, of the realisations seed, seed + 1, … seed + count - 1, one after the other:
// in exact arithmetic the values that `realise` has at its nodes.
std::vector<FieldSample> realise_at(const GaussianProcess& process, const std::vector<Vec3>& points,
                                    std::uint64_t seed, int count, int threads);

}  // namespace gpis
