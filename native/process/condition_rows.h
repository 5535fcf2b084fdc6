// Conditions as functionals of g, and which of them are near enough to matter: those whose
// correlation with g there exceeds kNegligible.
#pragma once

#include <vector>

#include "process/covariance.h"
#include "process/path.h"

namespace gpis {

class ConditionRows {
 public:
  // Correlations below are neglected; what that costs is measured (posterior.h).
  static constexpr double kNegligible = 1e-5;

  struct Row {
    LocalPoint at;
    Functional what;
    double value, noise;  // of the functional; variance
    int point;            // which condition it comes from
  };

  // Throws a sentence where a condition cannot be met: σ = 0 there, an infinite length scale.
  ConditionRows(const GaussianProcess& process, const Covariance& covariance);

  const std::vector<Row>& rows() const { return rows_; }
  // Rows of a point: [first, last).
  int first_row(int point) const { return first_row_[point]; }
  int last_row(int point) const { return first_row_[point + 1]; }
  int points() const { return static_cast<int>(first_row_.size()) - 1; }
  const Vec3& point(int i) const { return rows_[first_row_[i]].at.x; }

  // How far y is from x, 1 where their correlation may be kNegligible.
  double distance(const Vec3& x, const Vec3& y) const;
  // From a box; its faces may lie at infinity.
  double distance(const Vec3& x, const Box3& box) const;
  // What that is at least, at once.
  double distance_at_least(const Vec3& x, const Box3& box) const;
  // Whether any comes near the line between two of its t.
  bool near(const LineGeometry& line, double t_begin, double t_end) const;

 private:
  struct Node {  // of a tree over the points, boxes in the middle of their children
    Vec3 centre, half;
    int first, last;  // of order_
    int left = -1, right = -1;
  };
  int build(int first, int last);
  bool near(int node, const LineGeometry& line, double t_begin, double t_end) const;
  bool ball_near(const Vec3& centre, const Vec3& half, const LineGeometry& line, double t_begin,
                 double t_end) const;

  std::vector<Row> rows_;
  std::vector<int> first_row_;
  // Lengths in which 1 is the reach of a term; none: everything is near.
  std::vector<Mat3> metrics_;
  double least_stretch_ = kInfinity;  // of a vector, by any of them
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace gpis
