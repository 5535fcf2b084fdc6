// What painted fields hold, read back.
#include "field/check.h"
#include "field/painted_fields_impl.h"

namespace gpis {

Box3 PaintedFields::bounds() const {
  const PaintLayers& layers = impl_->layers;
  Box3 bounds;
  for (int corner = 0; corner < 8; ++corner)
    bounds.include(layers.point({(corner & 1 ? layers.box.max() : layers.box.min()).x(),
                                 (corner & 2 ? layers.box.max() : layers.box.min()).y(),
                                 (corner & 4 ? layers.box.max() : layers.box.min()).z()}));
  return bounds;
}

Vec3 PaintedFields::voxel_size() const {
  const Mat3 axes = transpose(impl_->layers.to_object.linear);
  return {length(axes.row[0]), length(axes.row[1]), length(axes.row[2])};
}

std::int64_t PaintedFields::memory() const {
  std::int64_t bytes = 0;
  impl_->layers.visit([&](const auto& layer, const auto&) {
    for (std::size_t k = 0; k < layer.grid.size(); ++k)
      bytes += layer.grid[k]->memUsage() + layer.base[k]->memUsage();
  });
  return bytes;
}

std::vector<std::string> PaintedFields::painted() const {
  std::vector<std::string> names;
  impl_->layers.visit([&](const auto& layer, const auto& own) {
    if (static_cast<const void*>(&layer) != &impl_->layers.mean)
      names.insert(names.end(), own.begin(), own.end());
  });
  return names;
}

std::vector<double> PaintedFields::values(Channel channel, const std::vector<Vec3>& points) const {
  const PaintLayers& layers = impl_->layers;
  std::vector<double> out;
  with_layer(layers, channel, [&](const auto& layer) {
    using Kind = typename std::decay_t<decltype(layer)>::Kind;
    std::optional<LayerReader<Kind>> read;
    if (layer) read.emplace(layer.grid, layers.box);
    for (const Vec3& p : points) {
      const auto v = read ? read->sample(layers.to_index.point(p)) : constant_of<Kind>(layers);
      if constexpr (std::is_same_v<Kind, ScalarLayer>)
        out.push_back(v);
      else if constexpr (std::is_same_v<Kind, ColorLayer>)
        out.insert(out.end(), {v.x, v.y, v.z});
      else if (channel == Channel::length_scale)
        out.push_back(length_scale_of(v));
      else
        out.insert(out.end(), {v.xx, v.yy, v.zz, v.xy, v.xz, v.yz});
    }
  });
  return out;
}

std::pair<double, Vec3> PaintedFields::first_surface(const Vec3& origin, const Vec3& direction,
                                                     double t_max) const {
  check_finite("origin", origin);
  check_direction("direction", direction);
  const PaintLayers& layers = impl_->layers;
  const auto mean = layers.mean_reader();
  const Vec3 o = layers.to_index.point(origin), d = layers.to_index.vector(direction);
  Box3 box;
  for (const openvdb::Coord& c : {layers.box.min(), layers.box.max()})
    box.include({double(c.x()), double(c.y()), double(c.z())});
  const auto [enter, leave] = clip(box, o, d, 0, t_max);
  const double step = 0.5 / length(d);
  double before = enter;
  bool outside = false;
  for (double t = enter; t <= leave; t += step) {
    const bool above = mean.sample(o + d * t) > 0;
    if (above || !outside) {
      outside = above;
      before = t;
      continue;
    }
    double low = before, high = t;
    for (int i = 0; i < 40; ++i) {
      const double middle = (low + high) / 2;
      (mean.sample(o + d * middle) > 0 ? low : high) = middle;
    }
    const Vec3 x = o + d * high;
    Vec3 slope;
    for (int i = 0; i < 3; ++i) {
      Vec3 half;
      half[i] = 0.5;
      slope[i] = mean.sample(x + half) - mean.sample(x - half);
    }
    return {high, layers.gradient_to_object * slope};
  }
  return {kInfinity, Vec3{}};
}

}  // namespace gpis
