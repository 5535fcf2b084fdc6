// Discrete distributions by inversion of their cumulative sums, in one and two dimensions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/warp.h"

namespace gpis {

// Entries i with probability weight[i]/Σ weight; all equal to 0 if all weights are.
class Piecewise1D {
 public:
  Piecewise1D() = default;
  explicit Piecewise1D(const std::vector<double>& weights) {
    cumulative_.reserve(weights.size() + 1);
    for (const double w : weights) cumulative_.push_back(cumulative_.back() + w);
  }
  double sum() const { return cumulative_.back(); }
  double probability(int i) const {
    return sum() > 0 ? (cumulative_[i + 1] - cumulative_[i]) / sum() : 0;
  }
  // u in [0, 1), which becomes the place inside the entry's part of it, again in [0, 1). An entry
  // of weight zero is never chosen.
  int sample(double& u) const {
    const double target = u * sum();
    auto it = std::upper_bound(cumulative_.begin() + 1, cumulative_.end() - 1, target);
    auto i = it - cumulative_.begin() - 1;
    // Rounding of u·sum up to the sum itself may point behind the last entry with weight.
    while (i > 0 && cumulative_[i + 1] == cumulative_[i]) --i;
    const double within = (target - cumulative_[i]) / (cumulative_[i + 1] - cumulative_[i]);
    u = std::clamp(within, 0.0, 1 - 0x1p-53);
    return static_cast<int>(i);
  }

 private:
  std::vector<double> cumulative_{0};
};

// Cells (i, j) of a table: first the row j, then the column i in it; `at` becomes the place in the
// cell.
class Piecewise2D {
 public:
  explicit Piecewise2D(std::vector<Piecewise1D> rows) : columns_(std::move(rows)) {
    std::vector<double> sums;
    for (const Piecewise1D& row : columns_) sums.push_back(row.sum());
    rows_ = Piecewise1D(sums);
  }
  std::pair<int, int> sample(SquarePoint& at) const {
    const int j = rows_.sample(at.v);
    return {columns_[j].sample(at.u), j};
  }
  double probability(int i, int j) const {
    return rows_.probability(j) * columns_[j].probability(i);
  }
  double sum() const { return rows_.sum(); }

 private:
  Piecewise1D rows_;
  std::vector<Piecewise1D> columns_;
};

}  // namespace gpis
