// Covariances between points of one line where squared length scales A(x) vary (formulas C10 along
// the line): what the joint samplers spend their time on. With the line as the third axis and
// S = (A_x + A_y)/2 = L diag(s) Lᵀ, all that a covariance takes is s: Q = (x - y)²/s₃ and
// |S| = s₁s₂s₃. Values at many points are held in arrays, one for each number, and worked off two
// or more at a time.
#pragma once

#include <array>
#include <vector>

#include "process/covariance.h"
#include "process/path.h"

namespace gpis {

// A point with what its covariances on the line need, in the axes of the line; lengths in its unit.
struct LinePoint {
  double t = 0;
  SymMat3 half_a, half_slope;       // A/2 and its derivative along the line
  double root = 1, root_slope = 0;  // |A|^¼, and the derivative of its logarithm
};

class LineRows {
 public:
  // Forgets all rows.
  void reset(const Covariance& covariance, const LineGeometry& line);
  LinePoint at(double t) const { return at(t, t); }
  // With the derivative of A at `side` (see TensorField::along).
  LinePoint at(double t, double side) const;
  // Shortest length, in t, over which g changes at a point: 1/ℓ² = dᵀA⁻¹d + ⅛ tr((A⁻¹∂A)²)
  // (definitions E3).
  double length_scale(const LinePoint& p) const;

  int count() const { return static_cast<int>(t_.size()); }
  void truncate(int count);
  // A row: its point on the line (null: it lies elsewhere, and its covariances come out as 0), and
  // with the derivatives of A, in object axes, unless it is a value.
  void add(const LinePoint* point, const LocalPoint& local, const Functional& what);
  void add_copy(int row);
  // Where a row lies; with the derivative of A if it is not a value.
  LinePoint point(int row) const;
  // The same as others need it to whom it is a value.
  LocalPoint local(const LinePoint& p) const;

  // Of values and of slopes per t at x with the rows from `first` on.
  void covariances(const LinePoint& x, int first, int count, double* of_value) const;
  void covariances(const LinePoint& x, int first, int count, double* of_value,
                   double* of_slope) const;

  // Σ weight · row over the rows from `first` on, as the mean of g takes it: rows of slopes at one
  // point are one.
  struct Slopes {
    int row;
    LinePoint at;
    double value;
    Vec3 slope;          // axes of the line
    SymMat3 half_along;  // ½ ∂A along it
    double root_slope;   // ¼ tr(A⁻¹ ∂A)
  };
  std::vector<Slopes> weighted(int first, const std::vector<double>& weights) const;
  void sum(const LinePoint& x, int first, const std::vector<double>& weights,
           const std::vector<Slopes>& slopes, double& g, double& dg) const;

 private:
  static constexpr int kChunk = 32;
  using Chunk = std::array<double, kChunk>;

  // Rows first … first + n - 1, n <= kChunk.
  template <bool with_slope>
  void chunk(const LinePoint& x, int first, int n, double* of_value, double* of_slope) const;
  void with(const LinePoint& x, const Slopes& y, double& of_value, double& of_slope) const;
  void push(const LinePoint& p, double root);

  const Covariance* covariance_ = nullptr;
  Vec3 origin_, direction_;
  double speed_ = 1;
  Mat3 axes_;
  std::vector<double> t_, root_;          // root 0: not a value on the line
  std::array<std::vector<double>, 6> a_;  // A/2
  std::vector<Slopes> slopes_;            // in order of their rows
};

}  // namespace gpis
