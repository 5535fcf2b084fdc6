#include "render/result.h"

#include <algorithm>
#include <stdexcept>

namespace gpis {

namespace {

std::string describe(const SampleRange& r) {
  return "samples " + std::to_string(r.first) + ".." + std::to_string(r.first + r.count - 1) +
         " of seed " + std::to_string(r.seed);
}

void add_ranges(std::vector<SampleRange>& to, const std::vector<SampleRange>& from) {
  for (const SampleRange& r : from) {
    for (const SampleRange& t : to)
      if (t.seed == r.seed && t.first < r.first + r.count && r.first < t.first + t.count)
        throw std::invalid_argument("merge: " + describe(t) + " and " + describe(r) +
                                    " overlap; render slices with different first_sample or seed");
    to.push_back(r);
  }
}

}  // namespace

RenderResult merge(const std::vector<const RenderResult*>& results) {
  if (results.empty()) throw std::invalid_argument("merge: got no result; give at least one");
  RenderResult merged;
  merged.film = Film(results[0]->film.width(), results[0]->film.height());
  for (const RenderResult* r : results) {
    add_ranges(merged.ranges, r->ranges);
    merged.film.add(r->film);
    merged.counters.add(r->counters);
    merged.seconds += r->seconds;
    merged.threads = std::max(merged.threads, r->threads);
    merged.cancelled = merged.cancelled || r->cancelled;
    if (!merged.bad_sample) merged.bad_sample = r->bad_sample;
  }
  if (results.size() == 1) {
    merged.history = results[0]->history;
    merged.stopped_by = results[0]->stopped_by;
  } else {
    merged.history = {
        {merged.seconds, merged.film.mean_sample_count(), merged.film.estimated_error()}};
  }
  return merged;
}

}  // namespace gpis
