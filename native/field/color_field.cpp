#include "field/color_field.h"

#include "field/check.h"
#include "field/grid_field.h"
#include "field/transformed_field.h"
#include "field/vdb_bricks.h"
#include "field/vdb_open.h"

namespace gpis {

ColorField::ColorField(std::array<FieldPtr, 3> parts, const std::string& name)
    : parts_(std::move(parts)) {
  const char* names[3] = {"red", "green", "blue"};
  for (int i = 0; i < 3; ++i) {
    const Range r = parts_[i]->range();
    if (!(r.min >= 0 && r.max <= 1))
      refuse("", name, ": ", names[i], " goes from ", r.min, " to ", r.max,
             "; a reflectance stays between 0 and 1 (field.clamped(0, 1)).");
  }
}

ColorFieldPtr load_vdb_color_field(const std::string& path, const std::string& grid) {
  const auto opened = open_vdb_grid(path, grid);
  const std::string name = vdb_grid_quoted(path, grid);
  if (!opened->isType<openvdb::Vec3SGrid>())
    refuse("", name, " holds ", opened->valueType(),
           " values; a colour takes vectors of three floats.");
  const auto& vectors = static_cast<const openvdb::Vec3SGrid&>(*opened);
  const openvdb::CoordBBox box = vectors.evalActiveVoxelBoundingBox();
  if (box.empty()) refuse("", name, " is empty: no voxel is active.");
  const Vec3 first{double(box.min().x()), double(box.min().y()), double(box.min().z())};
  const Affine map = index_to_object(path, *opened);
  std::array<FieldPtr, 3> parts;
  for (int c = 0; c < 3; ++c) {
    const auto bricks = vdb_bricks(
        vectors, box, [c](const auto& v) { return v[c]; }, name);
    // Its box is that of the voxels: beyond it the nearest one, as the albedo goes on.
    parts[c] = std::make_shared<TransformedField>(
        std::make_shared<GridField>(bricks, Vec3{1, 1, 1}, first, std::nullopt), map);
  }
  return std::make_shared<ColorField>(parts, name);
}

}  // namespace gpis
