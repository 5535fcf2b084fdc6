// Covariances between points of one line where squared length scales A(x) vary (formulas C10 along
// the line): what the joint samplers spend their time on. With the line as the third axis and
// S = (A_x + A_y)/2 = L diag(s) Lᵀ, all that a covariance takes is s: Q = (x - y)²/s₃ and
// |S| = s₁s₂s₃. Points are held in arrays, one for each number, and worked off several at a time.
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
  LinePoint at(double t, const LocalPoint& same) const;
  // The same point as others need it to whom it is a value.
  LocalPoint local(const LinePoint& p) const;
  // Shortest length, in t, over which g changes at a point: 1/ℓ² = dᵀA⁻¹d + ⅛ tr((A⁻¹∂A)²)
  // (definitions E3).
  double length_scale(const LinePoint& p) const;

  // As if A were the same everywhere.
  double plain_length_scale(const LinePoint& p) const;
  // Variance of the slope per t there.
  double slope_variance(const LinePoint& p) const;

  // A value of g, its slope per t, or another functional, at a point of the line; null: it lies
  // elsewhere. `local` is needed where it is another functional.
  void add(const LinePoint* point, const LocalPoint& local, const Functional& what);
  void add_copy(int row);
  void truncate(int count);
  // Where a row lies that is on the line.
  LinePoint point(int row) const;
  bool is_value(const Functional& what) const { return what.value_only() && what.value == 1; }
  bool is_slope(const Functional& what) const {
    const Vec3 off = what.slope - direction_;
    return what.value == 0 && off.x == 0 && off.y == 0 && off.z == 0;
  }

  // Of the value, or the slope per t, at x with `count` rows from `first` on; 0 for those
  // elsewhere.
  void covariances(const LinePoint& x, bool slope, int first, int count, double* out);
  // Of (g, ∇g) at x with a value or slope among them: false for others.
  struct Gradient {
    std::vector<Eigen::Vector4d> with_value, with_slope;  // of points
  };
  bool cross(const Gradient& of_points, int row, Eigen::Vector4d& out) const;
  Gradient gradient(const LinePoint& x, const LocalPoint& same);

  // Functionals but values and slopes.
  struct Other {
    LinePoint at;
    double value;
    Vec3 slope;          // axes of the line
    SymMat3 half_along;  // ½ ∂A along it
    double root_slope;   // ¼ tr(A⁻¹ ∂A)
  };
  // Σ weight · row over the rows from `first` on, by points.
  struct Weights {
    int first_point = 0;
    std::vector<double> value, slope;
    std::vector<Other> others;  // those of one point are one
  };
  void weigh(int first, const std::vector<double>& weights, Weights& out) const;
  // What they sum to at x, and the slope of that per t.
  void sum(const LinePoint& x, const Weights& weights, double& g, double& dg);

 private:
  // A⁻¹ along the line, and tr((A⁻¹∂A)²).
  static void lengths(const LinePoint& p, double& inverse_a, double& changes);
  enum class Kind { elsewhere, value, slope, other };
  struct Row {
    Kind kind;
    int index;  // of its point, or among the others
  };
  // Numbers of a point: t, |A|^¼, the derivative of its logarithm, A/2 and its derivative.
  static constexpr int kNumbers = 15;
  // Covariances of the value at x with those at points, ∂ of them per unit of the line, by x, y and
  // both.
  struct Columns {
    std::vector<double> k, by_x, by_y, by_both;
    void resize(int n);
  };

  int points() const { return static_cast<int>(numbers_[0].size()); }
  void columns(const LinePoint& x, int begin, int end);
  Other other(const LinePoint& at, const LocalPoint& local, const Functional& what) const;
  LinePoint point_at(int index) const;
  void with(const LinePoint& x, const Other& y, double& of_value, double& of_slope) const;

  const Covariance* covariance_ = nullptr;
  Vec3 origin_, direction_;
  double speed_ = 1;
  Mat3 axes_;
  std::vector<Row> rows_;
  std::array<std::vector<double>, kNumbers> numbers_;
  std::vector<Other> others_;

  // Of the x asked for last, with the points from columns_begin_ to columns_end_.
  Columns columns_;
  LinePoint columns_of_;
  int columns_begin_ = 0, columns_end_ = -1;
};

}  // namespace gpis
