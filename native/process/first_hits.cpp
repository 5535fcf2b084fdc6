#include "process/first_hits.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <future>

namespace gpis {
namespace {

// Calls visit(row, line, t, rng, counters) for every ray, in parallel.
template <class Visit>
Counters for_each_hit(const ProcessSurface& surface, const FirstHitsQuery& query,
                      std::vector<RealisationMemory>& realisations, Visit visit) {
  struct Worker {
    Line line;
    Counters counters;
  };
  tbb::enumerable_thread_specific<Worker> workers;
  tbb::task_arena arena(query.threads > 0 ? query.threads : tbb::task_arena::automatic);
  std::atomic<bool> stop = false;
  const auto all = [&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, query.rays.size(), 256),
                      [&](const auto& range) {
                        Worker& worker = workers.local();
                        worker.line.stop_when(&stop);
                        for (std::size_t i = range.begin(); i != range.end() && !stop; ++i) {
                          Rng rng(query.seed, query.first_index + i);
                          RealisationMemory fresh;
                          RealisationMemory* realisation = nullptr;
                          if (surface.memory() == Memory::global) {
                            realisation = realisations.empty() ? &fresh : &realisations[i];
                            if (query.realisation.empty()) realisation->seed = rng();
                          }
                          const bool inside = !query.inside.empty() && query.inside[i];
                          const Start start = surface.start_from(
                              query.start.empty() ? nullptr : &query.start[i], inside, realisation);
                          const double t = surface.first_hit(
                              worker.line, query.rays[i], query.t_max, start, rng, worker.counters);
                          visit(i, worker.line, t, rng, worker.counters);
                        }
                      });
  };
  // The calling thread only waits, so that it can be asked to stop.
  auto work = std::async(std::launch::async, [&] { arena.execute(all); });
  while (work.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready)
    if (query.interrupted && query.interrupted()) stop = true;
  work.get();
  Counters total;
  for (const Worker& worker : workers) total.add(worker.counters);
  return total;
}

}  // namespace

FirstHits first_hits(const ProcessSurface& surface, const FirstHitsQuery& query) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  FirstHits result;
  result.t.resize(query.rays.size());
  result.state.resize(query.rays.size());
  result.realisation = query.realisation;
  if (surface.memory() == Memory::global) result.realisation.resize(query.rays.size());
  result.counters = for_each_hit(
      surface, query, result.realisation,
      [&](std::size_t i, Line& line, double t, Rng& rng, Counters& counters) {
        result.t[i] = t;
        if (std::isinf(t)) {
          result.state[i] = {nan, {nan, nan, nan}};
          return;
        }
        counters.line_normals += 2;
        result.state[i] = surface.state(0, surface.gradient_law(line, t, rng).draw(rng));
      });
  return result;
}

std::vector<double> line_values(const ProcessSurface& surface, const FirstHitsQuery& query,
                                const std::vector<double>& t) {
  std::vector<double> values(query.rays.size() * t.size(),
                             std::numeric_limits<double>::quiet_NaN());
  std::vector<RealisationMemory> realisations = query.realisation;
  for_each_hit(surface, query, realisations,
               [&](std::size_t i, Line& line, double, Rng& rng, Counters&) {
                 for (std::size_t j = 0; j < t.size(); ++j)
                   if (surface.sampled_at(line, t[j]))
                     values[i * t.size() + j] = surface.value(line, t[j], rng);
               });
  return values;
}

}  // namespace gpis
