// The box about the image of a box under an affine map.
#pragma once

#include "core/vec.h"

namespace gpis {

// Not a number where the box is infinite along an axis that the map mixes into others.
inline Box3 image_of(const Box3& box, const Affine& map) {
  Box3 image;
  for (int corner = 0; corner < 8; ++corner)
    image.include(map.point({corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                             corner & 4 ? box.max.z : box.min.z}));
  return image;
}

}  // namespace gpis
