// The part of a gradient's law across a line: independent Gaussian vectors, all across d, added up
// to the two of a PathGradient.
#pragma once

#include "process/path.h"

namespace gpis {

class Across {
 public:
  explicit Across(const Vec3& direction) : frame_(normalize(direction)) {}

  // A vector b ξ of which the share `free` of the variance is not known.
  void add(const Vec3& b, double free) {
    const double s = dot(b, frame_.s), t = dot(b, frame_.t);
    ss_ += free * s * s;
    st_ += free * s * t;
    tt_ += free * t * t;
    all_ += s * s + t * t;
  }

  void write(PathGradient& law) const {
    law.free_variance = all_ > 0 ? (ss_ + tt_) / all_ : 0;
    const bool swap = tt_ > ss_;
    const double first = std::sqrt(swap ? tt_ : ss_), cross = first > 0 ? st_ / first : 0;
    const double second = std::sqrt(std::max(0.0, (swap ? ss_ : tt_) - cross * cross));
    const Vec3 &a = swap ? frame_.t : frame_.s, &b = swap ? frame_.s : frame_.t;
    law.b1 = a * first + b * cross;
    law.b2 = b * second;
  }

 private:
  Frame frame_;
  double ss_ = 0, st_ = 0, tt_ = 0, all_ = 0;
};

}  // namespace gpis
