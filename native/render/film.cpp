#include "render/film.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace gpis {

namespace {

constexpr double kWideStep = 0x1p-64, kSquareStep = 0x1p-56, kNarrowStep = 0x1p-32;
// Alpha, normal and albedo: beyond this a sum of 2^16 samples could overflow. Materials keep them
// far below.
constexpr double kFeatureLimit = 0x1p15;

// v / 2^-digits, cut towards 0: by the parts of the double, where the compiler's own conversion is
// a call that takes as long as what a pixel's sample takes in all else.
template <int digits>
Fixed to_fixed(double v) {
  const auto bits = std::bit_cast<std::uint64_t>(v);
  const int exponent = static_cast<int>(bits >> 52 & 0x7ff);
  if (exponent == 0) return 0;  // below 2^-1022
  const std::uint64_t mantissa = (bits & (std::uint64_t{1} << 52) - 1) | std::uint64_t{1} << 52;
  const int shift = exponent - 1075 + digits;
  const Fixed magnitude = shift >= 0    ? static_cast<Fixed>(mantissa) << shift
                          : shift > -64 ? mantissa >> -shift
                                        : 0;
  return v < 0 ? -magnitude : magnitude;
}
Fixed to_wide(double v) {
  return to_fixed<64>(v);
}
Fixed to_square(double v) {
  return to_fixed<56>(v);
}
std::int64_t to_narrow(double v) {
  return static_cast<std::int64_t>(std::clamp(v, -kFeatureLimit, kFeatureLimit) / kNarrowStep);
}
double wide(Fixed v) {
  return static_cast<double>(v) * kWideStep;
}
double narrow(std::int64_t v) {
  return static_cast<double>(v) * kNarrowStep;
}

// Of what is not negative, so that the order of addition makes no difference here either.
constexpr Fixed kLargest = static_cast<Fixed>(~static_cast<unsigned __int128>(0) >> 1);
void add_square(Fixed& to, Fixed square) {
  if (__builtin_add_overflow(to, square, &to)) to = kLargest;
}

// The sums over blocks of a pixel that has one: its block's terms.
PixelSums by_blocks(const PixelSums& p) {
  if (p.blocks != 1) return p;
  PixelSums out = p;
  const Color s{wide(p.radiance[0]), wide(p.radiance[1]), wide(p.radiance[2])};
  const double y = luminance(s);
  out.squares = {to_square(s.x * s.x / 16), to_square(s.y * s.y / 16), to_square(s.z * s.z / 16),
                 to_square(y * y / 16)};
  for (int c = 0; c < 3; ++c) out.weighted[c] = p.radiance[c] / 16 * p.count;
  out.sizes = static_cast<std::int64_t>(p.count) * p.count;
  return out;
}

void add_all_but_squares(PixelSums& to, const PixelSums& from) {
  for (int c = 0; c < 3; ++c) {
    to.radiance[c] += from.radiance[c];
    to.normal[c] += from.normal[c];
    to.albedo[c] += from.albedo[c];
  }
  to.depth += from.depth;
  to.alpha += from.alpha;
  to.count += from.count;
  to.hits += from.hits;
}

void add_other_blocks(PixelSums& to, const PixelSums& from) {
  if (from.blocks == 0) return;
  if (to.blocks == 0) {
    to = from;
    return;
  }
  to = by_blocks(to);
  const PixelSums more = by_blocks(from);
  for (int c = 0; c < 4; ++c) add_square(to.squares[c], more.squares[c]);
  for (int c = 0; c < 3; ++c) to.weighted[c] += more.weighted[c];
  to.sizes += more.sizes;
  add_all_but_squares(to, more);
  to.blocks += more.blocks;
}

// A channel of a sum, c = 3: luminance.
double channel(const std::array<Fixed, 3>& sums, int c) {
  return c < 3 ? wide(sums[c]) : luminance({wide(sums[0]), wide(sums[1]), wide(sums[2])});
}

// Variance of the mean of channel c. Rounding may leave less than nothing.
double variance_of_mean(const PixelSums& p, int c) {
  if (p.count < 2 || p.squares[c] == kLargest) return kInfinity;
  const double n = p.count, mean = channel(p.radiance, c) / n;
  const double squares = static_cast<double>(p.squares[c]) * kSquareStep;
  if (p.blocks == 1) return std::max(0.0, (squares / n - mean * mean) / (n - 1));
  const double sizes = static_cast<double>(p.sizes);
  const double spread = 16 * squares - mean * (32 * channel(p.weighted, c) - mean * sizes);
  return std::max(0.0, spread / (n * n - sizes));
}

}  // namespace

bool PixelBlock::add(const FilmSample& sample, Counters& counters) {
  const bool hit = sample.depth < kInfinity;
  if (!is_finite(sample.radiance) || !is_finite(sample.normal) || !is_finite(sample.albedo) ||
      !std::isfinite(sample.alpha) || !(std::isfinite(sample.depth) || sample.depth == kInfinity)) {
    ++counters.nan_samples;
    return false;
  }
  Color radiance = sample.radiance;
  for (int c = 0; c < 3; ++c)
    radiance[c] = std::clamp(radiance[c], -kRadianceLimit, kRadianceLimit);
  if (length(radiance - sample.radiance) > 0) ++counters.clamped_samples;
  std::array<Fixed, 3> x;
  for (int c = 0; c < 3; ++c) x[c] = to_wide(radiance[c]);
  for (int c = 0; c < 3; ++c) add_square(sums_.squares[c], to_square(radiance[c] * radiance[c]));
  const double y = luminance(radiance);
  add_square(sums_.squares[3], to_square(y * y));
  for (int c = 0; c < 3; ++c) {
    sums_.radiance[c] += x[c];
    sums_.normal[c] += to_narrow(sample.normal[c]);
    sums_.albedo[c] += to_narrow(sample.albedo[c]);
  }
  sums_.alpha += to_narrow(sample.alpha);
  if (hit) {
    sums_.depth += to_wide(std::min(sample.depth, kRadianceLimit));
    ++sums_.hits;
  }
  ++sums_.count;
  sums_.blocks = 1;
  return true;
}

Film::Film(int width, int height)
    : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * height) {}

void Film::add(std::size_t index, const PixelBlock& block, bool continues) {
  PixelSums& to = pixels_[index];
  if (!continues || to.blocks == 0) return add_other_blocks(to, block.sums_);
  if (to.blocks != 1) throw std::logic_error("only a pixel's first block can be continued");
  for (int c = 0; c < 4; ++c) add_square(to.squares[c], block.sums_.squares[c]);
  add_all_but_squares(to, block.sums_);
}

void Film::add(const Film& other) {
  if (other.width_ != width_ || other.height_ != height_)
    throw std::invalid_argument("merge: results of different sizes cannot be merged");
  for (std::size_t i = 0; i < pixels_.size(); ++i) add_other_blocks(pixels_[i], other.pixels_[i]);
}

namespace {

// One pass: `value(pixel, channel)` for every pixel.
template <int channels, class Value>
std::vector<float> make_pass(const std::vector<PixelSums>& pixels, Value value) {
  std::vector<float> pass(pixels.size() * channels);
  for (std::size_t i = 0; i < pixels.size(); ++i)
    for (int c = 0; c < channels; ++c)
      pass[i * channels + c] = static_cast<float>(value(pixels[i], c));
  return pass;
}

double per_sample(double sum, std::uint32_t n) {
  return n ? sum / n : 0;
}

}  // namespace

std::vector<float> Film::combined() const {
  return make_pass<4>(pixels_, [](const PixelSums& p, int c) {
    return per_sample(c < 3 ? wide(p.radiance[c]) : narrow(p.alpha), p.count);
  });
}
std::vector<float> Film::depth() const {
  return make_pass<1>(
      pixels_, [](const PixelSums& p, int) { return p.hits ? wide(p.depth) / p.hits : kInfinity; });
}
std::vector<float> Film::normal() const {
  return make_pass<3>(
      pixels_, [](const PixelSums& p, int c) { return per_sample(narrow(p.normal[c]), p.count); });
}
std::vector<float> Film::albedo() const {
  return make_pass<3>(
      pixels_, [](const PixelSums& p, int c) { return per_sample(narrow(p.albedo[c]), p.count); });
}
std::vector<float> Film::variance() const {
  return make_pass<3>(pixels_, [](const PixelSums& p, int c) { return variance_of_mean(p, c); });
}
std::vector<float> Film::sample_count() const {
  return make_pass<1>(pixels_, [](const PixelSums& p, int) { return p.count; });
}

double Film::estimated_error() const {
  double sum = 0;
  for (const PixelSums& p : pixels_) {
    const double variance = variance_of_mean(p, 3);
    if (variance == kInfinity) return kInfinity;
    const double mean =
        luminance({wide(p.radiance[0]), wide(p.radiance[1]), wide(p.radiance[2])}) / p.count;
    // The mean's square is too large by its variance, and where samples are skewed a bright one
    // raises both: with mean² itself the error of 16 samples of a Cornell box came out a fifth low.
    sum += variance / (std::max(mean * mean - variance, 0.0) + 0.01);
  }
  return sum / static_cast<double>(pixels_.size());
}

double Film::mean_sample_count() const {
  double sum = 0;
  for (const PixelSums& p : pixels_) sum += p.count;
  return sum / static_cast<double>(pixels_.size());
}

}  // namespace gpis
