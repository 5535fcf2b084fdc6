// Where a ray is inside of a plane, a box or a sphere, moved by an affine map or not: one stretch,
// known in closed form.
#pragma once

#include <optional>

#include "field/field.h"

namespace gpis {

class ConvexBody {
 public:
  // Where the field is below 0; nothing for fields of other kinds.
  static std::optional<ConvexBody> of(const Field& field);

  // Of the whole line o + t d, infinite where it does not end; none: !(begin < end).
  struct Stretch {
    double begin, end;
  };
  Stretch inside(const Vec3& o, const Vec3& d) const;

 private:
  enum class Kind { plane, box, sphere };
  Kind kind_ = Kind::plane;
  bool moved_ = false;
  Affine to_body_;
  Vec3 center_;        // of a plane: a point on it
  Vec3 gradient_;      // of a plane
  Box3 box_;           // about its centre
  double radius_ = 0;  // of a sphere
};

}  // namespace gpis
