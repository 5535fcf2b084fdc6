// White noise on integer lattices: independent standard normals, each a pure function of (seed,
// lattice, node), so that every part of a realisation can be looked up in any order by any thread.
// They are drawn a brick at a time when first asked for and kept in a small cache of one thread.
//
// With a time the normals change smoothly: each is a convolution of white noise in time (C11 in one
// dimension), correlated as exp(-Δ²/2) over Δ temporal length scales. Frames of an animation then
// show one and the same realisation of a process in space and time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace gpis {

using Node = std::array<std::int64_t, 3>;

class LatticeNoise {
 public:
  // Room for 2^shape[a] bricks along axis a; more are drawn again when they are needed again.
  struct Cache {
    std::array<int, 3> shape;
    int lattices;  // that have a room of their own; others share
  };
  explicit LatticeNoise(const Cache& cache);

  // Forgets the bricks of the realisation before. `time` in temporal length scales; none: static.
  void reset(std::uint64_t seed, std::optional<double> time);
  // Changes with every reset: a copy of older normals is stale.
  std::uint64_t generation() const { return generation_; }
  // Normals drawn since the beginning.
  std::uint64_t drawn() const { return drawn_; }

  // The normals of nodes first … first + size - 1 of one lattice, axis 0 contiguous, then axis 1.
  // A lattice that is thin along an axis (bit a of `thin`) has only node 0 there.
  void window(int lattice, unsigned thin, const Node& first, const std::array<int, 3>& size,
              double* out);

 private:
  static constexpr int kSide = 8, kBrick = kSide * kSide * kSide;

  struct Slot {
    std::uint64_t generation = 0;
    int lattice = 0;
    Node brick{};
    std::vector<double> normals;
  };
  const double* brick(int lattice, unsigned thin, const Node& index);
  void draw(std::uint64_t key, int count, double* out);

  Cache cache_;
  std::vector<Slot> slots_;
  std::uint64_t seed_ = 0, generation_ = 0, drawn_ = 0;
  std::optional<double> time_;
};

// Normals at a time from white noise in time: Σ weight[m] ξ(first + m). Shared by all that changes
// with time.
struct TimeWindow {
  static constexpr int kNodes = 16;
  std::int64_t first;
  double weight[kNodes];

  explicit TimeWindow(double time);  // in temporal length scales
};

}  // namespace gpis
