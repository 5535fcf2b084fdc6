#include "binding/result_file.h"

#include "binding/arguments.h"
#include "binding/bind_film.h"
#include "binding/reader.h"
#include "core/errors.h"

namespace gpis {

namespace {

const char* const kFormat = "gpis result 2";

py::list ranges_list(const RenderResult& result) {
  py::list ranges;
  for (const SampleRange& r : result.ranges) {
    py::dict row;
    row["seed"] = r.seed;
    row["first"] = r.first;
    row["count"] = r.count;
    ranges.append(row);
  }
  return ranges;
}

py::object bad_sample_dict(const RenderResult& result) {
  if (!result.bad_sample) return py::none();
  py::dict d;
  d["x"] = result.bad_sample->x;
  d["y"] = result.bad_sample->y;
  d["sample"] = result.bad_sample->sample;
  return d;
}

py::object text_or_none(const std::string& text) {
  return text.empty() ? py::object(py::none()) : py::str(text);
}

void read_facts(const py::dict& facts, RenderResult& result) {
  const py::dict counters = facts["counters"];
#define X(name, meaning) \
  if (counters.contains(#name)) result.counters.name = py::cast<std::uint64_t>(counters[#name]);
  GPIS_COUNTERS(X)
#undef X
  for (const py::handle row : facts["history"])
    result.history.push_back({py::cast<double>(row["seconds"]), py::cast<double>(row["samples"]),
                              py::cast<double>(row["estimated_error"])});
  for (const py::handle row : facts["ranges"])
    result.ranges.push_back({py::cast<std::uint64_t>(row["seed"]),
                             py::cast<std::int64_t>(row["first"]),
                             py::cast<std::int64_t>(row["count"])});
  const py::object bad = facts["first_nan_sample"];
  if (!bad.is_none())
    result.bad_sample =
        BadSample{py::cast<std::int64_t>(bad["sample"]), py::cast<std::int64_t>(bad["x"]),
                  py::cast<std::int64_t>(bad["y"])};
  result.seconds = py::cast<double>(facts["seconds"]);
  result.threads = py::cast<int>(facts["threads"]);
  result.cancelled = py::cast<bool>(facts["cancelled"]);
  const py::object stopped = facts["stopped_by"];
  if (!stopped.is_none()) result.stopped_by = py::cast<std::string>(stopped);
}

}  // namespace

py::list history_list(const RenderResult& result) {
  py::list history;
  for (const HistoryRow& h : result.history) {
    py::dict row;
    row["seconds"] = h.seconds;
    row["samples"] = h.samples;
    row["estimated_error"] = h.estimated_error;
    history.append(row);
  }
  return history;
}

py::dict stats_dict(const RenderResult& r) {
  py::dict stats = counters_dict(r.counters);
  const double rays = static_cast<double>(r.counters.mesh_rays + r.counters.line_segments +
                                          r.counters.line_skipped);
  stats["width"] = r.film.width();
  stats["height"] = r.film.height();
  stats["seconds"] = r.seconds;
  stats["threads"] = r.threads;
  stats["samples"] = r.film.mean_sample_count();
  stats["estimated_error"] = r.film.estimated_error();
  stats["camera_paths_per_second"] =
      r.seconds > 0 ? static_cast<double>(r.counters.camera_paths) / r.seconds : 0;
  stats["rays_per_second"] = r.seconds > 0 ? rays / r.seconds : 0;
  stats["stopped_by"] = text_or_none(r.stopped_by);
  stats["cancelled"] = r.cancelled;
  stats["first_nan_sample"] = bad_sample_dict(r);
  stats["ranges"] = ranges_list(r);
  return stats;
}

void save_result(const RenderResult& result, const py::object& path) {
  py::dict facts;
  facts["counters"] = counters_dict(result.counters);
  facts["history"] = history_list(result);
  facts["ranges"] = ranges_list(result);
  facts["first_nan_sample"] = bad_sample_dict(result);
  facts["seconds"] = result.seconds;
  facts["threads"] = result.threads;
  facts["cancelled"] = result.cancelled;
  facts["stopped_by"] = text_or_none(result.stopped_by);
  py::dict arrays = film_arrays(result.film);
  arrays["format"] = kFormat;
  arrays["facts"] = py::module_::import("json").attr("dumps")(facts);

  check_replaceable(path_argument(path, "save: path"), "save: path");
  const py::module_ os = py::module_::import("os");
  const py::object name = os.attr("fsdecode")(path);
  const py::object unfinished = name + py::str(".unfinished");
  const py::object file = py::module_::import("builtins").attr("open")(unfinished, "wb");
  try {
    py::module_::import("numpy").attr("savez")(file, **arrays);
  } catch (...) {
    file.attr("close")();
    os.attr("unlink")(unfinished);
    throw;
  }
  file.attr("close")();
  os.attr("replace")(unfinished, name);
}

std::shared_ptr<RenderResult> load_result(const py::object& path) {
  const std::string name = path_argument(path, "load_result: path");
  if (!py::cast<bool>(py::module_::import("os").attr("path").attr("isfile")(path)))
    throw FileNotFound("load_result: there is no file '" + name + "'");
  auto result = std::make_shared<RenderResult>();
  try {
    const py::object archive =
        py::module_::import("numpy").attr("load")(path, py::arg("allow_pickle") = false);
    if (!py::str(archive["format"]).equal(py::str(kFormat)))
      throw std::invalid_argument("it is of another format");
    read_facts(py::module_::import("json").attr("loads")(py::str(archive["facts"])), *result);
    result->film = film_from_arrays(archive);
    archive.attr("close")();
  } catch (const py::error_already_set& e) {
    if (e.matches(PyExc_KeyboardInterrupt) || e.matches(PyExc_MemoryError)) throw;
    refuse("load_result", "'" + name + "' is not a result that save wrote, or it is damaged (" +
                              std::string(py::str(e.value())) + ")");
  } catch (const std::exception& e) {
    refuse("load_result",
           "'" + name + "' is not a result that save wrote, or it is damaged (" + e.what() + ")");
  }
  return result;
}

}  // namespace gpis
