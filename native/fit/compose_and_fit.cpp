#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <mutex>
#include <thread>

#include "fit/anisotropy.h"
#include "fit/tile.h"

namespace gpis {
namespace {

using Clock = std::chrono::steady_clock;

// The longest length scales, in diagonals of the bounds: there g differs from one that is constant
// by a correlation of 3 % at most, and samplers of lines need not resolve what nobody sees.
constexpr double kMostDiagonals = 4;
constexpr auto kProgressInterval = std::chrono::milliseconds(100);
// Of the bricks of normals that one realisation of one source keeps (process/lattice_noise.h).
constexpr double kNoiseMemory = 4e6;

// Tiles that an estimate of the time is made from; fewer where a tile is worked on as it will be.
constexpr int kTimedTiles = 4, kTimedClosed = 2;

// Of computing, not of waiting for other programs.
double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void check(const TreePtr& tree, const FitQuery& query) {
  if (query.realisations < 2 || query.realisations > 100'000'000)
    refuse("realisations is ", query.realisations, "; it takes 2 to 1e8.");
  if (!(std::abs(query.correlation) <= 1))
    refuse("correlation is ", query.correlation, "; it takes -1 to 1.");
  if (!(query.certainty >= 3)) refuse("certainty is ", query.certainty, "; it takes 3 or more.");
}

class Fitter {
 public:
  Fitter(const TreePtr& tree, const FitQuery& query)
      : query_(query),
        nodes_((check(tree, query), query.bounds), query.resolution, "fit"),
        composition_(tree, query.correlation),
        arena_(query.threads > 0 ? query.threads : tbb::task_arena::automatic),
        workers_([this] { return TileWorker(composition_, query_, nodes_); }) {}

  FitPlan plan() {
    FitPlan plan{nodes_, 0, 0, 0};
    const auto start = Clock::now();
    const std::vector<std::size_t> sampled = counts();
    const double counting = seconds_since(start);
    for (const std::size_t n : sampled) plan.voxels_drawn += n;
    plan.seconds = 3 * counting;
    const double threads = arena_.max_concurrency();
    if (plan.voxels_drawn > 0)
      plan.seconds += seconds_per_node(sampled) * static_cast<double>(plan.voxels_drawn) / threads;
    const double leaves = composition_.leaves(), sources = composition_.sources();
    const double tile = double(TileWorker::kSize[0]) * TileWorker::kSize[1] * TileWorker::kSize[2];
    // Six scalar grids, G, and A of this round and the last.
    plan.memory = static_cast<double>(nodes_.count()) * (6 + 3 * 6) * sizeof(float);
    if (plan.voxels_drawn > 0 && !query_.closed_form)
      plan.memory += threads * (tile * (sizeof(Moments) + 64 + leaves * 136 + sources * 4) +
                                sources * kNoiseMemory);
    return plan;
  }

  std::optional<Fit> run(const std::function<bool(double)>& progress) {
    const auto start = Clock::now();
    Fit fit = empty_fit();
    std::vector<std::size_t> sampled;
    const auto all = [&] {
      sampled = counts();
      double total = 0;
      for (const std::size_t n : sampled) total += cost(n);
      each(static_cast<int>(sampled.size()), [&](int tile) {
        if (cancelled_) return;
        workers_.local().work(tile, query_.realisations, cancelled_, fit);
        done_.fetch_add(cost(sampled[tile]) / total);
      });
      if (cancelled_) return;
      const Vec3 diagonal = query_.bounds.max - query_.bounds.min;
      const AnisotropyFit lengths =
          fit_anisotropy(fit.anisotropy, nodes_.resolution, nodes_.voxel_size, nodes_.voxel_size,
                         kMostDiagonals * length(diagonal),
                         [this](int n, const std::function<void(int)>& work) { each(n, work); });
      fit.length_scales_limited = lengths.limited;
      fit.change_limited = lengths.change_limited;
    };
    if (!watched(all, progress)) return std::nullopt;
    for (const TileWorker& worker : workers_) {
      fit.voxels_drawn += worker.drawn();
      fit.voxels_filled += worker.filled();
    }
    fit.seconds = seconds_since(start);
    return fit;
  }

 private:
  // Seconds of one thread for a sampled node: the mean of some tiles, each as likely to be among
  // them as it holds sampled nodes, so that it is that of all nodes. Tiles that are partly sampled
  // are dearer, for realisations fill the box around their nodes. Timed by all threads at once, as
  // they will work: two threads of one core take longer than one.
  double seconds_per_node(const std::vector<std::size_t>& sampled) {
    const int draws = query_.closed_form ? kTimedClosed : kTimedTiles;
    std::size_t total = 0, passed = 0;
    for (const std::size_t n : sampled) total += n;
    std::vector<std::pair<int, int>> timed;  // tile, how often
    int next = 0;
    for (std::size_t tile = 0; tile < sampled.size(); ++tile) {
      passed += sampled[tile];
      int often = 0;
      for (; next < draws && (next + 0.5) / draws * total < passed; ++next) ++often;
      if (often > 0) timed.emplace_back(static_cast<int>(tile), often);
    }
    Fit scratch = empty_fit();
    std::vector<double> seconds(timed.size());
    each(static_cast<int>(timed.size()), [&](int i) {
      const int tile = timed[i].first;
      TileWorker& worker = workers_.local();
      const auto time = [&](int realisations) {
        const double begin = thread_seconds();
        worker.work(tile, realisations, cancelled_, scratch);
        return thread_seconds() - begin;
      };
      if (query_.closed_form) {
        seconds[i] = time(2) / static_cast<double>(sampled[tile]);
        return;
      }
      time(2);  // opens what is opened once
      const double few = time(2), more = time(10);
      const double realisation = std::max(more - few, 0.0) / 8;
      const double once = std::max(few - 2 * realisation, 0.0);
      seconds[i] = (once + realisation * query_.realisations) / static_cast<double>(sampled[tile]);
    });
    double mean = 0;
    for (std::size_t i = 0; i < timed.size(); ++i) mean += timed[i].second * seconds[i] / draws;
    return mean;
  }

  // A node that is not sampled costs about as much as one realisation of one that is.
  double cost(std::size_t sampled) const {
    return 8192 + static_cast<double>(sampled) * query_.realisations;
  }

  Fit empty_fit() const {
    Fit fit;
    fit.nodes = nodes_;
    const std::size_t n = nodes_.count();
    for (std::vector<float>* grid :
         {&fit.mean, &fit.sigma, &fit.mean_error, &fit.sigma_error, &fit.skewness, &fit.kolmogorov})
      grid->resize(n);
    fit.anisotropy.resize(6 * n);
    return fit;
  }

  template <class Work>
  void each(int n, const Work& work) {
    arena_.execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<int>(0, n, 1),
          [&](const tbb::blocked_range<int>& range) {
            for (int i = range.begin(); i != range.end(); ++i) work(i);
          },
          tbb::simple_partitioner());
    });
  }

  std::vector<std::size_t> counts() {
    std::vector<std::size_t> sampled(tiles_of(nodes_));
    each(static_cast<int>(sampled.size()), [&](int tile) {
      if (!cancelled_) sampled[tile] = workers_.local().count(tile);
    });
    return sampled;
  }

  // Works in a thread of its own while the calling thread reports; false if cancelled.
  bool watched(const std::function<void()>& work, const std::function<bool(double)>& progress) {
    std::mutex mutex;
    std::condition_variable changed;
    bool finished = false;
    std::exception_ptr failure;
    std::thread thread([&] {
      try {
        work();
      } catch (...) {
        failure = std::current_exception();
      }
      std::lock_guard lock(mutex);
      finished = true;
      changed.notify_all();
    });
    std::exception_ptr refused;
    std::unique_lock lock(mutex);
    while (!changed.wait_for(lock, kProgressInterval, [&] { return finished; })) {
      lock.unlock();
      try {
        if (!progress(std::min<double>(done_, 1))) cancelled_ = true;
      } catch (...) {
        refused = std::current_exception();
        cancelled_ = true;
      }
      lock.lock();
      if (cancelled_) break;
    }
    lock.unlock();
    thread.join();
    if (refused) std::rethrow_exception(refused);
    if (failure) std::rethrow_exception(failure);
    return !cancelled_ && progress(1);
  }

  FitQuery query_;
  NodeGrid nodes_;
  Composition composition_;
  tbb::task_arena arena_;
  tbb::enumerable_thread_specific<TileWorker> workers_;
  std::atomic<bool> cancelled_{false};
  std::atomic<double> done_{0};
};

}  // namespace

std::optional<Fit> compose_and_fit(const TreePtr& tree, const FitQuery& query,
                                   const std::function<bool(double)>& progress) {
  return Fitter(tree, query).run(progress);
}

FitPlan plan_fit(const TreePtr& tree, const FitQuery& query) {
  return Fitter(tree, query).plan();
}

}  // namespace gpis
