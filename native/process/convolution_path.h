// Sampler 1, line convolution (math.md §5.1): in units of the length scale along the ray,
//   g(q) = Σ_j φ(q - jh) ξ_j,  φ(u) = (2/π)^¼ √h exp(-u²),  ξ_j iid N(0,1),
// exactly Gaussian, random access, no linear solve. h = ½ and nodes within ±4 give the correlation
// exp(-q²/2) to 9e-8.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "core/counters.h"
#include "core/rng.h"

namespace gpis {

class ConvolutionPath {
 public:
  static constexpr double kStep = 0.5;  // h, also the march's natural step
  static constexpr int kNodes = 16;     // nodes in reach of one cell [kh, (k+1)h): k-7 … k+8

  void reset(double /*reach*/, Counters&) {
    nodes_.clear();
    runs_.clear();
  }

  // Draw what the cell [kh, (k+1)h) needs. Cells come in increasing order; a gap wider than the
  // kernel starts a new run.
  void prepare(long cell, Rng& rng, Counters& counters) {
    const long first = cell - 7, last = cell + 8;
    if (runs_.empty() || first > end(runs_.back())) runs_.push_back({first, nodes_.size()});
    for (long j = end(runs_.back()); j <= last; ++j) {
      nodes_.push_back(rng.normal());
      ++counters.line_normals;
    }
  }

  // g and dg/dq at the ends of a cell, q = kh and (k+1)h: fixed weights. The node at distance 4 is
  // left out on both sides, so that neighbouring cells agree to the last bit.
  void at_left(long cell, double& g, double& dg) const { ends(cell, kTable.left, g, dg); }
  void at_right(long cell, double& g, double& dg) const { ends(cell, kTable.right, g, dg); }

  // g and dg/dq anywhere in [kh, (k+1)h], by ONE node set for the whole cell (definitions E5).
  // The weights follow from two exponentials: e^{-(x-s)²} = e^{-x²} e^{2xs} e^{-s²}.
  void at(long cell, double q, double& g, double& dg) const {
    const double x = q - cell * kStep;
    const double up = std::exp(2 * kStep * x), down = 1 / up;
    double power[kNodes];
    power[7] = std::exp(-x * x);
    for (int i = 8; i < kNodes; ++i) power[i] = power[i - 1] * up;
    for (int i = 6; i >= 0; --i) power[i] = power[i + 1] * down;
    const Eigen::Array<double, kNodes, 1> w =
        Eigen::Map<const Eigen::Array<double, kNodes, 1>>(power) * kTable.gauss *
        window(cell).array();
    const double sum = w.sum();
    const double moment = (w * kTable.node).sum();
    g = sum;
    dg = -2 * (x * sum - moment);
  }

 private:
  struct Run {
    long first;
    std::size_t offset;
  };
  using Window = Eigen::Map<const Eigen::Matrix<double, kNodes, 1>>;

  using Weights = Eigen::Matrix<double, kNodes, 1>;
  struct End {
    Weights value, slope;
  };
  struct Table {
    Eigen::Array<double, kNodes, 1> node, gauss;
    End left, right;

    Table() {
      const double scale = std::pow(2 / kPi, 0.25) * std::sqrt(kStep);
      for (int i = 0; i < kNodes; ++i) {
        node[i] = (i - 7) * kStep;
        gauss[i] = scale * std::exp(-node[i] * node[i]);
        weigh(left, i, node[i], scale);
        weigh(right, i, node[i] - kStep, scale);
      }
    }
    static void weigh(End& end, int i, double s, double scale) {
      end.value[i] = std::abs(s) < 4 ? scale * std::exp(-s * s) : 0;
      end.slope[i] = 2 * s * end.value[i];
    }
  };
  inline static const Table kTable;

  // One past the last node drawn, as the run that is still growing knows it.
  long end(const Run& run) const {
    return run.first + static_cast<long>(nodes_.size() - run.offset);
  }

  void ends(long cell, const End& weights, double& g, double& dg) const {
    const Window xi = window(cell);
    g = xi.dot(weights.value);
    dg = xi.dot(weights.slope);
  }

  Window window(long cell) const {
    const long first = cell - 7;
    std::size_t r = runs_.size() - 1;
    while (runs_[r].first > first) --r;  // earlier runs only when an older point is asked for
    return Window(nodes_.data() + runs_[r].offset + (first - runs_[r].first));
  }

  std::vector<double> nodes_;
  std::vector<Run> runs_;
};

}  // namespace gpis
