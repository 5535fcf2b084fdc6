#include "field/painted_fields.h"

#include <utility>

#include "field/check.h"
#include "field/painted_fields_impl.h"

namespace gpis {
namespace {

// More nodes than this are not meant: a brush far off, a voxel too small.
constexpr double kMostNodes = 1 << 28;

void check_nodes(const openvdb::CoordBBox& box) {
  const openvdb::Coord n = box.dim();
  const double count = double(n.x()) * n.y() * n.z();
  if (count > kMostNodes)
    refuse("The grid would have ", n.x(), " x ", n.y(), " x ", n.z(), " nodes, at most ",
           kMostNodes, " are kept: paint nearer to it, or with larger voxels.");
}

Vec3 mirrored(Vec3 p, int axis) {
  p[axis] = -p[axis];
  return p;
}
Vec3 mirrored_value(const Vec3& v, int) {
  return v;  // a colour
}
double mirrored_value(double v, int) {
  return v;
}
SymMat3 mirrored_value(SymMat3 a, int axis) {
  if (axis != 2) a.xy = -a.xy;
  if (axis != 1) a.xz = -a.xz;
  if (axis != 0) a.yz = -a.yz;
  return a;
}

// What is taken of another value: of a tensor the size or the shape alone.
template <class Value>
Value taken(Channel, const Value&, const Value& other) {
  return other;
}
SymMat3 taken(Channel channel, const SymMat3& own, const SymMat3& other) {
  const double ratio = length_scale_of(other) / length_scale_of(own);
  return channel == Channel::length_scale ? own * (ratio * ratio) : other * (1 / (ratio * ratio));
}

template <class Kind>
std::vector<openvdb::Coord> leaves_of(const typename Kind::Grid& grid) {
  std::vector<openvdb::Coord> out;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) out.push_back(leaf->origin());
  return out;
}

template <class Kind>
const Layer<Kind>& layer_of(const PaintLayers& layers, Channel channel) {
  if constexpr (std::is_same_v<Kind, ScalarLayer>)
    return channel == Channel::mean ? layers.mean : layers.sigma;
  else if constexpr (std::is_same_v<Kind, ColorLayer>)
    return layers.albedo;
  else
    return layers.anisotropy;
}

}  // namespace

PaintedFields::PaintedFields(const PaintSource& source) : impl_(std::make_unique<Impl>()) {
  impl_->open(source);
}
PaintedFields::~PaintedFields() = default;

void PaintedFields::Impl::make(Channel channel) {
  if (channel == Channel::deviation && !layers.sigma) make_sigma(layers, layers.constant_sigma);
  if ((channel == Channel::length_scale || channel == Channel::anisotropy) && !layers.anisotropy)
    make_anisotropy(layers, constant_of<TensorLayer>(layers));
  if (channel == Channel::albedo && !layers.albedo) make_albedo(layers);
}

PaintCounts PaintedFields::apply(const Brush& brush, const std::vector<Dab>& dabs) {
  check_brush(brush);
  check_dabs(brush, dabs);
  impl_->make(brush.channel);
  const auto paint = brush.channel == Channel::mean        ? paint_mean
                     : brush.channel == Channel::deviation ? paint_deviation
                     : brush.channel == Channel::albedo    ? paint_albedo
                                                           : paint_tensor;
  PaintCounts counts;
  for (const Dab& dab : dabs)
    counts.add(paint(impl_->layers, brush, DabImages(dab, brush.symmetry)));
  return counts;
}

void PaintedFields::extend(const Box3& bounds) {
  check_finite("bounds", bounds.min);
  check_finite("bounds", bounds.max);
  if (bounds.empty()) refuse("bounds go from ", bounds.min, " to ", bounds.max, ", backwards.");
  PaintLayers& old = impl_->layers;
  openvdb::CoordBBox box = old.box;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p = old.to_index.point({(corner & 1 ? bounds.max : bounds.min).x,
                                       (corner & 2 ? bounds.max : bounds.min).y,
                                       (corner & 4 ? bounds.max : bounds.min).z});
    for (int i = 0; i < 3; ++i) {
      const double low = std::clamp(p[i], -1e8, 1e8);
      // Whole leaves, and only on the sides that grow.
      if (low < box.min()[i]) box.min()[i] = static_cast<int>(std::floor(low)) & ~7;
      if (low > box.max()[i]) box.max()[i] = static_cast<int>(std::ceil(low)) | 7;
    }
  }
  if (box == old.box) return;
  check_nodes(box);
  std::vector<openvdb::Coord> leaves;
  for (const openvdb::Coord& c : leaves_of_box(box))
    if (!old.box.isInside(openvdb::CoordBBox(c, c.offsetBy(7)))) leaves.push_back(c);
  PaintLayers larger = old;
  larger.box = box;
  larger.visit([&](const auto& layer, const auto&) {
    using Kind = typename std::decay_t<decltype(layer)>::Kind;
    rewrite<Kind>(
        larger, layer, leaves,
        [&] {
          return [&, read = LayerReader<Kind>(layer.grid, old.box)](
                     const openvdb::Coord& c, const Vec3& x, const typename Kind::Value&,
                     PaintCounts&) -> std::optional<typename Kind::Value> {
            if (old.box.isInside(c)) return std::nullopt;
            const openvdb::Coord nearest = clamped(c, old.box);
            const auto value = read.at(nearest);
            if constexpr (std::is_same_v<Kind, ScalarLayer>) {
              if (&layer == &larger.mean) {
                const double rise = dot(old.gradient_to_object * difference(read, old.box, nearest),
                                        x - old.point(nearest));
                // Outside stays outside.
                return value + (value > 0 ? std::max(rise, 0.0) : rise);
              }
            }
            return value;
          };
        },
        Rewrite::extend);
    mark_box(larger, layer);
  });
  old = larger;
}

PaintCounts PaintedFields::reset(Channel channel) {
  impl_->make(channel);
  const PaintLayers& layers = impl_->layers;
  return with_layer(layers, channel, [&](const auto& layer) {
    using Kind = typename std::decay_t<decltype(layer)>::Kind;
    PaintCounts counts = rewrite<Kind>(layers, layer, leaves_of<Kind>(*layer.base[0]), [&] {
      return [&, base = LayerReader<Kind>(layer.base, layers.box)](
                 const openvdb::Coord& c, const Vec3&, const typename Kind::Value& old,
                 PaintCounts&) { return std::optional(taken(channel, old, base.at(c))); };
    });
    if (channel == Channel::mean) return counts;  // extended by its own rule
    // What the grid was extended from has changed.
    std::vector<openvdb::Coord> extended;
    for (const openvdb::Coord& c : leaves_of_box(layers.box))
      if (!layers.base_box.isInside(openvdb::CoordBBox(c, c.offsetBy(7)))) extended.push_back(c);
    const auto again = [&] {
      return [&, now = LayerReader<Kind>(layer.grid, layers.base_box)](
                 const openvdb::Coord& c, const Vec3&, const typename Kind::Value& old,
                 PaintCounts&) { return std::optional(taken(channel, old, now.at(c))); };
    };
    counts.add(rewrite<Kind>(layers, layer, extended, again, Rewrite::extend));
    return counts;
  });
}

PaintCounts PaintedFields::mirror(Channel channel, int axis, bool from_positive) {
  if (axis < 0 || axis > 2) refuse("axis is ", axis, "; it takes 0, 1 or 2.");
  impl_->make(channel);
  Box3 box = bounds();
  const Vec3 low = mirrored(box.min, axis), high = mirrored(box.max, axis);
  box.include(low);
  box.include(high);
  extend(box);
  const PaintLayers& layers = impl_->layers;
  return with_layer(layers, channel, [&](const auto& layer) {
    using Kind = typename std::decay_t<decltype(layer)>::Kind;
    return rewrite<Kind>(layers, layer, leaves_of_box(layers.box), [&] {
      return [&, read = LayerReader<Kind>(layer.grid, layers.box)](
                 const openvdb::Coord&, const Vec3& x, const typename Kind::Value& old,
                 PaintCounts&) -> std::optional<typename Kind::Value> {
        if (from_positive ? !(x[axis] < 0) : !(x[axis] > 0)) return std::nullopt;
        const auto image = read.sample(layers.to_index.point(mirrored(x, axis)));
        return taken(channel, old, mirrored_value(image, axis));
      };
    });
  });
}

PaintCounts PaintedFields::copy(const PaintedFields& other, Channel channel) {
  impl_->make(channel);
  PaintLayers& layers = impl_->layers;
  const PaintLayers& from = other.impl_->layers;
  return with_layer(layers, channel, [&](auto& layer) {
    using Kind = typename std::decay_t<decltype(layer)>::Kind;
    const Layer<Kind>& source = layer_of<Kind>(from, channel);
    const PaintCounts counts = rewrite<Kind>(layers, layer, leaves_of_box(layers.box), [&] {
      std::optional<LayerReader<Kind>> read;
      if (source) read.emplace(source.grid, from.box);
      return [&, read](const openvdb::Coord&, const Vec3& x, const typename Kind::Value& old,
                       PaintCounts&) -> std::optional<typename Kind::Value> {
        const auto value = read ? read->sample(from.to_index.point(x)) : constant_of<Kind>(from);
        return taken(channel, old, value);
      };
    });
    forget_base(layers, layer);
    return counts;
  });
}

void PaintedFields::restart() {
  PaintLayers& layers = impl_->layers;
  layers.box = layers.base_box;
  layers.visit([&](const auto& layer, const auto&) {
    using L = std::decay_t<decltype(layer)>;
    for (int k = 0; k < L::Kind::K; ++k) {
      auto& tree = layer.grid[k]->tree();
      for (auto leaf = layer.base[k]->tree().cbeginLeaf(); leaf; ++leaf)
        tree.addLeaf(new typename L::Leaf(*leaf));
      layer.base[k]->tree().clear();
      tree.clip(layers.box);
      tree.prune();
    }
    mark_box(layers, layer);
  });
}

void PaintedFields::resample(double voxel_size) {
  check_positive("voxel_size", voxel_size);
  const PaintLayers old = impl_->layers;
  const Vec3 edges = this->voxel_size();
  for (int i = 0; i < 3; ++i)
    if (std::abs(std::abs(old.to_object.linear.row[i][i]) - edges[i]) > 1e-6 * edges[i])
      refuse("The grid is rotated or sheared in its file; only one along the axes is resampled.");
  const Box3 bounds = this->bounds();
  openvdb::Coord last;
  for (int i = 0; i < 3; ++i) {
    // A box that is a whole number of voxels but for rounding is not one more.
    const double cells = std::ceil((bounds.max[i] - bounds.min[i]) / voxel_size - 1e-6);
    if (!(cells >= 1 && cells < 1e5))
      refuse("voxel_size is ", voxel_size, "; the grid goes from ", bounds.min, " to ", bounds.max,
             ".");
    last[i] = static_cast<int>(cells);
  }
  PaintLayers next = old;
  next.transform = openvdb::math::Transform::createLinearTransform(voxel_size);
  next.transform->postTranslate(openvdb::Vec3d(bounds.min.x, bounds.min.y, bounds.min.z));
  next.to_object = {Mat3{} * voxel_size, bounds.min};
  next.to_index = inverse(next.to_object);
  next.gradient_to_object = transpose(next.to_index.linear);
  next.box = next.base_box = {openvdb::Coord(0, 0, 0), last};
  check_nodes(next.box);

  const auto leaves = leaves_of_box(next.box);
  const auto transfer = [&](const auto& from, auto& to) {
    using Kind = typename std::decay_t<decltype(from)>::Kind;
    if (!from) return;
    for (int k = 0; k < Kind::K; ++k)
      to.grid[k] =
          make_grid<typename Kind::Grid>(next, from.grid[k]->background(), from.grid[k]->getName());
    forget_base(next, to);
    rewrite<Kind>(next, to, leaves, [&] {
      return [&, read = LayerReader<Kind>(from.grid, old.box)](
                 const openvdb::Coord&, const Vec3& x, const typename Kind::Value&, PaintCounts&) {
        return std::optional<typename Kind::Value>(read.sample(old.to_index.point(x)));
      };
    });
    forget_base(next, to);
    mark_box(next, to);
  };
  transfer(old.mean, next.mean);
  transfer(old.sigma, next.sigma);
  transfer(old.anisotropy, next.anisotropy);
  transfer(old.albedo, next.albedo);
  impl_->layers = next;
}

}  // namespace gpis
