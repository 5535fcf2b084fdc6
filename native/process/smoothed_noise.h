// White noise smoothed by Gaussians, W_S = N(0, S) * W, on lattices that are the coarser the larger
// S is (formulas C11). A wide kernel then takes as many nodes as a narrow one and still integrates
// the same white noise: a Gaussian of variance T on W is one of variance T - S on W_S.
//
// On nodes H apart both convolutions together weigh the white noise by N(0, T) times a factor that
// is one but for 2 exp(-S(T - S)/T · 2π²/H²) along each axis (Poisson's summation): 7e-7 where
// S = 1.5 H² and T = 2S. So much of W_S is the work of few nodes that single precision holds it.
#pragma once

#include <unordered_map>

#include "process/lattice_noise.h"

namespace gpis {

class SmoothedNoise {
 public:
  // A lattice of LatticeNoise and the distance of its nodes.
  struct White {
    int number;
    double spacing;
  };
  // S and H: three levels to an octave of lengths. S of level 0 is the square of the white noise's
  // spacing.
  static double variance(const White& white, int level);
  static double spacing(const White& white, int level);

  // W_S at the nodes first … first + size - 1 of a level, axis 0 contiguous, then axis 1.
  void window(LatticeNoise& noise, const White& white, int level, const Node& first,
              const std::array<int, 3>& size, float* out);

 private:
  static constexpr int kSide = 16, kBrick = kSide * kSide * kSide;
  static constexpr std::size_t kMostBricks = 4096;  // of each age: 64 MB
  using Brick = std::vector<float>;

  struct Key {
    int number, level;
    Node brick;
    bool operator==(const Key&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  const float* brick(LatticeNoise& noise, const White& white, int level, const Node& index);
  Brick smooth(LatticeNoise& noise, const White& white, int level, const Node& index);

  // Where there are too many bricks, those not asked for since the last time go.
  std::unordered_map<Key, Brick, Hash> bricks_, older_;
  std::uint64_t generation_ = 0;
};

}  // namespace gpis
