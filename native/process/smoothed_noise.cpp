#include "process/smoothed_noise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/rng.h"
#include "core/vec.h"

namespace gpis {
namespace {

constexpr double kReach2 = 16;      // exp(-16) = 1e-7 is left out
constexpr int kLevelsOfOctave = 3;  // a level is smoothed from the one an octave below

// Along one axis: the weights of the nodes that each of a row of coarse nodes takes.
struct Taps {
  std::int64_t first = 0;  // of the fine nodes that any takes
  int count;
  std::vector<int> begin;  // by coarse node, less `first`
  std::vector<std::vector<double>> weight;

  // Gaussian of this variance.
  Taps(std::int64_t node, int nodes, double coarse, double fine, double variance) {
    const double reach = std::sqrt(2 * kReach2 * variance);
    const double scale = fine / std::sqrt(2 * kPi * variance);
    std::int64_t end = 0;
    for (int n = 0; n < nodes; ++n) {
      const double at = static_cast<double>(node + n) * coarse;
      const auto low = static_cast<std::int64_t>(std::ceil((at - reach) / fine));
      const auto high = static_cast<std::int64_t>(std::floor((at + reach) / fine));
      if (n == 0) first = low;
      begin.push_back(static_cast<int>(low - first));
      weight.emplace_back();
      for (std::int64_t m = low; m <= high; ++m) {
        const double u = static_cast<double>(m) * fine - at;
        weight.back().push_back(scale * std::exp(-u * u / (2 * variance)));
      }
      end = high + 1;
    }
    count = static_cast<int>(end - first);
  }
};

// Sums the slowest axis of `in`, slices of `stride` numbers.
std::vector<double> sum_slices(const Taps& taps, const double* in, std::ptrdiff_t stride) {
  using Array = Eigen::Map<Eigen::ArrayXd>;
  using ConstArray = Eigen::Map<const Eigen::ArrayXd>;
  std::vector<double> out(taps.begin.size() * stride);
  for (std::size_t n = 0; n < taps.begin.size(); ++n) {
    Array slice(out.data() + n * stride, stride);
    const double* from = in + taps.begin[n] * stride;
    for (const double w : taps.weight[n]) {
      slice += w * ConstArray(from, stride);
      from += stride;
    }
  }
  return out;
}

}  // namespace

double SmoothedNoise::variance(const White& white, int level) {
  return white.spacing * white.spacing * std::exp2(2.0 * level / kLevelsOfOctave);
}

double SmoothedNoise::spacing(const White& white, int level) {
  return std::sqrt(variance(white, level) / 1.5);
}

std::size_t SmoothedNoise::Hash::operator()(const Key& key) const {
  std::uint64_t h = mix64(static_cast<std::uint64_t>(key.number) << 32 ^ key.level);
  for (const std::int64_t i : key.brick) h = mix64(h ^ static_cast<std::uint64_t>(i));
  return h;
}

SmoothedNoise::Brick SmoothedNoise::smooth(LatticeNoise& noise, const White& white, int level,
                                           const Node& index) {
  const int below = level - kLevelsOfOctave;  // negative: the white noise
  const double coarse = spacing(white, level);
  const double fine = below < 0 ? white.spacing : spacing(white, below);
  const double added = variance(white, level) - (below < 0 ? 0 : variance(white, below));
  std::vector<Taps> taps;
  for (const std::int64_t i : index) taps.emplace_back(i * kSide, kSide, coarse, fine, added);
  const Node first{taps[0].first, taps[1].first, taps[2].first};
  const std::array<int, 3> size{taps[0].count, taps[1].count, taps[2].count};

  std::vector<double> nodes(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
  if (below < 0) {
    noise.window(white.number, 0, first, size, nodes.data());
  } else {
    std::vector<float> smoother(nodes.size());
    window(noise, white, below, first, size, smoother.data());
    std::copy(smoother.begin(), smoother.end(), nodes.begin());
  }
  // White noise per volume has the variance 1/h³ on its nodes.
  const double scale = below < 0 ? std::pow(white.spacing, -1.5) : 1;

  nodes = sum_slices(taps[2], nodes.data(), static_cast<std::ptrdiff_t>(size[0]) * size[1]);
  Brick out;
  out.reserve(kBrick);
  for (int k = 0; k < kSide; ++k) {
    const std::vector<double> rows = sum_slices(
        taps[1], nodes.data() + static_cast<std::ptrdiff_t>(k) * size[0] * size[1], size[0]);
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        const std::vector<double>& weight = taps[0].weight[i];
        const auto n = static_cast<Eigen::Index>(weight.size());
        const double* from = rows.data() + static_cast<std::ptrdiff_t>(j) * size[0];
        const double sum = Eigen::Map<const Eigen::VectorXd>(weight.data(), n)
                               .dot(Eigen::Map<const Eigen::VectorXd>(from + taps[0].begin[i], n));
        out.push_back(static_cast<float>(scale * sum));
      }
  }
  return out;
}

const float* SmoothedNoise::brick(LatticeNoise& noise, const White& white, int level,
                                  const Node& index) {
  const Key key{white.number, level, index};
  const auto found = bricks_.find(key);
  if (found != bricks_.end()) return found->second.data();
  auto kept = older_.extract(key);
  Brick made = !kept.empty() ? std::move(kept.mapped()) : smooth(noise, white, level, index);
  if (bricks_.size() >= kMostBricks) {
    older_ = std::move(bricks_);
    bricks_.clear();
  }
  return bricks_.emplace(key, std::move(made)).first->second.data();
}

void SmoothedNoise::window(LatticeNoise& noise, const White& white, int level, const Node& first,
                           const std::array<int, 3>& size, float* out) {
  if (generation_ != noise.generation()) {
    bricks_.clear();
    older_.clear();
    generation_ = noise.generation();
  }
  constexpr int kShift = 4;  // of a negative number too it rounds down
  static_assert(1 << kShift == kSide);
  Node begin, end;
  for (int a = 0; a < 3; ++a) {
    begin[a] = first[a] >> kShift;
    end[a] = (first[a] + size[a] - 1) >> kShift;
  }
  for (std::int64_t b2 = begin[2]; b2 <= end[2]; ++b2)
    for (std::int64_t b1 = begin[1]; b1 <= end[1]; ++b1)
      for (std::int64_t b0 = begin[0]; b0 <= end[0]; ++b0) {
        const float* values = brick(noise, white, level, {b0, b1, b2});
        const Node corner{b0 * kSide, b1 * kSide, b2 * kSide};
        Node low, high;
        for (int a = 0; a < 3; ++a) {
          low[a] = std::max(first[a], corner[a]);
          high[a] = std::min(first[a] + size[a], corner[a] + kSide);
        }
        for (std::int64_t k = low[2]; k < high[2]; ++k)
          for (std::int64_t j = low[1]; j < high[1]; ++j) {
            const float* row =
                values + ((k - corner[2]) * kSide + j - corner[1]) * kSide + low[0] - corner[0];
            std::copy(
                row, row + (high[0] - low[0]),
                out + ((k - first[2]) * size[1] + j - first[1]) * size[0] + low[0] - first[0]);
          }
      }
}

}  // namespace gpis
