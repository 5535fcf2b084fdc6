#include "process/lattice_noise.h"

#include <algorithm>

#include "core/rng.h"
#include "process/gaussian_window.h"

namespace gpis {

LatticeNoise::LatticeNoise(const Cache& cache) : cache_(cache) {
  cache_.lattices = std::max(cache.lattices, 1);
  const auto [a, b, c] = cache.shape;
  slots_.resize(static_cast<std::size_t>(cache_.lattices) << (a + b + c));
}

void LatticeNoise::reset(std::uint64_t seed, std::optional<double> time) {
  seed_ = seed;
  time_ = time;
  ++generation_;
}

TimeWindow::TimeWindow(double time) {
  static_assert(kNodes == GaussianWindow::kNodes);
  const GaussianWindow window(time);
  first = window.first;
  std::copy(window.weight, window.weight + kNodes, weight);
}

void LatticeNoise::draw(std::uint64_t key, int count, double* out) {
  if (!time_) {
    Rng rng(key, 0);
    rng.normals(out, count);
    drawn_ += count;
    return;
  }
  const TimeWindow window(*time_);
  std::fill(out, out + count, 0.0);
  for (int m = 0; m < TimeWindow::kNodes; ++m) {
    Rng rng(key, static_cast<std::uint64_t>(window.first + m), 1);
    for (int i = 0; i < count; ++i) out[i] += window.weight[m] * rng.normal();
  }
  drawn_ += static_cast<std::uint64_t>(count) * TimeWindow::kNodes;
}

const double* LatticeNoise::brick(int lattice, unsigned thin, const Node& index) {
  std::uint64_t key = mix64(mix64(seed_) ^ static_cast<std::uint64_t>(lattice));
  for (const std::int64_t i : index) key = mix64(key ^ static_cast<std::uint64_t>(i));
  std::size_t place = lattice % cache_.lattices;
  for (int axis = 2; axis >= 0; --axis)
    place = place << cache_.shape[axis] |
            (static_cast<std::size_t>(index[axis]) & ((1u << cache_.shape[axis]) - 1));
  Slot& slot = slots_[place];
  if (slot.generation != generation_ || slot.lattice != lattice || slot.brick != index) {
    slot.generation = generation_;
    slot.lattice = lattice;
    slot.brick = index;
    slot.normals.resize(kBrick);
    int count = 1;
    for (int axis = 0; axis < 3; ++axis) count *= thin >> axis & 1 ? 1 : kSide;
    draw(key, count, slot.normals.data());
  }
  return slot.normals.data();
}

void LatticeNoise::window(int lattice, unsigned thin, const Node& first,
                          const std::array<int, 3>& size, double* out) {
  // Shifts of negative numbers round down: brick and place in it.
  constexpr int kShift = 3;
  static_assert(1 << kShift == kSide);
  const auto brick_of = [](std::int64_t node) { return node >> kShift; };
  Node last;
  std::array<int, 3> side;
  for (int a = 0; a < 3; ++a) {
    last[a] = first[a] + size[a] - 1;
    side[a] = thin >> a & 1 ? 1 : kSide;
  }
  for (std::int64_t b2 = brick_of(first[2]); b2 <= brick_of(last[2]); ++b2)
    for (std::int64_t b1 = brick_of(first[1]); b1 <= brick_of(last[1]); ++b1)
      for (std::int64_t b0 = brick_of(first[0]); b0 <= brick_of(last[0]); ++b0) {
        const double* normals = brick(lattice, thin, {b0, b1, b2});
        const std::int64_t begin0 = std::max(first[0], b0 * kSide),
                           begin1 = std::max(first[1], b1 * kSide),
                           begin2 = std::max(first[2], b2 * kSide);
        const std::int64_t end0 = std::min(last[0], b0 * kSide + kSide - 1),
                           end1 = std::min(last[1], b1 * kSide + kSide - 1),
                           end2 = std::min(last[2], b2 * kSide + kSide - 1);
        for (std::int64_t n2 = begin2; n2 <= end2; ++n2)
          for (std::int64_t n1 = begin1; n1 <= end1; ++n1) {
            const double* row = normals +
                                ((n2 - b2 * kSide) * side[1] + n1 - b1 * kSide) * side[0] + begin0 -
                                b0 * kSide;
            std::copy(
                row, row + (end0 - begin0 + 1),
                out + ((n2 - first[2]) * size[1] + n1 - first[1]) * size[0] + begin0 - first[0]);
          }
      }
}

}  // namespace gpis
