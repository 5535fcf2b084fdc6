// Painted fields from a .vdb file and into one.
#include <filesystem>

#include "core/errors.h"
#include "field/check.h"
#include "field/painted_fields_impl.h"
#include "field/vdb_open.h"
#include "field/vdb_tensor_field.h"

namespace gpis {
namespace {

constexpr const char* kStrokes = "gpis_strokes";
constexpr const char* kBaseMin = "gpis_base_min";
constexpr const char* kBaseMax = "gpis_base_max";

bool is_ours(const std::string& name) {
  return name.rfind(kBasePrefix, 0) == 0 ||
         std::find(std::begin(kPaintedGrids), std::end(kPaintedGrids), name) !=
             std::end(kPaintedGrids);
}

openvdb::FloatGrid::Ptr read_mean(const std::string& path, const std::string& name) {
  const auto any = open_vdb_grid(path, name);
  openvdb::FloatGrid::Ptr grid;
  if (any->isType<openvdb::FloatGrid>())
    grid = openvdb::gridPtrCast<openvdb::FloatGrid>(any);
  else if (any->isType<openvdb::DoubleGrid>())
    grid = std::make_shared<openvdb::FloatGrid>(static_cast<const openvdb::DoubleGrid&>(*any));
  else
    refuse("", vdb_grid_quoted(path, name), " holds ", any->valueType(),
           " values; a mean takes float or double ones.");
  grid->setName(name);
  // Its inside and outside are filled in; painted, it is no longer a distance in a narrow band.
  grid->setGridClass(openvdb::GRID_UNKNOWN);
  return grid;
}

// Grids of a layer as they are; false if one is not there, of another type or on other voxels.
template <class Kind>
bool read_layer(const PaintLayers& layers, const std::string& path,
                const std::vector<std::string>& present, const char* const* names,
                Layer<Kind>& layer) {
  using Grid = typename Kind::Grid;
  const auto read = [&](const std::string& name) -> typename Grid::Ptr {
    if (std::find(present.begin(), present.end(), name) == present.end()) return nullptr;
    const auto any = open_vdb_grid(path, name);
    if (!any->isType<Grid>() || any->transform() != *layers.transform) return nullptr;
    return openvdb::gridPtrCast<Grid>(any);
  };
  Layer<Kind> found;
  for (int k = 0; k < Kind::K; ++k)
    if (!(found.grid[k] = read(names[k]))) return false;
  forget_base(layers, found);
  for (int k = 0; k < Kind::K; ++k)
    if (const auto base = read(kBasePrefix + std::string(names[k]))) found.base[k] = base;
  layer = found;
  mark_box(layers, layer);
  return true;
}

// Nodes of any field; leaves only where it is not `layer`'s background.
template <class Kind, class Value>
void sample_into(const PaintLayers& layers, Layer<Kind>& layer, const Value& value) {
  rewrite<Kind>(layers, layer, leaves_of_box(layers.box), [&] {
    return [&](const openvdb::Coord&, const Vec3& x, const typename Kind::Value&, PaintCounts&) {
      return std::optional<typename Kind::Value>(value(x));
    };
  });
  forget_base(layers, layer);
}

}  // namespace

void PaintedFields::Impl::open(const PaintSource& source) {
  check_positive("sigma", source.sigma);
  if (!(source.squared_lengths.xx > 0 && Cholesky3(source.squared_lengths).positive &&
        std::isfinite(Cholesky3(source.squared_lengths).determinant())))
    refuse("length_scale holds the entries of a matrix that is not positive definite.");
  check_positive("sigma_factor", source.sigma_factor);
  const std::vector<std::string> present = vdb_grid_names(source.path);
  layers.constant_sigma = source.sigma;
  layers.constant_anisotropy = source.squared_lengths;

  // The mean, whose voxels all others take.
  layers.mean.grid[0] = read_mean(source.path, source.mean);
  layers.transform = layers.mean.grid[0]->transformPtr();
  layers.to_object = index_to_object(source.path, *layers.mean.grid[0]);
  layers.to_index = inverse(layers.to_object);
  layers.gradient_to_object = transpose(layers.to_index.linear);
  layers.box = layers.base_box = layers.mean.grid[0]->evalActiveVoxelBoundingBox();
  if (layers.box.empty())
    refuse("", vdb_grid_quoted(source.path, source.mean), " is empty: no voxel is active.");
  const openvdb::MetaMap meta = vdb_metadata(source.path);
  const auto low = meta.getMetadata<openvdb::Vec3IMetadata>(kBaseMin),
             high = meta.getMetadata<openvdb::Vec3IMetadata>(kBaseMax);
  if (!low)  // else it was checked before it was painted on
    for (auto it = layers.mean.grid[0]->cbeginValueOn(); it; ++it)
      if (!std::isfinite(*it))
        refuse("", vdb_grid_quoted(source.path, source.mean), " holds values that are not finite.");
  if (low && high) layers.base_box = {openvdb::Coord(low->value()), openvdb::Coord(high->value())};
  const char* mean_name = source.mean.c_str();
  forget_base(layers, layers.mean);
  Layer<ScalarLayer> mean;
  if (read_layer(layers, source.path, present, &mean_name, mean)) layers.mean.base = mean.base;
  mark_box(layers, layers.mean);

  if (!source.sigma_grid.empty()) {
    const bool plain = source.sigma_grid == kPaintedGrids[0] &&
                       source.sigma_meaning == GridMeaning::value && source.sigma_factor == 1;
    if (!plain || !read_layer(layers, source.path, present, kPaintedGrids, layers.sigma)) {
      const FieldPtr field = load_vdb_field(source.path, source.sigma_grid, source.sigma_meaning);
      const auto value = [&](const Vec3& x) { return field->value(x) * source.sigma_factor; };
      make_sigma(layers, value(layers.point(layers.box.min())));
      sample_into(layers, layers.sigma, value);
    }
  }
  if (source.anisotropy &&
      !read_layer(layers, source.path, present, kPaintedGrids + 1, layers.anisotropy)) {
    const TensorFieldPtr field = load_vdb_tensor_field(source.path);
    make_anisotropy(layers, field->value(layers.point(layers.box.min())));
    sample_into(layers, layers.anisotropy, [&](const Vec3& x) { return field->value(x); });
  }
  if (source.albedo && !read_layer(layers, source.path, present, kPaintedGrids + 3, layers.albedo))
    refuse("\"", source.path, "\" has no grid 'albedo' of single-precision colours on the voxels ",
           "of '", source.mean, "'.");
  for (const std::string& name : present)
    if (name != source.mean && !is_ours(name)) others.push_back(open_vdb_grid(source.path, name));
}

void PaintedFields::write(const std::string& path, const std::string& strokes) const {
  const PaintLayers& layers = impl_->layers;
  const auto folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder))
    throw FileNotFound("There is no folder \"" + folder.string() + "\" to write \"" + path +
                       "\" into.");
  openvdb::GridPtrVec grids;
  layers.visit([&](const auto& layer, const auto& names) {
    for (std::size_t k = 0; k < names.size(); ++k) {
      grids.push_back(layer.grid[k]);
      if (layer.base[k]->tree().leafCount() == 0) continue;
      layer.base[k]->setName(kBasePrefix + names[k]);
      grids.push_back(layer.base[k]);
    }
  });
  grids.insert(grids.end(), impl_->others.begin(), impl_->others.end());
  openvdb::MetaMap meta;
  meta.insertMeta(kStrokes, openvdb::StringMetadata(strokes));
  meta.insertMeta(kBaseMin, openvdb::Vec3IMetadata(layers.base_box.min().asVec3i()));
  meta.insertMeta(kBaseMax, openvdb::Vec3IMetadata(layers.base_box.max().asVec3i()));
  with_vdb_errors(path, "written", [&] {
    const std::string partial = path + ".part";
    openvdb::io::File file(partial);
    // A stroke waits for it: packing a mean of 256³ nodes to 7 tenths takes half a second.
    file.setCompression(openvdb::io::COMPRESS_ACTIVE_MASK);
    file.write(grids, meta);
    std::filesystem::rename(partial, path);
  });
}

std::string read_strokes(const std::string& path) {
  vdb_grid_names(path);  // the sentences about files that are none
  const auto strokes = vdb_metadata(path).getMetadata<openvdb::StringMetadata>(kStrokes);
  return strokes ? strokes->value() : std::string();
}

}  // namespace gpis
