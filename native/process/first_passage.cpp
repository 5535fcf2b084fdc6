#include "process/first_passage.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "core/lock_or_stop.h"
#include "field/constant_field.h"
#include "kernel/stationary_kernel.h"
#include "process/line_impl.h"
#include "process/plan.h"

namespace gpis {
namespace {

// Mean length of an excursion to which it is drawn, in length scales: beyond, and where rays are as
// long, drawing them takes seconds.
constexpr double kMostLength = 64;
constexpr std::size_t kFewestExcursions = 1 << 16;
// A ray that leaves the surface takes an excursion of nearly its slope: among those with smaller
// and with larger slopes, of this part. Short ones end with nearly the slope they began with.
constexpr double kNear = 1.0 / 16;
constexpr std::uint64_t kSeed = 0x45786375;

class UnitKernel final : public StationaryKernel {
 public:
  explicit UnitKernel(const Radial& radial) : StationaryKernel(radial, 1.0) {}
  std::string describe() const override { return "a kernel of unit length"; }
};

// Mean length of an excursion above 0 of level + g: the part of the line above over Rice's rate of
// its beginnings (oracle 2).
double mean_excursion(const Radial& radial, double level) {
  const double rate = std::sqrt(radial.lambda2()) / (2 * kPi) * std::exp(-0.5 * level * level);
  return 0.5 * std::erfc(-level / std::sqrt(2.0)) / rate;
}

// Where rays are short against excursions these are drawn so far only.
double drawn_to(const Radial& radial, double level, double longest) {
  if (mean_excursion(radial, level) <= kMostLength) return kInfinity;
  return std::exp2(std::ceil(std::log2(longest)));
}

}  // namespace

// By the slope with which they begin, in standard deviations of a slope and in equal steps of
// 1 - e^{-v}: all slopes are asked for, the small ones at grazing directions too.
struct FirstPassage::Excursions {
  std::vector<double> start, length, slope;
  double longest;  // to which they are drawn; infinite: to their end
};

// False: *stop became true meanwhile.
bool FirstPassage::draw(const Radial& radial, double level, double missed_root,
                        const std::atomic<bool>* stop, Excursions& out) {
  const std::size_t count = excursions(missed_root);
  for (auto* list : {&out.start, &out.length, &out.slope}) list->resize(count);
  // Nothing is as long as 32 times the mean, by e^{-32} or less.
  const double far = std::min(out.longest, std::max(8.0, 32 * mean_excursion(radial, level)));
  auto process = std::make_shared<GaussianProcess>();
  process->mean = std::make_shared<ConstantField>(level);
  process->sigma = std::make_shared<ConstantField>(1);
  process->kernel = std::make_shared<UnitKernel>(radial);
  process->bounds = Box3{{-1, -1, -1}, {far + 1, 1, 1}};
  const PlannedLine plan =
      plan_line(process, Memory::renewal_plus, Sampler::automatic, 0.1 * missed_root);
  const double deviation = std::sqrt(radial.lambda2());
  constexpr std::size_t kChunk = 1024;  // its own random numbers, whichever thread draws it
  const auto draw_chunk = [&](std::size_t chunk) {
    if (stop && *stop) return;
    Line line;
    Line::Impl& l = line.impl();
    l.plan = &plan;
    l.geometry = {{0, 0, 0}, {1, 0, 0}};
    Counters counters;
    Rng rng(kSeed, chunk);
    Start start{Start::Kind::value_slope, {}};
    for (std::size_t i = chunk * kChunk; i < (chunk + 1) * kChunk; ++i) {
      out.start[i] = -std::log1p(-(i + rng.uniform()) / count);
      start.state.gradient = {out.start[i] * deviation, 0, 0};
      l.stretches.clear();
      l.hit_t = kInfinity;
      const double t = plan.line_sampler->first_hit(plan, l, 0, far, start, rng, counters);
      out.length[i] = std::min(t, far);
      out.slope[i] = t < kInfinity ? l.hit_dg : -deviation;
    }
  };
  // A thread that waits here must not begin another ray, which would wait for this table.
  tbb::this_task_arena::isolate(
      [&] { tbb::parallel_for(std::size_t{0}, count / kChunk, draw_chunk); });
  return !(stop && *stop);
}

std::size_t FirstPassage::excursions(double missed_root) {
  const double least = 0.5 / (missed_root * missed_root);
  std::size_t count = kFewestExcursions;
  while (count < least && count <= kMostExcursions) count *= 2;
  return count;
}

bool FirstPassage::serves(const Radial& radial, double level, double longest) {
  return std::abs(level) <= 5 &&
         (longest <= kMostLength || mean_excursion(radial, level) <= kMostLength);
}

namespace {

// Entries with weights of mean 1 as a list of as many, by systematic sampling.
template <class Add>
void resample(const std::vector<double>& weight, Add add) {
  const std::size_t count = weight.size();
  double sum = 0, reached = 0;
  for (const double w : weight) sum += w;
  std::size_t added = 0;
  for (std::size_t i = 0; i < count; ++i) {
    reached += weight[i] / sum * count;
    for (; added + 0.5 < reached && added < count; ++added) add(i);
  }
  for (; added < count; ++added) add(count - 1);
}

}  // namespace

FirstPassage::FirstPassage(const Radial& radial, double level, const Excursions& drawn)
    : slope_deviation_(std::sqrt(radial.lambda2())), longest_(drawn.longest) {
  const std::size_t count = drawn.start.size();
  // Slopes with which excursions begin follow v e^{-v²/2} (B3), those drawn e^{-v}.
  std::vector<double> flux(count), tilt(count, 1);
  double sum = 0, mean = 0, square = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double v = drawn.start[i], x = drawn.length[i];
    flux[i] = v * std::exp(v - 0.5 * v * v);
    sum += flux[i];
    mean += flux[i] * x;
    square += flux[i] * x * x;
  }
  mean /= sum;
  // Their mean length is known exactly. Weights that are linear in the length give it to those
  // drawn, and take most of the sampling error of how far rays get with it (a control variate).
  const double exact = mean_excursion(radial, level);
  if (drawn.longest == kInfinity) {
    const double slope = (exact - mean) / (square / sum - mean * mean);
    for (std::size_t i = 0; i < count; ++i) tilt[i] += slope * (drawn.length[i] - mean);
  } else {
    met_ = std::min(1.0, mean / exact);
  }
  const auto length = [&](std::size_t i) { return static_cast<float>(drawn.length[i]); };
  leaving_.reserve(count);
  resample(tilt, [&](std::size_t i) {
    leaving_.push_back({length(i), static_cast<float>(drawn.slope[i])});
  });
  for (std::size_t i = 0; i < count; ++i) tilt[i] *= flux[i] * drawn.length[i];
  outside_.reserve(count);
  resample(tilt, [&](std::size_t i) {
    outside_.push_back({length(i), static_cast<float>(-drawn.start[i] * slope_deviation_)});
  });
}

FirstPassage::Passage FirstPassage::outside(Rng& rng) const {
  if (met_ < 1 && rng.uniform() >= met_) return {kInfinity, -slope_deviation_};
  const double x = rng.uniform() * outside_.size();
  const Stored& entry = outside_[static_cast<std::size_t>(x)];
  return {(x - std::floor(x)) * entry.length, entry.slope};
}

FirstPassage::Passage FirstPassage::leaving(double slope, Rng& rng) const {
  const double count = leaving_.size();
  const double here = -std::expm1(-slope / slope_deviation_) * count;
  const double around = kNear * std::min(here, count - here);
  const auto i = static_cast<std::size_t>(here + around * (rng.uniform() - 0.5));
  const Stored& entry = leaving_[std::min(i, leaving_.size() - 1)];
  return {entry.length < longest_ ? entry.length : kInfinity, entry.slope};
}

std::shared_ptr<const FirstPassage> FirstPassage::make(const Radial& radial, double level,
                                                       double longest, double missed_root,
                                                       const std::atomic<bool>* stop) {
  struct Kept {
    Radial radial;
    double level, longest, missed_root;
    std::shared_ptr<const FirstPassage> table;
  };
  static std::timed_mutex mutex;
  static std::deque<Kept> kept;
  constexpr std::size_t kMostKept = 4;
  Excursions drawn;
  drawn.longest = drawn_to(radial, level, longest);
  const auto lock = lock_or_stop(mutex, stop);
  if (!lock) return nullptr;
  for (const Kept& k : kept)
    if (k.radial.family == radial.family && k.radial.alpha == radial.alpha && k.level == level &&
        k.longest == drawn.longest && k.missed_root == missed_root)
      return k.table;
  if (!draw(radial, level, missed_root, stop, drawn)) return nullptr;
  std::shared_ptr<const FirstPassage> table(new FirstPassage(radial, level, drawn));
  kept.push_front({radial, level, drawn.longest, missed_root, table});
  if (kept.size() > kMostKept) kept.pop_back();
  return table;
}

}  // namespace gpis
