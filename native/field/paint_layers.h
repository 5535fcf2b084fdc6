// The grids behind painted fields, for the files of this folder. A layer is one field on the nodes
// of a box: a scalar, a colour, or a tensor in two grids. It has leaves (8³ nodes) only where it is
// not its background; beside it stand copies of the leaves that were painted on, as they were
// before.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bitset>
#include <memory>
#include <optional>

#include "core/sym_mat3.h"
#include "field/brush_images.h"
#include "field/openvdb.h"

namespace gpis {

// How the values of a layer are stored: single precision in K grids.
struct ScalarLayer {
  using Grid = openvdb::FloatGrid;
  static constexpr int K = 1;
  using Value = double;
  using Stored = std::array<float, 1>;
  static Value load(const Stored& s) { return s[0]; }
  static Stored store(Value v) { return {static_cast<float>(v)}; }
};
struct ColorLayer {
  using Grid = openvdb::Vec3SGrid;
  static constexpr int K = 1;
  using Value = Vec3;
  using Stored = std::array<openvdb::Vec3f, 1>;
  static Value load(const Stored& s) { return {s[0][0], s[0][1], s[0][2]}; }
  static Stored store(const Value& v) { return {openvdb::Vec3f(v.x, v.y, v.z)}; }
};
struct TensorLayer {
  using Grid = openvdb::Vec3SGrid;
  static constexpr int K = 2;
  using Value = SymMat3;
  using Stored = std::array<openvdb::Vec3f, 2>;
  static Value load(const Stored& s) {
    return {s[0][0], s[0][1], s[0][2], s[1][0], s[1][1], s[1][2]};
  }
  static Stored store(const Value& v) {
    return {openvdb::Vec3f(v.xx, v.yy, v.zz), openvdb::Vec3f(v.xy, v.xz, v.yz)};
  }
};

enum class Rewrite { paint, extend };

template <class StoredAs>
struct Layer {
  using Kind = StoredAs;
  using Grid = typename Kind::Grid;
  using Leaf = typename Grid::TreeType::LeafNodeType;

  std::array<typename Grid::Ptr, Kind::K> grid, base;  // none: not painted, and not in the file

  explicit operator bool() const { return grid[0] != nullptr; }
  // All values of the leaf at a place, whether it is there or not.
  void read_leaf(const openvdb::Coord& at,
                 std::array<typename Kind::Stored, Leaf::SIZE>& values) const {
    for (int k = 0; k < Kind::K; ++k) {
      const Leaf* leaf = grid[k]->constTree().probeConstLeaf(at);
      const auto* stored = leaf ? leaf->buffer().data() : nullptr;
      const auto constant = leaf ? typename Grid::ValueType(0) : grid[k]->constTree().getValue(at);
      for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) values[n][k] = stored ? stored[n] : constant;
    }
  }
  // The leaves of a place to be written to, which are made if they are not there. The first time
  // they are painted on they are copied aside; what extends a grid is part of what it was.
  struct Touched {
    std::array<Leaf*, Kind::K> leaf{}, base{};
  };
  Touched touch(const openvdb::Coord& at, Rewrite how) const {
    Touched t;
    for (int k = 0; k < Kind::K; ++k) {
      t.leaf[k] = grid[k]->tree().touchLeaf(at);
      if (how == Rewrite::extend)
        t.base[k] = base[k]->tree().probeLeaf(at);
      else if (!base[k]->tree().probeConstLeaf(at))
        base[k]->tree().addLeaf(new Leaf(*t.leaf[k]));
    }
    return t;
  }
};

inline openvdb::Coord clamped(openvdb::Coord c, const openvdb::CoordBBox& box) {
  c.maxComponent(box.min());
  c.minComponent(box.max());
  return c;
}

// Nodes of a layer; beyond the box stands the nearest one. One for each thread.
template <class Kind>
class LayerReader {
 public:
  using Value = typename Kind::Value;
  using Stored = typename Kind::Stored;
  using Grid = typename Kind::Grid;

  LayerReader(const std::array<typename Grid::Ptr, Kind::K>& grids, const openvdb::CoordBBox& box)
      : box_(box) {
    for (int k = 0; k < Kind::K; ++k) voxels_[k].emplace(grids[k]->tree());
  }
  Stored stored(const openvdb::Coord& c) const {
    Stored s;
    for (int k = 0; k < Kind::K; ++k) s[k] = voxels_[k]->getValue(c);
    return s;
  }
  Value at(const openvdb::Coord& c) const { return Kind::load(stored(clamped(c, box_))); }
  // Trilinear between nodes; `x` in index space.
  Value sample(const Vec3& x) const {
    int cell[3];
    double u[3];
    for (int i = 0; i < 3; ++i) {
      const int low = box_.min()[i], high = box_.max()[i];
      const double p = std::clamp(x[i], double(low), double(high));
      cell[i] = std::clamp(static_cast<int>(std::floor(p)), low, std::max(low, high - 1));
      u[i] = p - cell[i];
    }
    Value sum{};
    for (int corner = 0; corner < 8; ++corner) {
      const int di = corner >> 2, dj = corner >> 1 & 1, dk = corner & 1;
      const double w = (di ? u[0] : 1 - u[0]) * (dj ? u[1] : 1 - u[1]) * (dk ? u[2] : 1 - u[2]);
      if (w != 0) sum = sum + at({cell[0] + di, cell[1] + dj, cell[2] + dk}) * w;
    }
    return sum;
  }

 private:
  // Not registered with the tree: it does not change while one of these lives.
  using Voxels = openvdb::tree::ValueAccessor<const typename Grid::TreeType, false>;
  std::array<std::optional<Voxels>, Kind::K> voxels_;
  openvdb::CoordBBox box_;
};

// The mean of the six neighbours; `nodes` is one of the readers of nodes.
template <class Nodes>
typename Nodes::Value around(const Nodes& nodes, const openvdb::Coord& c) {
  auto sum = nodes.at(c.offsetBy(-1, 0, 0)) + nodes.at(c.offsetBy(1, 0, 0));
  sum = sum + nodes.at(c.offsetBy(0, -1, 0)) + nodes.at(c.offsetBy(0, 1, 0));
  sum = sum + nodes.at(c.offsetBy(0, 0, -1)) + nodes.at(c.offsetBy(0, 0, 1));
  return sum * (1.0 / 6);
}
// Central differences of a scalar in index space, one-sided at the sides of the box.
template <class Nodes>
Vec3 difference(const Nodes& nodes, const openvdb::CoordBBox& box, const openvdb::Coord& c) {
  Vec3 out;
  for (int i = 0; i < 3; ++i) {
    openvdb::Coord low = c, high = c;
    low[i] = std::max(c[i] - 1, box.min()[i]);
    high[i] = std::min(c[i] + 1, box.max()[i]);
    if (low[i] == high[i]) continue;
    const double change = nodes.at(high) - nodes.at(low);
    out[i] = high[i] - low[i] == 2 ? change / 2 : change;
  }
  return out;
}

inline constexpr const char* kPaintedGrids[4] = {"sigma", "anisotropy_diagonal",
                                                 "anisotropy_offdiagonal", "albedo"};
inline constexpr const char* kBasePrefix = "gpis_base_";

struct PaintLayers {
  openvdb::CoordBBox box, base_box;  // of the nodes; before the grid was extended
  Affine to_object, to_index;
  Mat3 gradient_to_object;  // of differences in index space
  openvdb::math::Transform::Ptr transform;
  double constant_sigma = 1;  // where no grid says otherwise
  SymMat3 constant_anisotropy = SymMat3::identity();
  Layer<ScalarLayer> mean, sigma;
  Layer<TensorLayer> anisotropy;
  Layer<ColorLayer> albedo;

  // Layers that are there, as (layer, names of its grids).
  template <class Visit>
  void visit(const Visit& visit) const {
    visit(mean, std::array<std::string, 1>{mean.grid[0]->getName()});
    if (sigma) visit(sigma, std::array<std::string, 1>{kPaintedGrids[0]});
    if (anisotropy)
      visit(anisotropy, std::array<std::string, 2>{kPaintedGrids[1], kPaintedGrids[2]});
    if (albedo) visit(albedo, std::array<std::string, 1>{kPaintedGrids[3]});
  }

  LayerReader<ScalarLayer> mean_reader() const { return {mean.grid, box}; }
  Vec3 point(const openvdb::Coord& c) const {
    return to_object.point({double(c.x()), double(c.y()), double(c.z())});
  }
};

// Leaves of the box that meet a ball of one of the centres, in order.
std::vector<openvdb::Coord> leaves_of_balls(const PaintLayers& layers, const Vec3* centers,
                                            int count, double radius);
// All leaves of the box.
std::vector<openvdb::Coord> leaves_of_box(const openvdb::CoordBBox& box);

// Gives the nodes of `leaves` new values: `make_worker()` makes a function for one thread,
//   std::optional<Value> worker(ijk, x, old value, PaintCounts&),
// that reads the layers as they are; what it gives is written when all are done. Leaves without a
// change are not made.
template <class Kind, class MakeWorker>
PaintCounts rewrite(const PaintLayers& layers, const Layer<Kind>& layer,
                    const std::vector<openvdb::Coord>& leaves, const MakeWorker& make_worker,
                    Rewrite how = Rewrite::paint) {
  using Leaf = typename Layer<Kind>::Leaf;
  using Stored = typename Kind::Stored;
  struct Change {
    std::bitset<Leaf::SIZE> nodes;
    std::array<Stored, Leaf::SIZE> values;
  };
  std::vector<std::unique_ptr<Change>> changes(leaves.size());
  std::vector<PaintCounts> counts(leaves.size());
  const tbb::blocked_range<std::size_t> all(0, leaves.size());
  tbb::parallel_for(all, [&](const tbb::blocked_range<std::size_t>& some) {
    auto worker = make_worker();
    std::array<Stored, Leaf::SIZE> old;
    for (std::size_t l = some.begin(); l < some.end(); ++l) {
      layer.read_leaf(leaves[l], old);
      for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
        const openvdb::Coord c = leaves[l] + Leaf::offsetToLocalCoord(n);
        if (!layers.box.isInside(c)) continue;
        const auto value = worker(c, layers.point(c), Kind::load(old[n]), counts[l]);
        if (!value) continue;
        const Stored stored = Kind::store(*value);
        if (stored == old[n]) continue;
        if (!changes[l]) changes[l].reset(new Change);  // its values are not cleared
        changes[l]->nodes.set(n);
        changes[l]->values[n] = stored;
        ++counts[l].nodes;
      }
    }
  });
  std::vector<typename Layer<Kind>::Touched> written(leaves.size());
  PaintCounts sum;
  for (std::size_t l = 0; l < leaves.size(); ++l) {
    counts[l].leaves = changes[l] != nullptr;
    sum.add(counts[l]);
    if (changes[l]) written[l] = layer.touch(leaves[l], how);
  }
  tbb::parallel_for(all, [&](const tbb::blocked_range<std::size_t>& some) {
    for (std::size_t l = some.begin(); l < some.end(); ++l)
      for (openvdb::Index n = 0; changes[l] && n < Leaf::SIZE; ++n)
        if (changes[l]->nodes[n])
          for (int k = 0; k < Kind::K; ++k) {
            const auto& value = changes[l]->values[n][k];
            written[l].leaf[k]->setValueOn(n, value);
            if (written[l].base[k]) written[l].base[k]->setValueOn(n, value);
          }
  });
  return sum;
}

// A grid on the layers' nodes; a layer of one value.
template <class Grid>
typename Grid::Ptr make_grid(const PaintLayers& layers, const typename Grid::ValueType& value,
                             const std::string& name) {
  auto grid = Grid::create(value);
  grid->setTransform(layers.transform->copy());
  grid->setName(name);
  return grid;
}
// Active voxels at both ends say where a grid's box is, in a file too.
template <class Kind>
void mark_box(const PaintLayers& layers, const Layer<Kind>& layer) {
  for (const auto& grid : layer.grid)
    for (const openvdb::Coord& c : {layers.box.min(), layers.box.max()})
      grid->tree().setActiveState(c, true);
}
template <class Kind>
void forget_base(const PaintLayers& layers, Layer<Kind>& layer) {
  for (int k = 0; k < Kind::K; ++k)
    layer.base[k] = make_grid<typename Kind::Grid>(layers, layer.grid[k]->background(), "");
}
void make_sigma(PaintLayers& layers, double value);
void make_anisotropy(PaintLayers& layers, const SymMat3& value);
void make_albedo(PaintLayers& layers);

// ℓ = |A|^(1/6).
double length_scale_of(const SymMat3& a);

// One dab. Each is in the file of what it changes, with its formulas.
PaintCounts paint_mean(const PaintLayers& layers, const Brush& brush, const DabImages& dab);
PaintCounts paint_deviation(const PaintLayers& layers, const Brush& brush, const DabImages& dab);
PaintCounts paint_tensor(const PaintLayers& layers, const Brush& brush, const DabImages& dab);
PaintCounts paint_albedo(const PaintLayers& layers, const Brush& brush, const DabImages& dab);

}  // namespace gpis
