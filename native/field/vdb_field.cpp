#include "field/vdb_field.h"

#include "field/check.h"
#include "field/grid_field.h"
#include "field/transformed_field.h"
#include "field/vdb_bricks.h"
#include "field/vdb_open.h"

namespace gpis {
namespace {

// Refuses what no field can be made of, counting it and naming the first voxel.
template <class GridType>
void check_values(const GridType& grid, const std::string& name, GridMeaning meaning) {
  std::size_t not_finite = 0, negative = 0;
  openvdb::Coord first_not_finite, first_negative;
  for (auto it = grid.cbeginValueAll(); it; ++it) {
    const auto v = *it;
    if (!std::isfinite(static_cast<float>(v))) {
      if (not_finite++ == 0) first_not_finite = it.getCoord();
    } else if (v < 0) {
      if (negative++ == 0) first_negative = it.getCoord();
    }
  }
  const auto at = [](const openvdb::Coord& c) {
    std::ostringstream text;
    text << "the first at index (" << c.x() << ", " << c.y() << ", " << c.z() << ')';
    return text.str();
  };
  if (not_finite > 0)
    refuse("", name, " holds ", not_finite, " voxels that are NaN or infinite, ",
           at(first_not_finite), "; repair or remove them.");
  if (!std::isfinite(static_cast<float>(grid.background())))
    refuse("", name, " has the background ", grid.background(), "; it takes a finite one.");
  if (meaning == GridMeaning::variance && (negative > 0 || grid.background() < 0))
    refuse("", name, " is to be a variance and holds ", negative, " negative voxels (background ",
           grid.background(), negative > 0 ? "), " + at(first_negative) : std::string(")"),
           "; a variance is not negative.");
}

template <class GridType>
FieldPtr make_field(const GridType& grid, const Affine& map, const std::string& name,
                    GridMeaning meaning) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (box.empty()) refuse("", name, " is empty: no voxel is active.");
  check_values(grid, name, meaning);

  const auto read = [meaning](auto v) {
    return static_cast<float>(meaning == GridMeaning::variance ? std::sqrt(v) : v);
  };
  const auto bricks = vdb_bricks(grid, box, read, name);

  const double background = read(grid.background());
  const Vec3 first{double(box.min().x()), double(box.min().y()), double(box.min().z())};
  const Vec3 diagonal{map.linear.row[0].x, map.linear.row[1].y, map.linear.row[2].z};
  bool along_axes = diagonal.x > 0 && diagonal.y > 0 && diagonal.z > 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) along_axes &= i == j || map.linear.row[i][j] == 0;
  if (along_axes)
    return std::make_shared<GridField>(bricks, diagonal, map.point(first), background);
  const auto in_index_space = std::make_shared<GridField>(bricks, Vec3{1, 1, 1}, first, background);
  return std::make_shared<TransformedField>(in_index_space, map);
}

}  // namespace

FieldPtr load_vdb_field(const std::string& path, const std::string& grid, GridMeaning meaning) {
  const auto opened = open_vdb_grid(path, grid);
  const std::string name = vdb_grid_quoted(path, grid);
  const Affine map = index_to_object(path, *opened);
  if (opened->isType<openvdb::FloatGrid>())
    return make_field(static_cast<const openvdb::FloatGrid&>(*opened), map, name, meaning);
  if (opened->isType<openvdb::DoubleGrid>())
    return make_field(static_cast<const openvdb::DoubleGrid&>(*opened), map, name, meaning);
  refuse("", name, " holds ", opened->valueType(),
         " values; a scalar field takes float or double ones.");
}

}  // namespace gpis
