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
#include "field/leaf_nodes.h"

namespace gpis {
namespace {

// By minors where they cancel few digits, as those of most brushes do; |a| is at most the product
// of the diagonal (Hadamard), which their rounding is relative to.
struct Minors {
  double determinant, product;

  explicit Minors(const SymMat3& a)
      : determinant(a.xx * (a.yy * a.zz - a.yz * a.yz) - a.xy * (a.xy * a.zz - a.yz * a.xz) +
                    a.xz * (a.xy * a.yz - a.yy * a.xz)),
        product(a.xx * a.yy * a.zz) {}
  bool are_precise() const { return determinant > 1e-3 * product; }
};

double determinant(const SymMat3& a) {
  const Minors minors(a);
  return minors.are_precise() ? minors.determinant : Cholesky3(a).determinant();
}

bool is_positive(const SymMat3& a) {
  const Minors minors(a);
  const double corner = a.xx * a.yy - a.xy * a.xy;
  const bool surely = a.xx > 0 && corner > 1e-3 * a.xx * a.yy && minors.are_precise();
  return surely || Cholesky3(a).positive;
}

// v vᵀ
SymMat3 square(const Vec3& v) {
  return {v.x * v.x, v.y * v.y, v.z * v.z, v.x * v.y, v.x * v.z, v.y * v.z};
}

double log_length(const SymMat3& a) {
  return std::log(determinant(a)) / 6;
}

class TensorDab {
 public:
  TensorDab(const PaintLayers& layers, const Brush& brush, const DabImages& dab)
      : layers_(layers),
        brush_(brush),
        dab_(dab),
        tensor_(layers.anisotropy.grid, layers.box),
        mean_(layers.mean.grid, layers.box) {
    for (int i = 0; i < dab.count; ++i) tangents_[i] = normalize(dab.directions[i]);
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
    // Functions that say whether there is a new value: an optional of 48 bytes takes longer to hand
    // on.
    SymMat3 out;
    if (brush_.channel == Channel::length_scale) {
      if (!resized(c, old, a, counts, out)) return std::nullopt;
    } else if (brush_.operation == Operation::smooth) {
      tensor_.enter(c);
      out = old * (1 - a) + around(tensor_, c) * a;
    } else if (!combed(c, old, a, near, counts, out)) {
      return std::nullopt;
    }
    if (!is_positive(TensorLayer::load(TensorLayer::store(out)))) {
      ++counts.rejected;
      return std::nullopt;
    }
    return out;
  }

 private:
  bool resized(const openvdb::Coord& c, const SymMat3& old, double a, PaintCounts& counts,
               SymMat3& out) {
    const bool smooth = brush_.operation == Operation::smooth;
    double log_old, change;
    if (smooth) {
      tensor_.enter(c);
      log_old = log_lengths_.at(tensor_, c, log_length);
      change = log_lengths_.mean_around(tensor_, c, log_length) - log_old;
    } else {
      log_old = log_length(old);
      change = std::log(brush_.value.x);
      if (brush_.operation == Operation::set) change -= log_old;
    }
    if (change == 0) return false;
    const double log_new = log_old + a * change;
    const double kept = std::clamp(log_new, std::log(kLeastLength), std::log(kMostLength));
    counts.clamped += kept != log_new;
    out = old * std::exp(2 * (kept - log_old));
    return true;
  }

  // e₁e₁ᵀ and e₃e₃ᵀ need no square root, and e₂e₂ᵀ = I − e₁e₁ᵀ − e₃e₃ᵀ.
  bool combed(const openvdb::Coord& c, const SymMat3& old, double a, const DabImages::Nearest& near,
              PaintCounts& counts, SymMat3& out) {
    mean_.enter(c);
    const Vec3 slope = layers_.gradient_to_object * difference(mean_, layers_.box, c);
    const double steepness = dot(slope, slope);
    if (!(steepness > 0)) {
      ++counts.undirected;
      return false;
    }
    SymMat3 along;
    for (int i = 0; i < near.count; ++i) {
      const Vec3& tangent = tangents_[near.image[i]];
      const Vec3 across = tangent - slope * (dot(tangent, slope) / steepness);
      const double sine = dot(across, across);
      if (!(sine > 1e-12)) {
        ++counts.undirected;
        return false;
      }
      along = along + square(across) * (1 / sine);
    }
    const SymMat3 goal = SymMat3::identity(squares_[1]) +
                         along * ((squares_[0] - squares_[1]) / near.count) +
                         square(slope) * ((squares_[2] - squares_[1]) / steepness);
    // In logarithms, which take less time than cube roots.
    const double log_size = std::log(determinant(old)) / 3;
    const SymMat3 mixed = old * (1 - a) + goal * (a * std::exp(log_size));
    out = mixed * std::exp(log_size - std::log(determinant(mixed)) / 3);
    return true;
  }

  const PaintLayers& layers_;
  const Brush& brush_;
  const DabImages& dab_;
  LeafNodes<TensorLayer> tensor_;
  LeafNodes<ScalarLayer> mean_;
  LeafNumbers log_lengths_;
  std::array<Vec3, DabImages::kMost> tangents_;
  Vec3 squares_;
};

}  // namespace

PaintCounts paint_tensor(const PaintLayers& layers, const Brush& brush, const DabImages& dab) {
  const auto leaves = leaves_of_balls(layers, dab.centers.data(), dab.count, dab.radius);
  return rewrite<TensorLayer>(layers, layers.anisotropy, leaves,
                              [&] { return TensorDab(layers, brush, dab); });
}

}  // namespace gpis
