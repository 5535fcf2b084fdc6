// Dabs on the squared length scales A; a the weight (brush.h), v the value, ℓ = |A|^(1/6) the
// length scale of a node.
//   length scale   set:     ln ℓ ← ln ℓ + a (ln v − ln ℓ)                 A scales with ℓ²
//                  add:     ln ℓ ← ln ℓ + a ln v
//                  smooth:  ln ℓ ← ln ℓ + a (mean of ln ℓ over the six neighbours − ln ℓ)
//   anisotropy     comb:    A ← s ((1 − a) A + a B),   s such that |A|, and so ℓ, stays
//                  smooth:  A ← (1 − a) A + a (mean of A over the six neighbours)
// B = ℓ² Σ_i q_i² e_i e_iᵀ / (q₁ q₂ q₃)^(2/3) with the ratios q, e₃ = ∇μ/|∇μ| by central
// differences, e₁ the direction without its part along e₃, normalised, and e₂ = e₃ × e₁. Convex
// combinations keep A positive definite, and its condition within that of what is combined
// (math.md §2). A node where ∇μ = 0, or e₃ is the direction to 1e-6, is left as it is.
#include "field/paint_layers.h"

namespace gpis {
namespace {

double log_length(const SymMat3& a) {
  return std::log(Cholesky3(a).determinant()) / 6;
}

// ln ℓ of the nodes of one leaf and those beside it, each computed once.
class LogLengths {
 public:
  double at(const openvdb::Coord& leaf, const openvdb::Coord& c,
            const LayerReader<TensorLayer>& tensor) {
    if (!(leaf == leaf_)) {
      leaf_ = leaf;
      known_.fill(std::nan(""));
    }
    const openvdb::Coord i = c - leaf;
    double& value = known_[((i.x() + 1) * kSide + i.y() + 1) * kSide + i.z() + 1];
    if (std::isnan(value)) value = log_length(tensor.at(c));
    return value;
  }

 private:
  static constexpr int kSide = 10;
  openvdb::Coord leaf_ = openvdb::Coord::max();
  std::array<double, kSide * kSide * kSide> known_;
};

class TensorDab {
 public:
  TensorDab(const PaintLayers& layers, const Brush& brush, const DabImages& dab)
      : layers_(layers),
        brush_(brush),
        dab_(dab),
        tensor_(layers.anisotropy.grid, layers.box),
        mean_(layers.mean_reader()) {
    const Vec3 q = brush.ratios;
    const double scale = std::pow(q.x * q.y * q.z, -2.0 / 3);
    for (int i = 0; i < 3; ++i) squares_[i] = q[i] * q[i] * scale;
  }

  std::optional<SymMat3> operator()(const openvdb::Coord& c, const Vec3& x, const SymMat3& old,
                                    PaintCounts& counts) {
    const DabImages::Nearest near = dab_.nearest(x);
    if (near.count == 0) return std::nullopt;
    const double a = dab_.strength * brush_.falloff(near.distance / dab_.radius);
    if (a == 0) return std::nullopt;
    std::optional<SymMat3> out;
    if (brush_.channel == Channel::length_scale)
      out = resized(c, old, a, counts);
    else if (brush_.operation == Operation::smooth)
      out = old * (1 - a) + tensor_.around(c) * a;
    else
      out = combed(c, old, a, near, counts);
    if (out && !Cholesky3(TensorLayer::load(TensorLayer::store(*out))).positive) {
      ++counts.rejected;
      return std::nullopt;
    }
    return out;
  }

 private:
  std::optional<SymMat3> resized(const openvdb::Coord& c, const SymMat3& old, double a,
                                 PaintCounts& counts) {
    const bool smooth = brush_.operation == Operation::smooth;
    const openvdb::Coord leaf = c & ~7;
    const double log_old = smooth ? log_lengths_.at(leaf, c, tensor_) : log_length(old);
    double change = 0;
    if (smooth) {
      double sum = 0;
      for (int axis = 0; axis < 3; ++axis)
        for (int side : {-1, 1}) {
          openvdb::Coord next = c;
          next[axis] += side;
          sum += log_lengths_.at(leaf, next, tensor_);
        }
      change = sum / 6 - log_old;
    } else {
      change = std::log(brush_.value.x);
      if (brush_.operation == Operation::set) change -= log_old;
    }
    if (change == 0) return std::nullopt;
    const double log_new = log_old + a * change;
    const double kept = std::clamp(log_new, std::log(kLeastLength), std::log(kMostLength));
    counts.clamped += kept != log_new;
    return old * std::exp(2 * (kept - log_old));
  }

  std::optional<SymMat3> combed(const openvdb::Coord& c, const SymMat3& old, double a,
                                const DabImages::Nearest& near, PaintCounts& counts) const {
    const Vec3 slope = layers_.gradient_to_object * mean_.difference(c);
    const double steepness = length(slope);
    if (!(steepness > 0)) {
      ++counts.undirected;
      return std::nullopt;
    }
    const Vec3 e3 = slope / steepness;
    SymMat3 goal;
    for (int i = 0; i < near.count; ++i) {
      const Vec3 tangent = normalize(dab_.directions[near.image[i]]);
      const Vec3 across = tangent - e3 * dot(tangent, e3);
      if (!(length(across) > 1e-6)) {
        ++counts.undirected;
        return std::nullopt;
      }
      const Vec3 e1 = normalize(across), e2 = cross(e3, e1);
      goal = goal + SymMat3::of(outer(e1, e1) * squares_[0] + outer(e2, e2) * squares_[1] +
                                outer(e3, e3) * squares_[2]);
    }
    const double determinant = Cholesky3(old).determinant(), size = std::cbrt(determinant);
    const SymMat3 mixed = old * (1 - a) + goal * (a * size / near.count);
    return mixed * std::cbrt(determinant / Cholesky3(mixed).determinant());
  }

  const PaintLayers& layers_;
  const Brush& brush_;
  const DabImages& dab_;
  LayerReader<TensorLayer> tensor_;
  LayerReader<ScalarLayer> mean_;
  LogLengths log_lengths_;
  Vec3 squares_;
};

}  // namespace

PaintCounts paint_tensor(const PaintLayers& layers, const Brush& brush, const DabImages& dab) {
  const auto leaves = leaves_of_balls(layers, dab.centers.data(), dab.count, dab.radius);
  return rewrite<TensorLayer>(layers, layers.anisotropy, leaves,
                              [&] { return TensorDab(layers, brush, dab); });
}

}  // namespace gpis
