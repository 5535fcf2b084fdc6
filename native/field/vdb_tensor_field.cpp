#include "field/vdb_tensor_field.h"

#include "field/check.h"
#include "field/tensor_grid_field.h"
#include "field/vdb_bricks.h"
#include "field/vdb_open.h"

namespace gpis {
namespace {

using Half = std::array<std::shared_ptr<const BrickGrid>, 3>;

template <class GridType>
Half read_half(const openvdb::GridBase& any, const openvdb::CoordBBox& box,
               const std::string& name) {
  const auto& grid = static_cast<const GridType&>(any);
  Half half;
  for (int c = 0; c < 3; ++c)
    half[c] = vdb_bricks(
        grid, box, [c](const auto& v) { return static_cast<float>(v[c]); }, name);
  return half;
}

Half read_half(const openvdb::GridBase& grid, const openvdb::CoordBBox& box,
               const std::string& name) {
  if (grid.isType<openvdb::Vec3SGrid>()) return read_half<openvdb::Vec3SGrid>(grid, box, name);
  if (grid.isType<openvdb::Vec3DGrid>()) return read_half<openvdb::Vec3DGrid>(grid, box, name);
  refuse("", name, " holds ", grid.valueType(),
         " values; half of a tensor field takes vectors of three floats or doubles.");
}

}  // namespace

TensorFieldPtr load_vdb_tensor_field(const std::string& path) {
  const auto diagonal = open_vdb_grid(path, kAnisotropyGrids[0]),
             other = open_vdb_grid(path, kAnisotropyGrids[1]);
  const std::string names[2] = {vdb_grid_quoted(path, kAnisotropyGrids[0]),
                                vdb_grid_quoted(path, kAnisotropyGrids[1])};
  const Affine map = index_to_object(path, *diagonal), map2 = index_to_object(path, *other);
  for (int i = 0; i < 3; ++i)
    if (!(length(map.linear.row[i] - map2.linear.row[i]) <= 1e-9 * length(map.linear.row[i])) ||
        !(std::abs(map.translation[i] - map2.translation[i]) <= 1e-6 * length(map.linear.row[i])))
      refuse("", names[0], " and ", names[1],
             " have different transforms; both halves of a tensor stand on the same voxels.");
  const openvdb::CoordBBox box = diagonal->evalActiveVoxelBoundingBox();
  if (box.empty()) refuse("", names[0], " is empty: no voxel is active.");

  const Half a = read_half(*diagonal, box, names[0]), b = read_half(*other, box, names[1]);
  const Vec3 first{double(box.min().x()), double(box.min().y()), double(box.min().z())};
  return std::make_shared<TensorGridField>(
      TensorGridField::Bricks{a[0], a[1], a[2], b[0], b[1], b[2]}, map * Affine{Mat3{}, first},
      [&](const Index3& n) {
        std::ostringstream text;
        text << "The voxel (" << n[0] + box.min().x() << ", " << n[1] + box.min().y() << ", "
             << n[2] + box.min().z() << ") of the anisotropy of \"" << path << '"';
        return text.str();
      });
}

}  // namespace gpis
