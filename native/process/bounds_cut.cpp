#include "process/bounds_cut.h"

#include <sstream>

namespace gpis {
namespace {

constexpr int kAcross = 24;    // intervals along an edge
constexpr double kRare = 3.0;  // deviations outside of which what is cut is next to nothing

double deviations(const GaussianProcess& process, const Vec3& x) {
  const double mean = process.mean->value(x), sigma = process.sigma->value(x);
  if (sigma > 0) return mean / sigma;
  return mean < 0 ? -kInfinity : kInfinity;
}

}  // namespace

std::string describe_bounds(const GaussianProcess& process, const Box3& bounds, double enough) {
  const Vec3 size = bounds.max - bounds.min;
  if (!is_finite(size)) return "none on some side: the process goes on";
  double least = kInfinity;
  Vec3 at;
  for (int axis = 0; axis < 3; ++axis)
    for (const bool far : {false, true})
      for (int i = 0; i <= kAcross; ++i)
        for (int j = 0; j <= kAcross; ++j) {
          Vec3 x = bounds.min;
          x[axis] = far ? bounds.max[axis] : bounds.min[axis];
          x[(axis + 1) % 3] += size[(axis + 1) % 3] * i / kAcross;
          x[(axis + 2) % 3] += size[(axis + 2) % 3] * j / kAcross;
          const double here = deviations(process, x);
          if (here < least) {
            least = here;
            at = x;
          }
        }
  if (least >= enough) return "the surface is absent at them";
  std::ostringstream text;
  text.precision(3);
  const double inside = 0.5 * std::erfc(least / std::sqrt(2.0));
  if (least >= kRare)
    text << "the surface is all but absent at them: inside with probability " << inside
         << " at most";
  else
    text << "cut the surface: at (" << at.x << ", " << at.y << ", " << at.z
         << ") on them the process is inside with probability " << inside
         << ", and a ray that comes in there finds it outside. Larger bounds leave nothing out; an "
            "intersection with a box makes a solid that is cut";
  if (process.conditions) text << " (conditions not looked at)";
  return text.str();
}

}  // namespace gpis
