// The film: per pixel, exact sums over blocks of samples (core/block_points.h), and the passes and
// error estimate made of them.
//
// Sums are integers (fixed point), so they do not depend on the order of addition: an image is the
// same bit by bit whatever the threads, and merged slices equal the whole. The variance of a
// pixel's mean comes from the spread of its block sums (a block's samples may depend on each other,
// blocks do not): with sums S_b of n_b samples, S = Σ S_b, n = Σ n_b, m = S / n,
//   Var(m) = Σ (S_b - n_b m)² / (n² - Σ n_b²),
// which is unbiased where Var(S_b) goes as n_b, and close where a part of a block has a larger
// share of it than a whole one (its samples depend on each other less).
// A pixel with one block only is treated as if each of its samples were a block.
#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "core/counters.h"
#include "core/vec.h"

namespace gpis {

// Fixed point, 128 bits. Radiance and depth: steps of 2^-64, up to 9e18; squares: steps of 2^-56,
// up to 2e21, where they stay: the variance is then infinite.
using Fixed = __int128;
// Samples are limited to this radiance so that sums of radiance cannot overflow before 2^33 of them
// (counted as clamped).
inline constexpr double kRadianceLimit = 0x1p30;

// The sums of one pixel over the samples it holds.
struct PixelSums {
  std::array<Fixed, 3> radiance{};
  // Of red, green, blue and luminance: Σ x² over samples where there is one block, Σ S_b² / 16.
  std::array<Fixed, 4> squares{};
  std::array<Fixed, 3> weighted{};  // Σ n_b S_b / 16, 0 where there is one block
  Fixed depth = 0;                  // over the samples that hit something
  std::int64_t alpha = 0;           // this and the following in steps of 2^-32
  std::array<std::int64_t, 3> normal{}, albedo{};
  std::int64_t sizes = 0;    // Σ n_b², 0 where there is one block
  std::uint32_t count = 0;   // finite samples
  std::uint32_t hits = 0;    // those with a finite depth
  std::uint32_t blocks = 0;  // blocks with at least one finite sample

  bool operator==(const PixelSums&) const = default;
};

// One camera sample as the film takes it.
struct FilmSample {
  Color radiance;
  double alpha = 1, depth = kInfinity;
  Vec3 normal;
  Color albedo;
};

// The samples of one pixel that belong to one block (or to the part of it that is rendered in one
// go).
class PixelBlock {
 public:
  // False where the sample is not finite: counted and left out.
  bool add(const FilmSample& sample, Counters& counters);

 private:
  friend class Film;
  PixelSums sums_;  // squares of single samples
};

class Film {
 public:
  Film(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  std::vector<PixelSums>& pixels() { return pixels_; }
  const std::vector<PixelSums>& pixels() const { return pixels_; }

  // Adds a block to pixel `index` (row 0 at the bottom). `continues`: these are further samples of
  // the pixel's first block.
  void add(std::size_t index, const PixelBlock& block, bool continues = false);
  // Adds a film of the same size that holds other blocks.
  void add(const Film& other);

  // Passes of `channels` floats per pixel, rows from the bottom.
  std::vector<float> combined() const;  // 4, premultiplied
  std::vector<float> depth() const;   // 1, mean over the samples that hit, infinite where none did
  std::vector<float> normal() const;  // 3
  std::vector<float> albedo() const;  // 3
  std::vector<float> variance()
      const;  // 3, of the pixel's mean; infinite with fewer than two samples
  std::vector<float> sample_count() const;  // 1

  // relMSE: mean over pixels of Var(mean) / (E[mean]² + 0.01) on luminance, E[mean]² estimated by
  // mean² - Var(mean), at least 0; infinite while a pixel has fewer than two samples.
  double estimated_error() const;
  double mean_sample_count() const;

 private:
  int width_, height_;
  std::vector<PixelSums> pixels_;
};

}  // namespace gpis
