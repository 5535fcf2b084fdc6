// What a render leaves: its film, how it went, and which samples it holds. Results of other samples
// of the same picture merge.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/counters.h"
#include "render/film.h"

namespace gpis {

struct HistoryRow {
  double seconds, samples, estimated_error;  // samples: mean over pixels
};

// The samples a result was made of: what may not be merged twice.
struct SampleRange {
  std::uint64_t seed;
  std::int64_t first, count;
};

// The first sample (in order of sample, then pixel) that was not finite.
struct BadSample {
  std::int64_t sample, x, y;
};

struct RenderResult {
  Film film{0, 0};
  std::vector<HistoryRow> history;  // a row per round
  Counters counters;
  std::vector<SampleRange> ranges;
  std::optional<BadSample> bad_sample;
  double seconds = 0;
  int threads = 0;
  bool cancelled = false;
  std::string stopped_by;  // "samples", "time" or "noise"; empty if cancelled or merged
};

// The result of all their samples. Throws std::invalid_argument where sizes differ or samples would
// be counted twice.
RenderResult merge(const std::vector<const RenderResult*>& results);

}  // namespace gpis
