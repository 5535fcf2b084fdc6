// First passage of a constant mean and one radial correlation (math.md §9, definitions B8): in
// length scales along the ray it depends on the level μ/σ and the slope at the start alone, so it
// is drawn once, into a table, and then taken from there.
//
// What is drawn are excursions above the level that begin on the surface, by the line sampler that
// would march the rays. They say all: a ray that leaves the surface takes one that began with its
// slope; a ray from outside starts, since the process is stationary, at a uniform point of an
// excursion taken as often as it is long, and read backwards (reversed, a stationary process is
// itself) the excursion ends with the slope it began with.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <vector>

#include "core/rng.h"
#include "kernel/radial.h"

namespace gpis {

class FirstPassage {
 public:
  // In length scales, of g at variance 1; the slope at the end is negative.
  struct Passage {
    double length, slope;
  };

  static constexpr std::size_t kMostExcursions = 1 << 22;
  // Whether drawing it takes no longer than a second or two: `level` = μ/σ; rays go at most
  // `longest` length scales.
  static bool serves(const Radial& radial, double level, double longest);
  // One table a process and level; the last few are kept. Null: *stop became true meanwhile.
  static std::shared_ptr<const FirstPassage> make(const Radial& radial, double level,
                                                  double longest, double missed_root,
                                                  const std::atomic<bool>* stop);

  // How many are drawn: the standard deviation of a probability, √(p(1-p)/n), stays below .71
  // missed_root, for rays of all slopes together. Rays of nearly one slope share few of them:
  // 12,000 at a deviation, some hundreds at a hundredth of it, where what a table says is off by as
  // much more. Which excursions it holds does not depend on a render's seed.
  static std::size_t excursions(double missed_root);

  // From outside, nothing else known.
  Passage outside(Rng& rng) const;
  // From the surface with a slope > 0, a length scale.
  Passage leaving(double slope, Rng& rng) const;

 private:
  // Single precision: a table twice as large would leave the cache.
  struct Stored {
    float length, slope;
  };
  struct Excursions;
  static bool draw(const Radial& radial, double level, double missed_root,
                   const std::atomic<bool>* stop, Excursions& out);
  FirstPassage(const Radial& radial, double level, const Excursions& drawn);

  double slope_deviation_;  // √λ₂
  double longest_;          // to which excursions were drawn
  double met_ = 1;          // probability that a ray from outside meets the surface in `longest`
  std::vector<Stored> outside_;  // as often as they are long; slope: of the beginning, negative
  std::vector<Stored> leaving_;  // by the slope at their beginning; slope: of the end
};

}  // namespace gpis
