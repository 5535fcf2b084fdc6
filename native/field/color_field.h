// Colours over space, linear RGB: what a painted albedo multiplies a material's colour with.
#pragma once

#include <array>
#include <string>

#include "field/field.h"

namespace gpis {

class ColorField {
 public:
  // Refuses, with a sentence, fields that are not known to stay within 0 and 1: no surface reflects
  // more than it receives.
  explicit ColorField(std::array<FieldPtr, 3> parts, const std::string& name = "ColorField");

  Color value(const Vec3& p) const {
    return {parts_[0]->value(p), parts_[1]->value(p), parts_[2]->value(p)};
  }

 private:
  std::array<FieldPtr, 3> parts_;
};
using ColorFieldPtr = std::shared_ptr<const ColorField>;

// From a grid of vectors of a .vdb file, trilinear between the voxels of the box of its active
// ones, the nearest one outside. Throws FileNotFound, or std::invalid_argument with a
// sentence.
ColorFieldPtr load_vdb_color_field(const std::string& path, const std::string& grid);

}  // namespace gpis
