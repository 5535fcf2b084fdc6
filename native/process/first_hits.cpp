#include "process/first_hits.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <future>

#include "process/hit_gradient.h"

namespace gpis {
namespace {

// What a ray that starts at a point knows of a wall: on it or not, all of it.
State state_of_wall(const ProcessSurface& wall, const Vec3& origin) {
  constexpr double kOn = 1e-9;
  const Field& box = *wall.planned().process->mean;
  const FieldSample s = box.sample(origin);
  return {std::abs(s.value) < kOn * (box.smooth_scale() + length(origin)) ? 0 : s.value,
          s.gradient};
}

// Calls visit(row, lines, hit, rng, counters) for every ray, in parallel.
template <class Visit>
Counters for_each_hit(const TreeSurface& surface, const FirstHitsQuery& query,
                      std::vector<RealisationMemory>& realisations, Visit visit) {
  struct Worker {
    std::vector<Line> lines;
    std::vector<Start> starts;
    TreeSurface::March march;
    Counters counters;
  };
  tbb::enumerable_thread_specific<Worker> workers;
  tbb::task_arena arena(query.threads > 0 ? query.threads : tbb::task_arena::automatic);
  std::atomic<bool> stop = false;
  const std::size_t leaves = surface.leaves().size(), operands = surface.operands();
  const auto trace = [&](std::size_t i, Worker& worker) {
    Rng rng(query.seed, query.first_index + i);
    std::vector<RealisationMemory> fresh;
    RealisationMemory* kept = nullptr;
    if (surface.memory() == Memory::global) {
      if (realisations.empty()) fresh.resize(operands);
      kept = realisations.empty() ? fresh.data() : &realisations[i * operands];
      for (std::size_t k = 0; k < operands && query.realisation.empty(); ++k) kept[k].seed = rng();
    }
    const bool inside = !query.inside.empty() && query.inside[i];
    for (std::size_t k = operands; k < leaves; ++k) {
      const State on_wall = state_of_wall(surface.leaves()[k], query.rays[i].origin);
      worker.starts[k] =
          surface.leaves()[k].start_from(query.start.empty() ? nullptr : &on_wall, inside);
    }
    for (std::size_t k = 0; k < operands; ++k) {
      const State* state = query.start.empty() ? nullptr : &query.start[i * operands + k];
      if (state && std::isnan(state->value)) state = nullptr;
      worker.starts[k] = surface.leaves()[k].start_from(
          state, inside, kept ? kept + k : nullptr,
          query.segments.empty() ? nullptr : &query.segments[i * operands + k]);
    }
    const TreeHit hit = surface.first_hit(worker.march, worker.lines, query.rays[i], query.t_max,
                                          worker.starts, rng, worker.counters);
    visit(i, worker.lines, hit, rng, worker.counters);
  };
  const auto all = [&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, query.rays.size(), 256),
                      [&](const auto& range) {
                        Worker& worker = workers.local();
                        worker.lines.resize(leaves);
                        worker.starts.resize(leaves);
                        for (Line& line : worker.lines) line.stop_when(&stop);
                        for (std::size_t i = range.begin(); i != range.end() && !stop; ++i)
                          trace(i, worker);
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

FirstHits first_hits(const TreeSurface& surface, const FirstHitsQuery& query) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr Vec3 nowhere{nan, nan, nan};
  const std::size_t rays = query.rays.size(), leaves = surface.leaves().size();
  const std::size_t operands = surface.operands();
  FirstHits result;
  result.t.assign(rays, kInfinity);
  result.leaf.assign(rays, -1);
  result.position.assign(rays, nowhere);
  result.gradient.assign(rays, nowhere);
  result.state_value.assign(rays * operands, nan);
  result.state_gradient.assign(rays * operands, nowhere);
  result.realisation = query.realisation;
  if (surface.memory() == Memory::global) result.realisation.resize(rays * operands);
  if (surface.memory() == Memory::segments) {
    result.segments = query.segments;
    result.segments.resize(rays * operands);
  }
  result.counters = for_each_hit(
      surface, query, result.realisation,
      [&](std::size_t i, std::vector<Line>& lines, const TreeHit& hit, Rng& rng,
          Counters& counters) {
        // A ray inside that leaves by bounds has no hit, as one that leaves a process of its own.
        if (hit.leaf < 0 || hit.left < kInfinity) return;
        result.t[i] = hit.t;
        result.leaf[i] = surface.operand(hit.leaf);
        result.position[i] = query.rays[i].at(hit.t);
        std::vector<std::optional<State>> states(leaves);
        std::optional<HitGradient> found;
        const auto draw = [&] {
          found.emplace(surface, lines, hit, states, rng, counters);
          counters.line_normals += 2;
          result.gradient[i] = found->law().draw(rng);
        };
        // Where leaves are blended, the gradient is one given those of the others.
        const bool last = surface.tree().has_blends();
        for (std::size_t k = 0; k < leaves; ++k) {
          const ProcessSurface& leaf = surface.leaves()[k];
          if (static_cast<int>(k) == hit.leaf) {
            if (!last) draw();
            continue;
          }
          if (!leaf.sampled_at(lines[k], hit.t)) continue;
          counters.line_normals += 2;
          const double value = leaf.value(lines[k], hit.t, rng);
          states[k] = leaf.state(value, leaf.gradient_law(lines[k], hit.t, rng).draw(rng));
        }
        if (last) draw();
        found->remember(result.gradient[i], states);
        for (std::size_t k = 0; k < operands; ++k) {
          if (!states[k]) continue;
          result.state_value[i * operands + k] = states[k]->value;
          result.state_gradient[i * operands + k] = states[k]->gradient;
          if (result.segments.empty()) continue;
          SegmentMemory& kept = result.segments[i * operands + k];
          surface.leaves()[k].keep_segment(lines[k], hit.t, kept);
          surface.leaves()[k].keep_end(result.position[i], *states[k], kept);
        }
      });
  return result;
}

std::vector<double> line_values(const TreeSurface& surface, const FirstHitsQuery& query,
                                const std::vector<double>& t) {
  const std::size_t leaves = surface.operands();
  std::vector<double> values(query.rays.size() * t.size() * leaves,
                             std::numeric_limits<double>::quiet_NaN());
  std::vector<RealisationMemory> realisations = query.realisation;
  for_each_hit(surface, query, realisations,
               [&](std::size_t i, std::vector<Line>& lines, const TreeHit&, Rng& rng, Counters&) {
                 for (std::size_t j = 0; j < t.size(); ++j)
                   for (std::size_t k = 0; k < leaves; ++k)
                     if (surface.leaves()[k].sampled_at(lines[k], t[j]))
                       values[(i * t.size() + j) * leaves + k] =
                           surface.leaves()[k].value(lines[k], t[j], rng);
               });
  return values;
}

}  // namespace gpis
