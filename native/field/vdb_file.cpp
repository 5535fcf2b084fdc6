#include "field/vdb_file.h"

#include <algorithm>
#include <filesystem>

#include "core/errors.h"
#include "field/check.h"
#include "field/vdb_open.h"

namespace gpis {
namespace {

// Calls `visit` with the grid in this type, if that is its own.
template <class GridType, class Visit>
bool visit_as(const openvdb::GridBase& grid, const Visit& visit) {
  if (!grid.isType<GridType>()) return false;
  visit(static_cast<const GridType&>(grid));
  return true;
}

Box3 bounds_of(const openvdb::CoordBBox& box, const Affine& map) {
  Box3 bounds;
  for (int corner = 0; corner < 8; ++corner) {
    const auto pick = [&](int axis) {
      return double(corner & (1 << axis) ? box.max()[axis] : box.min()[axis]);
    };
    bounds.include(map.point({pick(0), pick(1), pick(2)}));
  }
  return bounds;
}

Vec3 voxel_size_of(const Affine& map) {
  const Mat3 axes = transpose(map.linear);
  return {length(axes.row[0]), length(axes.row[1]), length(axes.row[2])};
}

template <class GridType>
void put(openvdb::GridPtrVec& out, const VdbArrays& arrays, const VdbArray& array) {
  using Value = typename GridType::ValueType;
  const float* v = array.values.data();
  Value background{};
  if constexpr (std::is_same_v<Value, float>)
    background = *std::max_element(array.values.begin(), array.values.end());
  auto grid = GridType::create(background);
  auto voxels = grid->getAccessor();
  const Index3& n = arrays.resolution;
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k, v += array.components) {
        if constexpr (std::is_same_v<Value, float>)
          voxels.setValueOn({i, j, k}, *v);
        else
          voxels.setValueOn({i, j, k}, Value(v[0], v[1], v[2]));
      }
  grid->pruneGrid();  // blocks of one value: beyond a narrow band
  grid->setName(array.name);
  const Vec3 h = arrays.voxel_size, o = arrays.origin;
  auto transform = openvdb::math::Transform::createLinearTransform(1.0);
  transform->postScale(openvdb::Vec3d(h.x, h.y, h.z));
  transform->postTranslate(openvdb::Vec3d(o.x, o.y, o.z));
  grid->setTransform(transform);
  out.push_back(grid);
}

}  // namespace

std::vector<VdbGridInfo> vdb_grids(const std::string& path) {
  std::vector<VdbGridInfo> out;
  for (const std::string& name : vdb_grid_names(path)) {
    const auto grid = open_vdb_grid(path, name);
    VdbGridInfo info;
    info.name = name;
    info.type = grid->valueType();
    const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    info.resolution = {0, 0, 0};
    if (!box.empty()) info.resolution = {box.dim().x(), box.dim().y(), box.dim().z()};
    if (grid->transform().isLinear()) {
      const Affine map = index_to_object(path, *grid);
      info.voxel_size = voxel_size_of(map);
      if (!box.empty()) info.bounds = bounds_of(box, map);
    }
    const auto scalar = [&](const auto& typed) {
      info.background = typed.background();
      if (box.empty()) return;
      Range range{kInfinity, -kInfinity};
      for (auto it = typed.cbeginValueOn(); it; ++it) {
        range.min = std::min(range.min, double(*it));
        range.max = std::max(range.max, double(*it));
      }
      info.values = range;
    };
    visit_as<openvdb::FloatGrid>(*grid, scalar) || visit_as<openvdb::DoubleGrid>(*grid, scalar);
    out.push_back(std::move(info));
  }
  return out;
}

void write_vdb(const std::string& path, const VdbArrays& arrays) {
  const Vec3& h = arrays.voxel_size;
  if (!(h.x * h.y * h.z >= 3e-15))  // OpenVDB's tolerance
    refuse("The voxels of \"", path, "\" would be ", h.x, " x ", h.y, " x ", h.z,
           " large; OpenVDB takes none below 1.5e-05. Make the object larger, and scale it down "
           "where it is placed.");
  const auto folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder))
    throw FileNotFound("There is no folder \"" + folder.string() + "\" to write \"" + path +
                       "\" into.");
  with_vdb_errors(path, "written", [&] {
    openvdb::initialize();
    openvdb::GridPtrVec grids;
    for (const VdbArray& array : arrays.grids) {
      if (array.components == 1)
        put<openvdb::FloatGrid>(grids, arrays, array);
      else
        put<openvdb::Vec3SGrid>(grids, arrays, array);
    }
    const std::string partial = path + ".part";
    openvdb::io::File(partial).write(grids);
    std::filesystem::rename(partial, path);
  });
}

VdbArrays read_vdb(const std::string& path, const std::vector<std::string>& names) {
  std::vector<openvdb::GridBase::Ptr> grids;
  openvdb::CoordBBox box;
  for (const std::string& name : names.empty() ? vdb_grid_names(path) : names) {
    grids.push_back(open_vdb_grid(path, name));
    const Affine a = index_to_object(path, *grids.front()),
                 b = index_to_object(path, *grids.back());
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        if (i != j && b.linear.row[i][j] != 0)
          refuse("Grid '", name, "' of \"", path,
                 "\" is rotated or sheared; an array cannot say that.");
      const double scale = std::abs(a.linear.row[i][i]);
      if (std::abs(a.linear.row[i][i] - b.linear.row[i][i]) > 1e-9 * scale ||
          std::abs(a.translation[i] - b.translation[i]) > 1e-6 * scale)
        refuse("Grids '", grids.front()->getName(), "' and '", name, "' of \"", path,
               "\" have different voxels; read them one by one (names=[...]).");
    }
    box.expand(grids.back()->evalActiveVoxelBoundingBox());
  }
  if (box.empty()) refuse("\"", path, "\" has no active voxel in the grids asked for.");

  VdbArrays out;
  const Affine map = index_to_object(path, *grids.front());
  out.resolution = {box.dim().x(), box.dim().y(), box.dim().z()};
  out.voxel_size = {map.linear.row[0].x, map.linear.row[1].y, map.linear.row[2].z};
  out.origin = bounds_of({box.min(), box.min()}, map).min;
  for (const auto& grid : grids) {
    VdbArray array;
    array.name = grid->getName();
    const auto copy = [&](const auto& typed) {
      using Value = typename std::decay_t<decltype(typed)>::ValueType;
      const auto voxels = typed.getConstAccessor();
      array.components = openvdb::VecTraits<Value>::IsVec ? 3 : 1;
      array.values.reserve(static_cast<std::size_t>(box.volume()) * array.components);
      for (int i = box.min().x(); i <= box.max().x(); ++i)
        for (int j = box.min().y(); j <= box.max().y(); ++j)
          for (int k = box.min().z(); k <= box.max().z(); ++k) {
            const Value v = voxels.getValue({i, j, k});
            if constexpr (openvdb::VecTraits<Value>::IsVec)
              for (int c = 0; c < 3; ++c) array.values.push_back(static_cast<float>(v[c]));
            else
              array.values.push_back(static_cast<float>(v));
          }
    };
    if (!(visit_as<openvdb::FloatGrid>(*grid, copy) || visit_as<openvdb::DoubleGrid>(*grid, copy) ||
          visit_as<openvdb::Vec3SGrid>(*grid, copy) || visit_as<openvdb::Vec3DGrid>(*grid, copy)))
      refuse("Grid '", array.name, "' of \"", path, "\" holds ", grid->valueType(),
             " values; read_vdb takes float, double and vectors of three. Name others with "
             "names=[...].");
    out.grids.push_back(std::move(array));
  }
  return out;
}

}  // namespace gpis
