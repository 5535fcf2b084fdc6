#include "field/tensor_grid_field.h"

#include "core/box_image.h"
#include "core/symmetric_eigen.h"
#include "field/check.h"

namespace gpis {
namespace {

constexpr double kSharp = 0.5;  // of kinks

bool same(const SymMat3& a, const SymMat3& b) {
  for (int i = 0; i < 6; ++i)
    if (a[i] != b[i]) return false;
  return true;
}

bool positive_definite(const SymMat3& a) {
  return a.xx > 0 && Cholesky3(a).positive;
}

}  // namespace

TensorGridField::TensorGridField(Bricks bricks, const Affine& index_to_object,
                                 const std::function<std::string(const Index3&)>& node_name)
    : bricks_(std::move(bricks)), object_to_index_(inverse(index_to_object)) {
  const Index3& n = bricks_[0]->nodes();
  Index3 shortest{};
  double least_yet = kInfinity;
  eigenvalues_ = eigenvalues_of_nodes(
      {0, 0, 0}, {n[0] - 1, n[1] - 1, n[2] - 1}, [&](const Index3& at, double least, double most) {
        if (!(least > 1e-12 * most))
          refuse("", node_name(at), " is a matrix with the eigenvalue ", least, " (the largest is ",
                 most,
                 "); the anisotropy takes squared length scales, all of whose eigenvalues are "
                 "positive.");
        if (least < least_yet) {
          least_yet = least;
          shortest = at;
        }
      });
  const auto place = [&](const Index3& at) {
    return index_to_object.point({double(at[0]), double(at[1]), double(at[2])});
  };
  if (const auto sharpest = find_kinks()) {
    extremes_.push_back(place(shortest));
    if (*sharpest != shortest) extremes_.push_back(place(*sharpest));
  }
}

std::optional<SymMat3> TensorGridField::constant() const {
  SymMat3 a;
  for (int e = 0; e < 6; ++e) {
    const Range entry = bricks_[e]->range();
    if (entry.min != entry.max) return std::nullopt;
    a[e] = entry.min;
  }
  return a;
}

SymMat3 TensorGridField::node(const Index3& at) const {
  const Index3& n = bricks_[0]->nodes();
  Index3 cell;
  int corner = 0;
  for (int i = 0; i < 3; ++i) {
    cell[i] = std::min(at[i], n[i] - 2);
    corner = 2 * corner + (at[i] - cell[i]);
  }
  SymMat3 a;
  for (int e = 0; e < 6; ++e) {
    const BrickGrid::Brick& brick = bricks_[e]->brick_of(cell);
    a[e] = brick.min;
    if (brick.values < 0) continue;
    float c[8];
    bricks_[e]->corners(brick, cell, c);
    a[e] = c[corner];
  }
  return a;
}

// Eigenvalues are computed only where they leave the range found so far, which two factorisations
// tell; where nothing changes from node to node, not even these.
template <class Check>
Range TensorGridField::eigenvalues_of_nodes(const Index3& first, const Index3& last,
                                            const Check& check) const {
  Range range{kInfinity, -kInfinity};
  SymMat3 before;
  for (int i = first[0]; i <= last[0]; ++i)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int k = first[2]; k <= last[2]; ++k) {
        const SymMat3 a = node({i, j, k});
        if (same(a, before)) continue;
        before = a;
        if (range.max > 0 && positive_definite(a - SymMat3::identity(range.min)) &&
            positive_definite(SymMat3::identity(range.max) - a))
          continue;
        const auto e = eigenvalues_of(a);
        check({i, j, k}, e[0], e[2]);
        range.min = std::min(range.min, e[0]);
        range.max = std::max(range.max, e[2]);
      }
  return range;
}

// Between nodes A is a convex combination of theirs, outside it is the nearest value.
Range TensorGridField::eigenvalues(const Box3& box) const {
  const Box3 index = image_of(box, object_to_index_);
  const Index3& n = bricks_[0]->nodes();
  Index3 first, last;
  bool all = true;
  for (int a = 0; a < 3; ++a) {
    const double end = n[a] - 1;
    // An infinite or empty box: all of the nodes.
    const bool known = index.min[a] <= index.max[a];
    first[a] = known ? static_cast<int>(std::clamp(std::floor(index.min[a]), 0.0, end)) : 0;
    last[a] = known ? static_cast<int>(std::clamp(std::ceil(index.max[a]), 0.0, end)) : n[a] - 1;
    all &= first[a] == 0 && last[a] == n[a] - 1;
  }
  if (all) return eigenvalues_;
  return eigenvalues_of_nodes(first, last, [](const Index3&, double, double) {});
}

// At a face across axis i, ∂_i A jumps by the second difference D of the nodes there; c is at most
// the root of tr((A⁻¹D)²).
double TensorGridField::kink_at(int axis, const Index3& at) const {
  Index3 before = at, after = at;
  before[axis] = std::max(at[axis] - 1, 0);
  after[axis] = std::min(at[axis] + 1, bricks_[0]->nodes()[axis] - 1);
  const SymMat3 a = node(at), lower = node(before), upper = node(after);
  if (same(a, lower) && same(a, upper)) return 0;
  const SymMat3 inverse_a = Cholesky3(a).inverse();
  const Mat3 m = inverse_a.matrix() * (lower + upper - a * 2).matrix(), mt = transpose(m);
  return std::sqrt(std::max(
      0.0, dot(m.row[0], mt.row[0]) + dot(m.row[1], mt.row[1]) + dot(m.row[2], mt.row[2])));
}

std::optional<Index3> TensorGridField::find_kinks() {
  Index3 sharpest{};
  double most = 0;
  for (int axis = 0; axis < 3; ++axis)
    kinks_[axis] = std::make_shared<BrickGrid>(bricks_[0]->nodes(), [&, axis](int i, int j, int k) {
      const double kink = kink_at(axis, {i, j, k});
      if (kink > most) {
        most = kink;
        sharpest = {i, j, k};
      }
      return static_cast<float>(kink);
    });
  return most > 0 ? std::optional(sharpest) : std::nullopt;
}

SymMat3 TensorGridField::value(const Vec3& p) const {
  return sample(p).value;
}

TensorGridField::Place TensorGridField::place(const Vec3& x) const {
  const Index3& n = bricks_[0]->nodes();
  Place p;
  for (int i = 0; i < 3; ++i) {
    p.outside[i] = !(x[i] >= 0 && x[i] <= n[i] - 1);
    p.cell[i] = x[i] >= 1 ? (x[i] < n[i] - 1 ? static_cast<int>(x[i]) : n[i] - 2) : 0;
    p.local[i] = p.outside[i] ? (x[i] > 0 ? 1.0 : 0.0) : x[i] - p.cell[i];
  }
  return p;
}

TensorSample TensorGridField::sample(const Vec3& p) const {
  const auto [cell, u, outside] = place(object_to_index_.point(p));
  TensorSample out;
  SymMat3 along[3];  // derivatives by index
  for (int e = 0; e < 6; ++e) {
    const BrickGrid::Brick& brick = bricks_[e]->brick_of(cell);
    out.value[e] = brick.min;
    if (brick.values < 0) continue;
    float c[8];
    bricks_[e]->corners(brick, cell, c);
    // Linear along x, then y, then z.
    double v[4], dx[4];
    for (int i = 0; i < 4; ++i) {
      dx[i] = double{c[4 + i]} - c[i];
      v[i] = c[i] + u.x * dx[i];
    }
    const double v0 = v[0] + u.y * (v[2] - v[0]), v1 = v[1] + u.y * (v[3] - v[1]);
    out.value[e] = v0 + u.z * (v1 - v0);
    const double d0 = dx[0] + u.y * (dx[2] - dx[0]), d1 = dx[1] + u.y * (dx[3] - dx[1]);
    along[0][e] = d0 + u.z * (d1 - d0);
    along[1][e] = (v[2] - v[0]) + u.z * ((v[3] - v[1]) - (v[2] - v[0]));
    along[2][e] = v1 - v0;
  }
  for (int i = 0; i < 3; ++i)  // ∂A/∂x_i = Σ_j ∂index_j/∂x_i ∂A/∂index_j
    for (int j = 0; j < 3; ++j)
      if (!outside[j])
        out.gradient[i] = out.gradient[i] + along[j] * object_to_index_.linear.row[j][i];
  return out;
}

TensorSlope TensorGridField::along(const Vec3& o, const Vec3& d, double t, double side) const {
  const Vec3 origin = object_to_index_.point(o);
  Vec3 direction = object_to_index_.vector(d);
  Place at = place(origin + direction * side);
  for (int i = 0; i < 3; ++i) {
    if (at.outside[i])
      direction[i] = 0;
    else
      at.local[i] = origin[i] + direction[i] * t - at.cell[i];
  }
  const Vec3& u = at.local;
  const std::size_t index = bricks_[0]->brick_index(at.cell);
  TensorSlope out;
  for (int e = 0; e < 6; ++e) {
    const BrickGrid::Brick& brick = bricks_[e]->brick(index);
    out.value[e] = brick.min;
    if (brick.values < 0) continue;
    float c[8];
    bricks_[e]->corners(brick, at.cell, c);
    double v[4], slope[4];  // linear along z, then y, then x, each with its slope
    for (int i = 0; i < 4; ++i) {
      const double dz = double{c[2 * i + 1]} - c[2 * i];
      v[i] = c[2 * i] + u.z * dz;
      slope[i] = direction.z * dz;
    }
    for (int i = 0; i < 2; ++i) {
      const double dy = v[2 * i + 1] - v[2 * i];
      slope[i] = slope[2 * i] + u.y * (slope[2 * i + 1] - slope[2 * i]) + direction.y * dy;
      v[i] = v[2 * i] + u.y * dy;
    }
    const double dx = v[1] - v[0];
    out.value[e] = v[0] + u.x * dx;
    out.slope[e] = slope[0] + u.x * (slope[1] - slope[0]) + direction.x * dx;
  }
  return out;
}

// √(⅛ tr((A⁻¹D)²)) where the line crosses a face of cells.
double TensorGridField::kink_across(int axis, const Place& at, int face) const {
  const Index3& n = bricks_[0]->nodes();
  const int j = axis == 0 ? 1 : 0, k = axis == 2 ? 1 : 2;
  const auto layer = [&](int index) {
    Index3 corner = at.cell;
    corner[axis] = std::clamp(index, 0, n[axis] - 1);
    SymMat3 sum = {};
    for (int c = 0; c < 4; ++c) {
      Index3 node_at = corner;
      node_at[j] += c / 2;
      node_at[k] += c % 2;
      sum = sum + node(node_at) * ((c / 2 ? at.local[j] : 1 - at.local[j]) *
                                   (c % 2 ? at.local[k] : 1 - at.local[k]));
    }
    return sum;
  };
  const SymMat3 a = layer(face);
  const Mat3 m = Cholesky3(a).inverse().matrix() *
                 (layer(face - 1) + layer(face + 1) - a * 2).matrix(),
             mt = transpose(m);
  return std::sqrt(std::max(0.0, 0.125 * (dot(m.row[0], mt.row[0]) + dot(m.row[1], mt.row[1]) +
                                          dot(m.row[2], mt.row[2]))));
}

// ⅛ tr((A⁻¹J)²) <= (3/8) c² for J between -cA and cA. Where that says much, as around one short
// length among long ones, it is looked at.
double TensorGridField::kinks(const Vec3& o, const Vec3& d, double t_begin, double t_end) const {
  const Vec3 origin = object_to_index_.point(o), direction = object_to_index_.vector(d);
  const Index3& n = bricks_[0]->nodes();
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    if (direction[i] == 0) continue;
    const double a = origin[i] + direction[i] * t_begin, b = origin[i] + direction[i] * t_end;
    const double low = std::max(std::min(a, b), -0.5), high = std::min(std::max(a, b), n[i] - 0.5);
    double jumps = 0;
    for (int face = static_cast<int>(std::ceil(low)); face < high; ++face) {
      Place at = place(origin + direction * ((face - origin[i]) / direction[i]));
      at.cell[i] = std::min(face, n[i] - 2);
      const BrickGrid::Brick& brick = kinks_[i]->brick_of(at.cell);
      double kink = brick.max;
      if (brick.values >= 0) {
        float c[8];
        kinks_[i]->corners(brick, at.cell, c);
        const int stride = 4 >> i, layer = face > at.cell[i] ? stride : 0;
        const int other = i == 0 ? 2 : 4, third = i == 2 ? 2 : 1;
        kink = std::max({c[layer], c[layer + other], c[layer + third], c[layer + other + third]});
      }
      kink *= std::sqrt(3.0 / 8);
      jumps += kink > kSharp ? kink_across(i, at, face) : kink;
    }
    sum += std::abs(direction[i]) * jumps;
  }
  return sum;
}

}  // namespace gpis
