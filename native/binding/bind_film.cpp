#include "binding/bind_film.h"

#include "binding/reader.h"
#include "core/block_points.h"

namespace gpis {

namespace {

py::array_t<float> pass(const Film& film, std::vector<float> values) {
  const py::ssize_t channels =
      static_cast<py::ssize_t>(values.size()) / film.width() / film.height();
  auto* kept = new std::vector<float>(std::move(values));
  const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<float>*>(p); });
  return py::array_t<float>({py::ssize_t{film.height()}, py::ssize_t{film.width()}, channels},
                            kept->data(), owner);
}

// Samples of one pixel made elsewhere, as a render would add them.
void add_samples(Film& film, int x, int y, const py::object& radiance, int first_sample) {
  if (x < 0 || y < 0 || x >= film.width() || y >= film.height())
    refuse("add",
           "pixel (" + std::to_string(x) + ", " + std::to_string(y) + ") lies outside the film");
  if (first_sample < 0 || first_sample % kBlockSamples)
    refuse("first_sample", "takes a multiple of 16");
  const auto values = DoubleArray::ensure(radiance);
  if (!values || values.ndim() != 2 || values.shape(1) != 3)
    refuse("radiance", "takes numbers of shape (N, 3)");
  Counters counters;
  for (py::ssize_t i = 0; i < values.shape(0);) {
    const SampleBlock place = block_of(first_sample + static_cast<int>(i));
    const py::ssize_t end =
        std::min<py::ssize_t>(place.first + place.size - first_sample, values.shape(0));
    PixelBlock block;
    for (; i < end; ++i)
      block.add({{values.at(i, 0), values.at(i, 1), values.at(i, 2)}, 1, kInfinity, {}, {}},
                counters);
    film.add(static_cast<std::size_t>(y) * film.width() + x, block);
  }
}

}  // namespace

py::dict film_passes(const Film& film) {
  py::dict passes;
  passes["combined"] = pass(film, film.combined());
  passes["depth"] = pass(film, film.depth());
  passes["normal"] = pass(film, film.normal());
  passes["albedo"] = pass(film, film.albedo());
  passes["variance"] = pass(film, film.variance());
  passes["sample_count"] = pass(film, film.sample_count());
  return passes;
}

// Saved as: wide (H, W, 11, 2) the 128-bit sums, low word first; narrow (H, W, 8); counts (H, W,
// 3).
py::dict film_arrays(const Film& film) {
  const py::ssize_t h = film.height(), w = film.width();
  py::array_t<std::uint64_t> wide({h, w, py::ssize_t{11}, py::ssize_t{2}});
  py::array_t<std::int64_t> narrow({h, w, py::ssize_t{8}});
  py::array_t<std::uint32_t> counts({h, w, py::ssize_t{3}});
  std::uint64_t* to_wide = wide.mutable_data();
  std::int64_t* to_narrow = narrow.mutable_data();
  std::uint32_t* to_counts = counts.mutable_data();
  const auto put = [&to_wide](Fixed v) {
    *to_wide++ = static_cast<std::uint64_t>(v);
    *to_wide++ = static_cast<std::uint64_t>(v >> 64);
  };
  for (const PixelSums& p : film.pixels()) {
    for (const Fixed v : p.radiance) put(v);
    for (const Fixed v : p.squares) put(v);
    for (const Fixed v : p.weighted) put(v);
    put(p.depth);
    *to_narrow++ = p.alpha;
    for (const std::int64_t v : p.normal) *to_narrow++ = v;
    for (const std::int64_t v : p.albedo) *to_narrow++ = v;
    *to_narrow++ = p.sizes;
    for (const std::uint32_t v : {p.count, p.hits, p.blocks}) *to_counts++ = v;
  }
  py::dict arrays;
  arrays["wide"] = wide;
  arrays["narrow"] = narrow;
  arrays["counts"] = counts;
  return arrays;
}

Film film_from_arrays(const py::handle& arrays) {
  const auto wide = py::cast<py::array_t<std::uint64_t, py::array::c_style>>(arrays["wide"]);
  const auto narrow = py::cast<py::array_t<std::int64_t, py::array::c_style>>(arrays["narrow"]);
  const auto counts = py::cast<py::array_t<std::uint32_t, py::array::c_style>>(arrays["counts"]);
  if (wide.ndim() != 4 || wide.shape(2) != 11 || wide.shape(3) != 2 || narrow.ndim() != 3 ||
      narrow.shape(2) != 8 || counts.ndim() != 3 || counts.shape(2) != 3 ||
      narrow.shape(0) != wide.shape(0) || counts.shape(0) != wide.shape(0) ||
      narrow.shape(1) != wide.shape(1) || counts.shape(1) != wide.shape(1) || wide.size() == 0)
    throw std::invalid_argument("the arrays of its film do not fit together");
  Film film(static_cast<int>(wide.shape(1)), static_cast<int>(wide.shape(0)));
  const std::uint64_t* from_wide = wide.data();
  const std::int64_t* from_narrow = narrow.data();
  const std::uint32_t* from_counts = counts.data();
  const auto take = [&from_wide] {
    const Fixed low = *from_wide++;
    return low | static_cast<Fixed>(static_cast<unsigned __int128>(*from_wide++) << 64);
  };
  for (PixelSums& p : film.pixels()) {
    for (Fixed& v : p.radiance) v = take();
    for (Fixed& v : p.squares) v = take();
    for (Fixed& v : p.weighted) v = take();
    p.depth = take();
    p.alpha = *from_narrow++;
    for (std::int64_t& v : p.normal) v = *from_narrow++;
    for (std::int64_t& v : p.albedo) v = *from_narrow++;
    p.sizes = *from_narrow++;
    p.count = *from_counts++;
    p.hits = *from_counts++;
    p.blocks = *from_counts++;
  }
  return film;
}

void bind_film(py::module_& m) {
  py::class_<Film>(m, "Film",
                   "The film alone, for samples made elsewhere: exact sums over blocks of 16 "
                   "samples per pixel, of 8 in the first two.\n"
                   "Film(width, height); row 0 is at the bottom.")
      .def(py::init([](int width, int height) {
             if (width < 1 || height < 1) refuse("Film", "takes a positive width and height");
             return Film(width, height);
           }),
           py::arg("width"), py::arg("height"))
      .def("add", &add_samples, py::arg("x"), py::arg("y"), py::arg("radiance"),
           py::arg("first_sample") = 0,
           "Adds consecutive samples radiance (N, 3) of pixel (x, y), the first of which has a "
           "number that is a multiple of 16.\n"
           "Samples that are not finite are left out.")
      .def(
          "merge", [](Film& film, const Film& other) { film.add(other); }, py::arg("other"),
          "Adds a film of the same size that holds other blocks.")
      .def_property_readonly("passes", &film_passes, "Passes as of a render's result.")
      .def_property_readonly("estimated_error", &Film::estimated_error,
                             "Mean over pixels of variance / (mean² - variance + .01), on "
                             "luminance; the difference is at least 0.");
}

}  // namespace gpis
