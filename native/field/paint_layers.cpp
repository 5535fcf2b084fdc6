#include <algorithm>

#include "field/leaf_nodes.h"

namespace gpis {
namespace {

template <class Visit>
void visit_leaves(const openvdb::CoordBBox& box, const Visit& visit) {
  if (box.empty()) return;
  const openvdb::Coord first = leaf_of(box.min()), last = leaf_of(box.max());
  for (int i = first.x(); i <= last.x(); i += kLeafSide)
    for (int j = first.y(); j <= last.y(); j += kLeafSide)
      for (int k = first.z(); k <= last.z(); k += kLeafSide) visit(openvdb::Coord(i, j, k));
}

template <class Kind>
void make_layer(PaintLayers& layers, Layer<Kind>& layer, const typename Kind::Value& value,
                const char* const* names) {
  for (int k = 0; k < Kind::K; ++k)
    layer.grid[k] = make_grid<typename Kind::Grid>(layers, Kind::store(value)[k], names[k]);
  forget_base(layers, layer);
  mark_box(layers, layer);
}

}  // namespace

void make_sigma(PaintLayers& layers, double value) {
  make_layer(layers, layers.sigma, value, kPaintedGrids);
}
void make_anisotropy(PaintLayers& layers, const SymMat3& value) {
  make_layer(layers, layers.anisotropy, value, kPaintedGrids + 1);
}
void make_albedo(PaintLayers& layers) {
  make_layer(layers, layers.albedo, Vec3{1, 1, 1}, kPaintedGrids + 3);
}

double length_scale_of(const SymMat3& a) {
  return std::pow(Cholesky3(a).determinant(), 1.0 / 6);
}

std::vector<openvdb::Coord> leaves_of_box(const openvdb::CoordBBox& box) {
  std::vector<openvdb::Coord> out;
  visit_leaves(box, [&](const openvdb::Coord& c) { out.push_back(c); });
  return out;
}

std::vector<openvdb::Coord> leaves_of_balls(const PaintLayers& layers, const Vec3* centers,
                                            int count, double radius) {
  const Mat3& to_index = layers.to_index.linear;
  const Mat3 axes = transpose(layers.to_object.linear);
  // From the middle of a leaf to its furthest corner.
  const double reach =
      radius +
      (kLeafSide - 1) / 2.0 * (length(axes.row[0]) + length(axes.row[1]) + length(axes.row[2]));
  std::vector<openvdb::Coord> out;
  for (int image = 0; image < count; ++image) {
    const Vec3 middle = layers.to_index.point(centers[image]);
    openvdb::CoordBBox ball = layers.box;
    for (int i = 0; i < 3; ++i) {
      const double half = radius * length(to_index.row[i]);
      const double low = layers.box.min()[i], high = layers.box.max()[i];
      // Clamped before it is an integer; a ball beside the box has no nodes.
      if (middle[i] + half < low || middle[i] - half > high) {
        ball = {};
        break;
      }
      ball.min()[i] = static_cast<int>(std::clamp(std::ceil(middle[i] - half), low, high));
      ball.max()[i] = static_cast<int>(std::clamp(std::floor(middle[i] + half), low, high));
    }
    visit_leaves(ball, [&](const openvdb::Coord& c) {
      const Vec3 d =
          layers.to_object.point({c.x() + 3.5, c.y() + 3.5, c.z() + 3.5}) - centers[image];
      if (dot(d, d) <= reach * reach) out.push_back(c);
    });
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

}  // namespace gpis
