#include "render/session.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>

#include "core/block_points.h"
#include "integrator/path_tracer.h"
#include "render/filter.h"
#include "scene/camera.h"
#include "scene/scene.h"

namespace gpis {

namespace {

using Clock = std::chrono::steady_clock;

// A tile of one block is the unit of work: small, since a slow path may take a millisecond.
constexpr int kTileSize = 8;
constexpr auto kProgressInterval = std::chrono::milliseconds(100);
constexpr auto kPollInterval = std::chrono::milliseconds(25);

// The random word of a block. Sixteens of samples count down from the end of the substreams,
// samples up from 0; the second block of a sixteen has its second number.
std::uint64_t block_scramble(std::uint64_t seed, std::uint64_t pixel, const SampleBlock& block) {
  Rng words(seed, pixel, ~static_cast<std::uint64_t>(block.first / kBlockSamples));
  const std::uint64_t word = words();
  return block.first % kBlockSamples == 0 ? word : words();
}

class Session {
 public:
  Session(const Scene& scene, const RenderOptions& options)
      : scene_(scene),
        options_(options),
        camera_(scene.description().camera, options.width, options.height),
        filter_(scene.description().settings.filter, scene.description().settings.filter_width),
        clamp_(scene.description().settings.clamp),
        tiles_x_((options.width + kTileSize - 1) / kTileSize),
        tiles_((options.height + kTileSize - 1) / kTileSize * tiles_x_),
        result_(empty_result(options.width, options.height)),
        tile_locks_(tiles_) {}

  RenderResult run(const ProgressCallback& progress) {
    try {
      start_threads();
      run_rounds(progress);
    } catch (...) {
      stop_threads(true);
      throw;
    }
    stop_threads(false);
    if (failure_) std::rethrow_exception(failure_);
    finish();
    return std::move(result_);
  }

 private:
  struct Worker {
    std::thread thread;
    Counters counters;
    std::optional<BadSample> bad_sample;
  };

  static RenderResult empty_result(int width, int height) {
    try {
      RenderResult result;
      result.film = Film(width, height);
      return result;
    } catch (const std::bad_alloc&) {
      const double bytes = sizeof(PixelSums) * static_cast<double>(width) * height;
      throw std::runtime_error("A picture of " + std::to_string(width) + " x " +
                               std::to_string(height) + " pixels takes " +
                               std::to_string(static_cast<std::int64_t>(bytes / 1e9) + 1) +
                               " GB of memory, which is not to be had. Render a smaller one, or in "
                               "parts (a border).");
    }
  }

  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  void start_threads() {
    int n = options_.threads > 0 ? options_.threads
                                 : static_cast<int>(std::thread::hardware_concurrency());
    result_.threads = n = std::max(n, 1);
    workers_.resize(n);
    for (Worker& w : workers_) w.thread = std::thread([this, &w] { work(w); });
  }

  void stop_threads(bool cancel) {
    if (cancel) cancelled_ = true;
    {
      std::lock_guard lock(mutex_);
      quit_ = true;
    }
    round_started_.notify_all();
    for (Worker& w : workers_)
      if (w.thread.joinable()) w.thread.join();
  }

  // The calling thread.

  void run_rounds(const ProgressCallback& progress) {
    RenderState state{0, 0, kInfinity};
    for (;;) {
      const Round round = next_round(options_.stop, state);
      if (round.count == 0) return stop(round.stop);
      result_.ranges = {{options_.seed, options_.first_sample, state.samples + round.count}};
      if (!run_round(state, round.count, progress)) {
        result_.cancelled = true;
        return;
      }
      state.samples += round.count;
      state.seconds = seconds();
      state.estimated_error = result_.film.estimated_error();
      result_.history.push_back(
          {state.seconds, result_.film.mean_sample_count(), state.estimated_error});
      if (time_is_up_) return stop(Round::Stop::time);
    }
  }

  void stop(Round::Stop reason) {
    result_.stopped_by = reason == Round::Stop::samples ? "samples"
                         : reason == Round::Stop::time  ? "time"
                                                        : "noise";
  }

  // `count` more samples of every pixel; false if cancelled or failed on the way.
  bool run_round(const RenderState& state, int count, const ProgressCallback& progress) {
    std::unique_lock lock(mutex_);
    round_first_ = state.samples;
    round_count_ = count;
    items_ = static_cast<std::int64_t>((count + kBlockSamples - 1) / kBlockSamples) * tiles_;
    next_item_ = 0;
    busy_ = static_cast<int>(workers_.size());
    if (state.samples > 0 &&
        options_.stop.time_limit)  // every pixel gets its first sample, whatever the limit
      deadline_ = start_ + std::chrono::duration_cast<Clock::duration>(
                               std::chrono::duration<double>(*options_.stop.time_limit));
    ++round_number_;
    round_started_.notify_all();
    for (bool finished = false; !finished;) {
      finished = round_finished_.wait_for(lock, kPollInterval, [this] { return busy_ == 0; });
      lock.unlock();
      if (!cancelled_ && !report(state, progress)) cancelled_ = true;
      lock.lock();
    }
    return !cancelled_;
  }

  bool report(const RenderState& state, const ProgressCallback& progress) {
    if (!progress || Clock::now() < next_progress_) return true;
    next_progress_ = Clock::now() + kProgressInterval;
    RenderState now = state;
    now.seconds = seconds();
    Progress p;
    p.seconds = now.seconds;
    p.samples =
        static_cast<double>(paths_done_) / (static_cast<double>(options_.width) * options_.height);
    p.estimated_error = state.estimated_error;
    fraction_ = std::max(
        fraction_,
        fraction_done(options_.stop, now, p.samples));  // an estimate may move back, a bar not
    p.fraction = fraction_;
    if (fraction_ > 0) p.remaining = now.seconds * (1 - fraction_) / fraction_;
    return progress(p);
  }

  void finish() {
    for (const Worker& w : workers_) {
      result_.counters.add(w.counters);
      if (w.bad_sample && (!result_.bad_sample || earlier(*w.bad_sample, *result_.bad_sample)))
        result_.bad_sample = w.bad_sample;
    }
    result_.seconds = seconds();
  }

  static bool earlier(const BadSample& a, const BadSample& b) {
    return std::tie(a.sample, a.y, a.x) < std::tie(b.sample, b.y, b.x);
  }

  // The render threads.

  void work(Worker& worker) {
    std::unique_ptr<PathTracer> tracer;
    for (std::int64_t seen = 0;;) {
      {
        std::unique_lock lock(mutex_);
        round_started_.wait(lock, [&] { return quit_ || round_number_ != seen; });
        if (quit_) return;
        seen = round_number_;
      }
      try {
        if (!tracer) tracer = std::make_unique<PathTracer>(scene_, &cancelled_);
        for (std::int64_t item; !cancelled_ && (item = next_item_++) < items_;)
          if (!render_tile(*tracer, worker, static_cast<int>(item % tiles_),
                           static_cast<int>(item / tiles_)))
            break;
      } catch (...) {
        std::lock_guard lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
        cancelled_ = true;
      }
      std::lock_guard lock(mutex_);
      if (--busy_ == 0) round_finished_.notify_all();
    }
  }

  // Sixteen samples of the round for all pixels of a tile. False when time is up or the render is
  // cancelled.
  bool render_tile(PathTracer& tracer, Worker& worker, int tile, int block_in_round) {
    const int first = round_first_ + block_in_round * kBlockSamples;
    const int last = std::min(first + kBlockSamples, round_first_ + round_count_);
    const int x0 = tile % tiles_x_ * kTileSize, y0 = tile / tiles_x_ * kTileSize;
    for (int y = y0; y < std::min(y0 + kTileSize, options_.height); ++y)
      for (int x = x0; x < std::min(x0 + kTileSize, options_.width); ++x) {
        if (Clock::now() >= deadline_) {
          time_is_up_ = true;
          return false;
        }
        for (int sample = options_.first_sample + first; sample < options_.first_sample + last;) {
          const SampleBlock place = block_of(sample);
          const bool continues = sample != place.first;
          const std::uint64_t scramble = block_scramble(
              options_.seed, static_cast<std::uint64_t>(y) * options_.width + x, place);
          PixelBlock block;
          const int end = std::min(place.first + place.size, options_.first_sample + last);
          paths_done_ += end - sample;
          for (; sample < end; ++sample) {
            if (cancelled_) return false;
            add_sample(tracer, worker, x, y, sample, place, scramble, block);
          }
          if (cancelled_) return false;  // the last sample may have been cut short
          std::lock_guard tile_lock(tile_locks_[tile]);
          result_.film.add(static_cast<std::size_t>(y) * options_.width + x, block, continues);
        }
      }
    return true;
  }

  void add_sample(PathTracer& tracer, Worker& worker, int x, int y, int sample,
                  const SampleBlock& block, std::uint64_t scramble, PixelBlock& to) {
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) * options_.width + x;
    Rng rng(options_.seed, pixel, sample);
    const BlockPoints points(scramble, sample - block.first, block.size);
    const SquarePoint point = points.point(kPixelDecision, rng);
    const CameraRay ray =
        camera_.ray(x + 0.5 + filter_.offset(point.u), y + 0.5 + filter_.offset(point.v));
    const PathSample path = tracer.trace(ray.ray, ray.t_max, points, rng, worker.counters);

    FilmSample film_sample{path.radiance, path.alpha, ray.depth(path.depth), path.normal,
                           path.albedo};
    const double brightest = max_component(path.radiance);
    if (clamp_ > 0 && brightest > clamp_ && std::isfinite(brightest)) {
      film_sample.radiance *= clamp_ / brightest;
      ++worker.counters.clamped_samples;
    }
    if (!to.add(film_sample, worker.counters)) {
      const BadSample bad{sample, x, y};
      if (!worker.bad_sample || earlier(bad, *worker.bad_sample)) worker.bad_sample = bad;
    }
  }

  const Scene& scene_;
  const RenderOptions options_;
  const Camera camera_;
  const PixelFilter filter_;
  const double clamp_;
  const int tiles_x_, tiles_;
  const Clock::time_point start_ = Clock::now();

  RenderResult result_;
  std::vector<std::mutex> tile_locks_;  // two blocks of one tile may be in hand at once
  std::vector<Worker> workers_;
  double fraction_ = 0;
  Clock::time_point next_progress_ = start_;

  std::mutex mutex_;  // guards what follows up to busy_
  std::condition_variable round_started_, round_finished_;
  std::exception_ptr failure_;
  std::int64_t round_number_ = 0;
  bool quit_ = false;
  int busy_ = 0;
  // Set before a round starts, constant in it.
  int round_first_ = 0, round_count_ = 0;
  std::int64_t items_ = 0;
  Clock::time_point deadline_ = Clock::time_point::max();

  std::atomic<std::int64_t> next_item_ = 0, paths_done_ = 0;
  std::atomic<bool> cancelled_ = false, time_is_up_ = false;
};

}  // namespace

RenderResult render(const Scene& scene, const RenderOptions& options,
                    const ProgressCallback& progress) {
  return Session(scene, options).run(progress);
}

}  // namespace gpis
