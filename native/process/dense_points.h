// Where the points of a joint dense line stand, and what the cubics between them miss: for any
// covariance, also where lengths change from one voxel to the next.
#pragma once

#include "process/covariance.h"
#include "process/line_rows.h"
#include "process/path.h"

namespace gpis {

class DensePoints {
 public:
  // How close points are: in local length scales; by how far the slope may jump between two, of the
  // deviation, where A has kinks; and by the share of the variance that a cubic may miss there.
  struct Spacing {
    double lengths, kinks, missed;
    double roughness = 0;  // see roughness_under
    double first = 1;      // see first_under
    double widest = 1;     // what `lengths` was before it had to be shortened for others
  };
  // q of Var(g'(t + h) - g'(t)) = q h + O(h²) where A is 1, 0 of smoother paths and of kernels that
  // take no A.
  static double roughness_under(const GaussianProcess& process);
  // The share of such an interval of `lengths` that the first one behind a known start may take: a
  // cubic over the whole of it makes the variance close to the start too large (SE, a quarter of a
  // length scale: 6 %), see bend_of_smooth in dense_path.cpp.
  static double first_under(const GaussianProcess& process, double lengths);

  // `lengths`: of the line, where they vary; else null. Points stand at the ends of cells of this
  // step, and closer where they have to.
  void reset(const Covariance& covariance, const LineGeometry& line, const LineRows* lengths,
             const Spacing& spacing, double anchor, double step);
  // Value and slope are known at the anchor: intervals grow from there.
  void start_known() { first_ = spacing_.first * step_; }
  // So close to it that what the start leaves open is small.
  bool grows(double t) const {
    return first_ > 0 && t - anchor_ < step_ * (spacing_.widest / spacing_.lengths);
  }
  // The point behind one at t.
  double after(double t) const;
  bool rough() const { return spacing_.roughness > 0 || intensity_ > 0; }
  // That q at t.
  double slope_intensity(double t) const;
  // |implied - exact correlation| that the cubics over two intervals, the same or the second behind
  // the first, make between points within them; with what bridges add to a rough path.
  struct Interval {
    double begin, end;
  };
  double error_of_cubics(const Interval& a, const Interval& b) const;

 private:
  double length_at(double t) const;
  double farther(double t, double length) const;
  // The point behind t but for that.
  double regular(double t) const;

  const Covariance* covariance_ = nullptr;
  LineGeometry line_;
  const LineRows* lengths_ = nullptr;
  Spacing spacing_{};
  double anchor_ = 0, step_ = 1, first_ = 0;
  double intensity_ = 0;  // where lengths are the same everywhere
};

}  // namespace gpis
