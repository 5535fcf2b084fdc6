// What the renderer did, counted where it is done: one set per thread, added up at the end,
// reported in `stats`. Tests assert on these, never on times. X(name, meaning): adding a counter is
// one line here.
#pragma once

#include <cstdint>

#define GPIS_COUNTERS(X)                                                                       \
  X(camera_paths, "camera paths traced")                                                       \
  X(path_vertices, "surface interactions")                                                     \
  X(path_length_limit, "paths ended by the safety limit on their length")                      \
  X(states_inside,                                                                             \
    "processes found inside where another surface was hit (a missed root): forgotten there")   \
  X(shadow_rays, "visibility rays towards lights")                                             \
  X(inside_rays, "rays that travelled inside a stochastic body (dielectrics)")                 \
  X(bounds_exits, "such rays that left a body by its bounds, where it has no surface")         \
  X(mesh_rays, "rays handed to Embree")                                                        \
  X(line_segments, "rays that met an uncertain region of a process")                           \
  X(line_tabulated, "such rays whose end came out of a table of first passages: not marched")  \
  X(line_skipped, "rays certain to miss a process: nothing drawn")                             \
  X(line_evaluations, "evaluations of a process on a line")                                    \
  X(line_normals, "normal random numbers drawn for lines and gradients")                       \
  X(line_cells_clear, "stretches of voxels crossed in one step")                               \
  X(line_pieces_clear, "voxels crossed by the cubic of the path, which was not asked")         \
  X(line_splits, "steps divided because a root could hide in them")                            \
  X(line_step_limit, "lines ended by the bound on steps per ray")                              \
  X(line_entry_inside, "lines found inside on re-entry after a skip")                          \
  X(line_slope_floor, "starts or hits whose slope had the wrong sign by rounding")             \
  X(line_split_limit, "steps no longer divided: narrower than the tolerance")                  \
  X(realisation_moved,                                                                         \
    "rays that entered a kept realisation inside: it was moved out there, until the next one") \
  X(line_reach_limit, "lines longer than the tables of the spectral sampler")                  \
  X(factorisations, "covariance matrices factorised")                                          \
  X(condition_rows, "conditions that lines were drawn given")                                  \
  X(pivots_dropped, "rows left out of a covariance matrix: determined by the others")          \
  X(mean_lookups, "evaluations of a mean that is not constant")                                \
  X(sigma_lookups, "evaluations of a deviation that is not constant")                          \
  X(tensor_lookups, "points on lines that took length scales A(x) which vary")                 \
  X(albedo_lookups, "evaluations of a painted albedo")                                         \
  X(composed_rays, "rays through a body of several processes (CSG)")                           \
  X(states_remembered, "states of processes kept where a path goes on from a surface")         \
  X(truncated_normals, "starts drawn conditioned on being outside")                            \
  X(nan_samples, "samples that were not finite: counted, logged and left out of the film")     \
  X(clamped_samples, "samples reduced by the clamp setting")

namespace gpis {

struct Counters {
#define X(name, meaning) std::uint64_t name = 0;
  GPIS_COUNTERS(X)
#undef X
  void add(const Counters& o) {
#define X(name, meaning) name += o.name;
    GPIS_COUNTERS(X)
#undef X
  }
};

}  // namespace gpis
