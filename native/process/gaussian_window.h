// One axis of the lattice convolution (formulas C11): weights φ(y - jh) = (2/π)^¼ √h exp(-(y -
// jh)²) of the nodes in reach of y. Products of them over the axes sum to the correlation
// exp(-q²/2), off by 9e-8 per axis with h = ½ and nodes within ±4 (math.md §5.1).
#pragma once

#include <cmath>
#include <cstdint>

#include "core/vec.h"

namespace gpis {

struct GaussianWindow {
  static constexpr double kStep = 0.5;
  static constexpr int kNodes = 16, kBefore = 7;

  std::int64_t first = 0;  // node of weight[0]
  double weight[kNodes];
  double moment[kNodes];  // weight · (node - y), so that dφ/dy = 2 · moment

  explicit GaussianWindow(double y) {
    static const Table table;
    const double cell = std::floor(y / kStep), x = y - cell * kStep;
    first = static_cast<std::int64_t>(cell) - kBefore;
    // e^{-(x-s)²} = e^{-x²} e^{2xs} e^{-s²}: two exponentials for all nodes.
    const double up = std::exp(2 * kStep * x), down = 1 / up;
    double power[kNodes];
    power[kBefore] = std::exp(-x * x);
    for (int i = kBefore + 1; i < kNodes; ++i) power[i] = power[i - 1] * up;
    for (int i = kBefore - 1; i >= 0; --i) power[i] = power[i + 1] * down;
    for (int i = 0; i < kNodes; ++i) {
      weight[i] = power[i] * table.gauss[i];
      moment[i] = weight[i] * (table.node[i] - x);
    }
  }

 private:
  struct Table {
    double node[kNodes], gauss[kNodes];
    Table() {
      const double scale = std::pow(2 / kPi, 0.25) * std::sqrt(kStep);
      for (int i = 0; i < kNodes; ++i) {
        node[i] = (i - kBefore) * kStep;
        gauss[i] = scale * std::exp(-node[i] * node[i]);
      }
    }
  };
};

}  // namespace gpis
