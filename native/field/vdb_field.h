// A scalar field from a grid of a .vdb file.
#pragma once

#include <string>

#include "field/field.h"

namespace gpis {

// What the numbers of a grid mean. Files differ and names do not tell ("variance" grids that hold
// deviations are about), so it is always stated.
enum class GridMeaning { value, variance };  // variance: the field is the square root

// A float or double grid, trilinear between the voxels of the box of its active ones; outside that
// box its background. Where its transform does more than scale and move, it is continued by its
// nearest value (TransformedField). Throws FileNotFound, or std::invalid_argument with a sentence
// (no such grid, another type, no active voxel, values that are not finite, negative variance).
FieldPtr load_vdb_field(const std::string& path, const std::string& grid, GridMeaning meaning);

}  // namespace gpis
