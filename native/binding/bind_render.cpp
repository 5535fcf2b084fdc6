#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cstdint>

#include "binding/arguments.h"
#include "binding/bind_film.h"
#include "binding/bindings.h"
#include "binding/reader.h"
#include "binding/result_file.h"
#include "core/block_points.h"
#include "render/session.h"
#include "scene/scene.h"

namespace gpis {

namespace {

constexpr std::int64_t kMostSamples = 1 << 30;

std::int64_t integer(const py::object& value, const char* name, std::int64_t min, std::int64_t max,
                     const std::string& takes) {
  const bool is_bool = py::isinstance<py::bool_>(value);
  if (is_bool || !PyIndex_Check(value.ptr()))
    refuse(name, "takes " + takes + ", got " + shown(value));
  const py::int_ number = py::reinterpret_steal<py::int_>(PyNumber_Index(value.ptr()));
  int overflow = 0;
  const long long v = PyLong_AsLongLongAndOverflow(number.ptr(), &overflow);
  if (overflow || v < min || v > max) refuse(name, "takes " + takes + ", got " + shown(value));
  return v;
}

double positive(const py::object& value, const char* name, const std::string& takes) {
  const double v = to_number(value, name);
  if (!(v > 0 && v < kInfinity)) refuse(name, "takes " + takes + ", got " + shown(value));
  return v;
}

// The scene itself, or one whose processes all have another memory.
std::shared_ptr<const Scene> with_memory(const std::shared_ptr<const Scene>& scene,
                                         const py::object& memory) {
  if (memory.is_none()) return scene;
  const Memory wanted = memory_argument(to_text(memory, "memory"), "memory");
  SceneDescription description = scene->description();
  bool same = true;
  for (ObjectDescription& object : description.objects)
    if (object.type == ObjectDescription::Type::gpis && object.memory != wanted) {
      object.memory = wanted;
      same = false;
    }
  if (same) return scene;
  py::gil_scoped_release release;
  return std::make_shared<const Scene>(std::move(description));
}

py::dict progress_stats(const Progress& p, const StoppingRules& rules) {
  const double noise = std::sqrt(p.estimated_error);
  py::dict stats;
  stats["seconds"] = p.seconds;
  stats["samples"] = p.samples;
  stats["estimated_error"] = p.estimated_error;
  stats["remaining"] = p.remaining;
  stats["error_left"] =
      rules.noise_threshold ? std::max(0.0, noise - *rules.noise_threshold) : noise;
  return stats;
}

// Calls Python: takes the lock, lets Ctrl-C through.
ProgressCallback progress_callback(const py::object& progress, const StoppingRules& rules) {
  return [&progress, rules](const Progress& p) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress.is_none()) return true;
    const py::object answer = progress(p.fraction, progress_stats(p, rules));
    return answer.is_none() || py::cast<bool>(py::bool_(answer));
  };
}

void warn_of_bad_samples(const RenderResult& result) {
  if (!result.bad_sample) return;
  const BadSample& bad = *result.bad_sample;
  py::module_::import("logging").attr("getLogger")("gpis").attr("warning")(
      "%d of the samples were not finite and are left out of the image; the first was sample %d of "
      "pixel (%d, %d).",
      result.counters.nan_samples, bad.sample, bad.x, bad.y);
}

const char* const kRenderDoc = R"(Renders a scene and returns a RenderResult.

width, height: pixels. At least one of these says when to stop; whichever is reached first does:
    samples: per pixel
    time_limit: seconds; every pixel gets at least one sample, so the limit is passed where one sample of all pixels takes longer.
        Stops with the pixel in hand: sample_count may then differ from pixel to pixel, by whole blocks of 16
    noise_threshold: stops when the square root of estimated_error is at most this (looked at from 64 samples on)
first_sample: number of the first sample, a multiple of 16: a slice of a longer render, see merge
seed: random streams depend on (seed, pixel, sample) only, so the image is the same bit by bit whatever `threads`
threads: 0 = all cores
memory: "none" | "renewal" | "renewal+" | "global-1" … "global-64" | "global" in place of what the objects say
progress: called as progress(fraction, stats) from the calling thread at most about ten times a second; stats holds seconds,
    samples (per pixel, mean), estimated_error (after the last round), remaining (estimated seconds; inf while unknown) and
    error_left (the square root of estimated_error, less noise_threshold if there is one). Returning False cancels: the result
    so far is returned, with stats["cancelled"] True. An exception ends the render and is raised here, as is Ctrl-C.

The Python lock is released while rendering; any number of renders may run at once from several threads.
Raises ValueError, with the name of the argument or the path in the description.)";

std::shared_ptr<RenderResult> render_scene(const py::object& scene, const py::object& width,
                                           const py::object& height, const py::object& samples,
                                           const py::object& time_limit,
                                           const py::object& noise_threshold,
                                           const py::object& first_sample, const py::object& seed,
                                           const py::object& threads, const py::object& memory,
                                           const py::object& progress) {
  RenderOptions options;
  options.width =
      static_cast<int>(integer(width, "width", 1, 65536, "a number of pixels, 1 to 65536"));
  options.height =
      static_cast<int>(integer(height, "height", 1, 65536, "a number of pixels, 1 to 65536"));
  options.first_sample = static_cast<int>(
      integer(first_sample, "first_sample", 0, kMostSamples, "a multiple of 16 from 0 to 2^30"));
  if (options.first_sample % kBlockSamples)
    refuse("first_sample", "takes a multiple of 16 (the film sums blocks of 16 samples), got " +
                               shown(first_sample));
  if (!samples.is_none())
    options.stop.samples =
        static_cast<int>(integer(samples, "samples", 1, kMostSamples, "an integer from 1 to 2^30"));
  if (!time_limit.is_none())
    options.stop.time_limit = positive(time_limit, "time_limit", "a positive number of seconds");
  if (!noise_threshold.is_none())
    options.stop.noise_threshold = positive(noise_threshold, "noise_threshold",
                                            "a positive number (relative noise, .05 for instance)");
  if (!options.stop.samples && !options.stop.time_limit && !options.stop.noise_threshold)
    refuse("render", "needs to know when to stop; give samples, time_limit or noise_threshold");
  options.seed = static_cast<std::uint64_t>(
      integer(seed, "seed", 0, INT64_MAX, "an integer from 0 to 2^63 - 1"));
  options.threads = static_cast<int>(
      integer(threads, "threads", 0, 1024, "a number of threads up to 1024, 0 for all cores"));
  if (!progress.is_none() && !PyCallable_Check(progress.ptr()))
    refuse("progress", "takes a function of (fraction, stats), got " + shown(progress));
  const std::shared_ptr<const Scene> rendered =
      with_memory(instance_argument<Scene>(scene, "scene", "a Scene (of a description)"), memory);

  const ProgressCallback callback = progress_callback(progress, options.stop);
  auto result = std::make_shared<RenderResult>();
  {
    const py::gil_scoped_release release;
    *result = render(*rendered, options, callback);
  }
  warn_of_bad_samples(*result);
  return result;
}

std::shared_ptr<RenderResult> merge_results(const py::object& results) {
  const auto items = to_items(results, "results");
  if (items.empty()) refuse("results", "takes at least one result, got none");
  std::vector<const RenderResult*> parts;
  for (const py::object& item : items) {
    if (!py::isinstance<RenderResult>(item))
      refuse("results", "takes a list of results, got " + shown(item) + " in it");
    parts.push_back(py::cast<const RenderResult*>(item));
  }
  const py::gil_scoped_release release;
  return std::make_shared<RenderResult>(merge(parts));
}

const char* const kPassesDoc = R"(dict of float32 arrays (H, W, C), row 0 at the bottom:
combined (4, premultiplied); depth (1, along the viewing axis, mean of the samples that hit, inf where none did); normal (3);
albedo (3); variance (3, of the pixel's mean; inf where there are fewer than two samples); sample_count (1).)";

const char* const kHistoryDoc = R"(A dict(seconds, samples, estimated_error) per round.

samples is the mean per pixel, estimated_error the mean over pixels of variance / (E² + .01) on luminance, E² = mean² - variance >= 0
(relMSE), inf while a pixel has fewer than two samples.)";

const char* const kStatsDoc = R"(dict: every counter, and what the render was.

width, height, seconds, threads, samples (mean per pixel), estimated_error, camera_paths_per_second, rays_per_second,
stopped_by ("samples", "time", "noise"; None if cancelled or merged), cancelled, first_nan_sample (None or dict(x, y, sample)),
ranges (list of dict(seed, first, count): the samples it was made of).)";

const char* const kSaveDoc =
    R"(Writes the result with its exact sums, so that what load_result returns can still be merged.

A numpy .npz file whatever the path is called; an older file is replaced when the new one is complete. Raises OSError.)";

const char* const kMergeDoc = R"(The result of all samples of several results of the same picture.

Slices (first_sample and samples multiples of 16, except the samples of the last) merge to the whole render bit by bit; results
of different seeds merge too. Raises ValueError where sizes differ or samples overlap.)";

// A property that is made when first asked for and kept.
template <class Make>
auto kept(const char* name, Make make) {
  return [name, make](const py::object& self) -> py::object {
    if (!py::hasattr(self, name)) self.attr(name) = make(self.cast<const RenderResult&>());
    return self.attr(name);
  };
}

}  // namespace

void bind_render(py::module_& m) {
  py::class_<RenderResult, std::shared_ptr<RenderResult>>(
      m, "RenderResult", py::dynamic_attr(), "What render, merge and load_result return.")
      .def_property_readonly(
          "passes", kept("_passes", [](const RenderResult& r) { return film_passes(r.film); }),
          kPassesDoc)
      .def_property_readonly("history", &history_list, kHistoryDoc)
      .def_property_readonly("stats", kept("_stats", &stats_dict), kStatsDoc)
      .def("save", &save_result, py::arg("path"), kSaveDoc);
  m.def("render", &render_scene, kRenderDoc, py::arg("scene"), py::arg("width"), py::arg("height"),
        py::kw_only(), py::arg("samples") = py::none(), py::arg("time_limit") = py::none(),
        py::arg("noise_threshold") = py::none(), py::arg("first_sample") = 0, py::arg("seed") = 0,
        py::arg("threads") = 0, py::arg("memory") = py::none(), py::arg("progress") = py::none());
  m.def("merge", &merge_results, py::arg("results"), kMergeDoc);
  m.def("load_result", &load_result, py::arg("path"),
        "A result written by result.save. Raises FileNotFoundError; ValueError where the file is "
        "something else or damaged.");
  m.def(
      "_next_round",
      [](int done, double seconds, double error, std::optional<int> samples,
         std::optional<double> time_limit, std::optional<double> noise_threshold) {
        const StoppingRules rules{samples, time_limit, noise_threshold};
        const RenderState state{done, seconds, error};
        static const char* const kStops[] = {"none", "samples", "time", "noise"};
        const Round round = next_round(rules, state);
        return py::make_tuple(round.count, kStops[static_cast<int>(round.stop)],
                              fraction_done(rules, state, done));
      },
      py::arg("done"), py::arg("seconds"), py::arg("error"), py::kw_only(),
      py::arg("samples") = py::none(), py::arg("time_limit") = py::none(),
      py::arg("noise_threshold") = py::none(),
      "The scheduler's answer (count, stop, fraction done) for a state of a render. For tests.");
}

}  // namespace gpis
