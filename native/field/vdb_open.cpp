#include "field/vdb_open.h"

#include <filesystem>

#pragma GCC visibility push(default)
#include <openvdb/tools/SignedFloodFill.h>
#pragma GCC visibility pop

#include "core/errors.h"
#include "field/check.h"
#include "field/vdb_reader.h"

namespace gpis {
namespace {

template <class Action>
auto with_file(const std::string& path, const Action& action) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    throw FileNotFound("There is no file \"" + path + "\".");
  if (!std::filesystem::is_regular_file(path, error))
    refuse("\"", path, "\" is not a file; it takes the path of a .vdb file.");
  return with_vdb_errors(path, "read", [&] {
    openvdb::initialize();
    VdbReader file(path);
    return action(file);
  });
}

// A file may leave the inactive voxels of a level set without their sign.
template <class GridType>
void fill_level_set(openvdb::GridBase& grid) {
  if (!grid.isType<GridType>() || grid.getGridClass() != openvdb::GRID_LEVEL_SET) return;
  auto& tree = static_cast<GridType&>(grid).tree();
  const auto outside = openvdb::math::Abs(tree.background());
  openvdb::tools::signedFloodFillWithValues(tree, outside, -outside);
  static_cast<GridType&>(grid).tree().root().setBackground(outside, /*updateChildNodes=*/false);
}

}  // namespace

std::vector<std::string> vdb_grid_names(const std::string& path) {
  return with_file(path, [](VdbReader& file) { return file.names(); });
}

openvdb::MetaMap vdb_metadata(const std::string& path) {
  return with_file(path, [](VdbReader& file) { return file.metadata(); });
}

openvdb::GridBase::Ptr open_vdb_grid(const std::string& path, const std::string& name) {
  return with_file(path, [&](VdbReader& file) {
    const auto grid = file.read(name);
    if (!grid) {
      std::string all;
      for (const std::string& other : file.names()) all += (all.empty() ? "" : ", ") + other;
      refuse("\"", path, "\" has no grid '", name, "'; it holds: ", all.empty() ? "none" : all,
             ".");
    }
    fill_level_set<openvdb::FloatGrid>(*grid);
    fill_level_set<openvdb::DoubleGrid>(*grid);
    return grid;
  });
}

std::string vdb_grid_quoted(const std::string& path, const std::string& grid) {
  return "Grid '" + grid + "' of \"" + path + "\"";
}

// OpenVDB maps row vectors.
Affine index_to_object(const std::string& path, const openvdb::GridBase& grid) {
  if (!grid.transform().isLinear())
    refuse("Grid '", grid.getName(), "' of \"", path,
           "\" lies in a perspective frustum; only affine transforms can be read: resample it.");
  const openvdb::Mat4d m = grid.transform().baseMap()->getAffineMap()->getMat4();
  Affine a;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) a.linear.row[i][j] = m(j, i);
    a.translation[i] = m(3, i);
  }
  return a;
}

}  // namespace gpis
