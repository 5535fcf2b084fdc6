#include "process/realisation_grid.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "process/conditions.h"
#include "process/node_grid.h"
#include "process/realisation.h"

namespace gpis {
namespace {

// A tile is drawn by one thread: 8 x 16 rows along z share most of their lattice nodes.
constexpr int kTile[2] = {8, 16};
constexpr int kTilesBetweenReports = 16;

// Conditions are met by what is drawn at them too.
void check_lengths(const GaussianProcess& process, Box3 bounds) {
  if (process.conditions)
    for (const Conditions::Point& p : process.conditions->points) bounds.include(p.at);
  Realisation::check(process, bounds);
}

int arena_of(int threads) {
  return threads > 0 ? threads : tbb::task_arena::automatic;
}

RealisationGrid empty_grid(const RealisationQuery& query) {
  const NodeGrid nodes(query.bounds, query.resolution, "realisation");
  return {nodes.resolution, nodes.voxel_size, nodes.origin, std::vector<float>(nodes.count())};
}

}  // namespace

std::optional<RealisationGrid> realise(const GaussianProcess& process,
                                       const RealisationQuery& query,
                                       const std::function<bool(double)>& progress) {
  RealisationGrid grid = empty_grid(query);
  check_lengths(process, query.bounds);
  const auto& [nx, ny, nz] = grid.resolution;
  const int tiles_y = (ny - 1) / kTile[1] + 1, tiles = ((nx - 1) / kTile[0] + 1) * tiles_y;

  struct Worker {
    Realisation realisation;
    std::vector<float> g;
  };
  const PosteriorPtr posterior = posterior_of(process);
  tbb::enumerable_thread_specific<Worker> workers([&] {
    Worker worker{Realisation(process, Realisation::Access::rows, posterior), {}};
    worker.realisation.draw(query.seed, process.time);
    return worker;
  });
  const auto fill = [&](int tile) {
    Worker& worker = workers.local();
    const int i0 = tile / tiles_y * kTile[0], j0 = tile % tiles_y * kTile[1];
    const std::array<int, 3> size{std::min(kTile[0], nx - i0), std::min(kTile[1], ny - j0), nz};
    worker.g.resize(static_cast<std::size_t>(size[0]) * size[1] * nz);
    const Vec3 corner = grid.origin + Vec3{double(i0), double(j0), 0} * grid.voxel_size;
    worker.realisation.fill(corner, grid.voxel_size, size, worker.g.data());
    const float* g = worker.g.data();
    for (int i = 0; i < size[0]; ++i)
      for (int j = 0; j < size[1]; ++j) {
        float* out = grid.values.data() + (static_cast<std::size_t>(i0 + i) * ny + j0 + j) * nz;
        for (int k = 0; k < nz; ++k, ++g) {
          const Vec3 p = corner + Vec3{double(i), double(j), double(k)} * grid.voxel_size;
          out[k] = static_cast<float>(process.mean->value(p) + process.sigma->value(p) * *g);
        }
      }
  };
  tbb::task_arena arena(arena_of(query.threads));
  for (int first = 0; first < tiles; first += kTilesBetweenReports) {
    const int last = std::min(first + kTilesBetweenReports, tiles);
    arena.execute([&] { tbb::parallel_for(first, last, fill); });
    if (!progress(static_cast<double>(last) / tiles)) return std::nullopt;
  }
  return grid;
}

std::vector<FieldSample> realise_at(const GaussianProcess& process, const std::vector<Vec3>& points,
                                    std::uint64_t seed, int count, int threads) {
  std::vector<FieldSample> out(points.size() * count);
  Box3 bounds;
  for (const Vec3& p : points) bounds.include(p);
  if (!points.empty()) check_lengths(process, bounds);
  const PosteriorPtr posterior = posterior_of(process);
  tbb::enumerable_thread_specific<Realisation> workers(
      [&] { return Realisation(process, Realisation::Access::rays, posterior); });
  tbb::task_arena(arena_of(threads)).execute([&] {
    tbb::parallel_for(0, count, [&](int n) {
      Realisation& realisation = workers.local();
      realisation.draw(seed + n, process.time);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const FieldSample mean = process.mean->sample(points[i]),
                          sigma = process.sigma->sample(points[i]),
                          g = realisation.sample(points[i]);
        out[n * points.size() + i] = {
            mean.value + sigma.value * g.value,
            mean.gradient + sigma.gradient * g.value + g.gradient * sigma.value};
      }
    });
  });
  return out;
}

}  // namespace gpis
