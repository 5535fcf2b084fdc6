// Arguments of fields, refused with a sentence: which argument, what it held, what it takes.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

#include "core/vec.h"
#include "field/field.h"

namespace gpis {

// Starts with a literal: refuse(path, sentence) with a path of the scene description is another
// function.
template <std::size_t N, class... Parts>
[[noreturn]] void refuse(const char (&first)[N], const Parts&... parts) {
  std::ostringstream text;
  ((text << first) << ... << parts);
  throw std::invalid_argument(text.str());
}

inline std::ostream& operator<<(std::ostream& out, const Vec3& v) {
  return out << '(' << v.x << ", " << v.y << ", " << v.z << ')';
}

inline void check_finite(const char* what, double v) {
  if (!std::isfinite(v)) refuse("", what, " is ", v, "; it takes a finite number.");
}
inline void check_finite(const char* what, const Vec3& v) {
  if (!is_finite(v)) refuse("", what, " is ", v, "; it takes three finite numbers.");
}
inline void check_positive(const char* what, double v) {
  if (!(std::isfinite(v) && v > 0)) refuse("", what, " is ", v, "; it takes a positive number.");
}
inline void check_positive(const char* what, const Vec3& v) {
  if (!(is_finite(v) && v.x > 0 && v.y > 0 && v.z > 0))
    refuse("", what, " is ", v, "; it takes three positive numbers.");
}
inline void check_direction(const char* what, const Vec3& v) {
  if (!(is_finite(v) && length(v) > 0))
    refuse("", what, " is ", v, "; it takes a direction of non-zero length.");
}

// Refuses an affine map that is not finite or flattens space; its least and greatest stretch.
Range check_transform(const Affine& matrix);

}  // namespace gpis
