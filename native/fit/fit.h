// Sample, compose, fit: one non-stationary process with the moments of a tree of processes at every
// node of a grid (math.md §10). Where one leaf wins for certain F is that leaf and nothing is
// drawn; elsewhere joint realisations are composed and summed up as they come, or Clark's formulas
// serve.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "process/node_grid.h"
#include "process/tree.h"

namespace gpis {

struct FitQuery {
  Box3 bounds;
  int resolution = 64;  // nodes along the longest side, the first and last on its ends
  int realisations = 1000;
  std::uint64_t seed = 0;
  bool closed_form = false;  // by Clark's formulas and those of blends: nothing is drawn
  double correlation = 0;    // of the operands' noises: 0 independent, 1 shared
  // A leaf that loses by more than this many standard deviations is left out. The mean is then off
  // by less than 6e-8 of that deviation at 5; infinite: everything is drawn.
  double certainty = 5;
  int threads = 0;  // 0 = all cores
};

struct Fit {
  NodeGrid nodes;
  std::vector<float> mean, sigma, mean_error, sigma_error, skewness, kolmogorov;
  std::vector<float> anisotropy;  // squared length scales of a squared exponential, 6 a node

  // Nodes that were sampled, and those of the boxes around them that realisations were filled in.
  std::size_t voxels_drawn = 0, voxels_filled = 0;
  // Nodes whose length scales were brought into [voxel_size, 4 diagonals], and those where the
  // part of Cov ∇g that comes of their change (definitions E3) was limited to three quarters.
  std::size_t length_scales_limited = 0, change_limited = 0;
  double seconds = 0;
};

struct FitPlan {
  NodeGrid nodes;
  std::size_t voxels_drawn = 0;
  double seconds = 0;  // estimated from some tiles
  double memory = 0;   // bytes, grids and working space at their most
};

// `progress`(fraction) is called from the calling thread and returns false to cancel: then there is
// nothing. The result depends on neither the number of threads nor on what else is drawn.
std::optional<Fit> compose_and_fit(const TreePtr& tree, const FitQuery& query,
                                   const std::function<bool(double)>& progress);

FitPlan plan_fit(const TreePtr& tree, const FitQuery& query);

}  // namespace gpis
