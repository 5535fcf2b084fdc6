// A regular grid of values, trilinear between nodes: value [i,j,k] stands at origin +
// (i,j,k)·voxel_size. Outside the nodes' box it is `background` if there is one (the field jumps
// there: a process clips its rays to support()), else the nearest value.
//
// On a ray every cell is one cubic in t, so a line walks from cell face to cell face, and from
// brick to brick where a brick holds one value. Everything of a line happens in index space, where
// nodes are integers.
#pragma once

#include <Eigen/Core>

#include "field/brick_grid.h"

namespace gpis {

class GridField final : public Field {
 public:
  GridField(std::shared_ptr<const BrickGrid> grid, const Vec3& voxel_size, const Vec3& origin,
            std::optional<double> background);
  // The same nodes, their values times a number.
  std::shared_ptr<const GridField> scaled(double factor) const;
  // The same grid, its node at x now at stretch·x + shift; every stretch is positive.
  std::shared_ptr<const GridField> moved(const Vec3& stretch, const Vec3& shift) const;

  double value(const Vec3& p) const override;
  FieldSample sample(const Vec3& p) const override;
  Range range() const override { return range_; }
  // Inside the nodes' box.
  double lipschitz() const override { return lipschitz_; }
  double smooth_scale() const override { return kInfinity; }
  std::optional<Box3> support() const override;

  const BrickGrid& grid() const { return *grid_; }
  const Vec3& voxel_size() const { return voxel_size_; }
  const Vec3& origin() const { return origin_; }
  // The same grid, continued by its nearest value: what a rotated grid takes, whose box is not
  // aligned with support().
  std::shared_ptr<const GridField> without_background() const;

  class Line;
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override;

 private:
  // A trilinear cell: local coordinates 0..1, corners as in BrickGrid::corners.
  struct Cell {
    double corner[8];

    double value(const Vec3& u) const;
    Vec3 gradient(const Vec3& u) const;  // in index space
  };
  // Position in the grid of a point in index space: its cell and where in it.
  struct Place {
    Index3 cell;
    Vec3 local;
    bool outside[3];

    bool any_outside() const { return outside[0] || outside[1] || outside[2]; }
  };
  Vec3 to_index(const Vec3& p) const {
    const Vec3 q = p - origin_;
    return {q.x / voxel_size_.x, q.y / voxel_size_.y, q.z / voxel_size_.z};
  }
  static int cell_of(double x, int nodes) {
    return x >= 1 ? (x < nodes - 1 ? static_cast<int>(x) : nodes - 2) : 0;
  }
  Place place(const Vec3& x) const;
  // Fills the cell's corners; false if its brick is constant (all corners equal).
  bool load(const Index3& cell, Cell& out) const;
  double least(const BrickGrid::Brick& brick) const {
    return factor_ > 0 ? factor_ * brick.min : factor_ * brick.max;
  }
  bool same_lattice(const GridField& other) const;

  std::shared_ptr<const BrickGrid> grid_;
  Vec3 voxel_size_, origin_;
  std::optional<double> background_;  // factor and all
  double factor_ = 1;                 // of the grid's values
  Range range_;
  double lipschitz_;
};

inline double GridField::Cell::value(const Vec3& u) const {
  const double* c = corner;
  const auto mix = [](double a, double b, double w) { return a + w * (b - a); };
  return mix(mix(mix(c[0], c[1], u.z), mix(c[2], c[3], u.z), u.y),
             mix(mix(c[4], c[5], u.z), mix(c[6], c[7], u.z), u.y), u.x);
}

inline Vec3 GridField::Cell::gradient(const Vec3& u) const {
  const double* c = corner;
  const auto bilinear = [](double d00, double d01, double d10, double d11, double v, double w) {
    const double a = d00 + w * (d01 - d00), b = d10 + w * (d11 - d10);
    return a + v * (b - a);
  };
  return {bilinear(c[4] - c[0], c[5] - c[1], c[6] - c[2], c[7] - c[3], u.y, u.z),
          bilinear(c[2] - c[0], c[3] - c[1], c[6] - c[4], c[7] - c[5], u.x, u.z),
          bilinear(c[1] - c[0], c[3] - c[2], c[5] - c[4], c[7] - c[6], u.x, u.y)};
}

inline GridField::Place GridField::place(const Vec3& x) const {
  Place p;
  for (int i = 0; i < 3; ++i) {
    const int nodes = grid_->nodes()[i];
    p.cell[i] = cell_of(x[i], nodes);
    p.outside[i] = !(x[i] >= 0 && x[i] <= nodes - 1);
    p.local[i] = p.outside[i] ? (x[i] > 0 ? 1.0 : 0.0) : x[i] - p.cell[i];
  }
  return p;
}

inline bool GridField::load(const Index3& cell, Cell& out) const {
  const BrickGrid::Brick& brick = grid_->brick_of(cell);
  if (brick.values < 0) {
    for (double& c : out.corner) c = factor_ * brick.min;
    return false;
  }
  float c[8];
  grid_->corners(brick, cell, c);
  for (int i = 0; i < 8; ++i) out.corner[i] = factor_ * c[i];
  return true;
}

class GridField::Line final : public FieldLine {
 public:
  Line(const GridField& field, const Vec3& o, const Vec3& d);

  double next_break(double t) const override {
    if (outside_with_background(t)) return t < box_in_ ? box_in_ : kInfinity;
    const Step& step = locate(t);
    const BrickGrid::Brick& brick = field_->grid_->brick_of(step.cell);
    return brick.values < 0 ? brick_exit(step) : step.exit;
  }

  // From here on both lines, of grids with the same nodes, are located by the other one, which
  // stays where it is in memory.
  void follow(const Line& other) { leader_ = &other; }
  bool can_follow(const Line& other) const { return field_->same_lattice(*other.field_); }

  // The trilinear cell as a cubic in s = t - middle.
  void enter(double a, double b) override {
    middle_ = std::isfinite(b) ? (a + b) / 2 : a + std::max(unit_, std::abs(a));
    // The cell that was located last, in nearly all cases.
    const Vec3 x = at(middle_);
    const Step& step = located();
    slope_ = direction_;
    constant_ = true;
    if (a == step.at && b <= step.exit && a >= box_in_ && b <= box_out_) {
      // Number by number: whole structs would wait for the stores of their parts.
      for (int i = 0; i < 3; ++i) {
        const int cell = step.cell[i];
        place_.cell[i] = cell;
        place_.local[i] = x[i] - cell;
        place_.outside[i] = false;
      }
    } else {
      place_ = field_->place(x);
      if (field_->background_ && place_.any_outside()) return set_constant(*field_->background_);
      for (int i = 0; i < 3; ++i)
        if (place_.outside[i]) slope_[i] = 0;
    }
    const BrickGrid::Brick& brick = field_->grid_->brick_of(place_.cell);
    if (brick.values < 0) return set_constant(field_->factor_ * brick.min);
    constant_ = false;
    // Linear in s along x, quadratic with y, for the two corners along z at once; cubic with z.
    using Pair = Eigen::Array2d;
    const float* first = field_->grid_->first_corner(brick, place_.cell);
    const auto pair = [&](int i, int j) -> Pair {
      return Eigen::Map<const Eigen::Array2f>(first + BrickGrid::corner_offset(i, j))
                 .cast<double>() *
             field_->factor_;
    };
    const Vec3& u = place_.local;
    const Pair c0 = pair(0, 0), c1 = pair(0, 1), d0 = pair(1, 0) - c0, d1 = pair(1, 1) - c1;
    const Pair a0 = c0 + u.x * d0, rise = c1 + u.x * d1 - a0;
    const Pair b0 = slope_.x * d0, bend = slope_.x * d1 - b0;
    const Pair q0 = a0 + u.y * rise, q1 = b0 + u.y * bend + slope_.y * rise, q2 = slope_.y * bend;
    const double e0 = q0[1] - q0[0], e1 = q1[1] - q1[0], e2 = q2[1] - q2[0];
    cubic_[0] = q0[0] + u.z * e0;
    cubic_[1] = q1[0] + u.z * e1 + slope_.z * e0;
    cubic_[2] = q2[0] + u.z * e2 + slope_.z * e1;
    cubic_[3] = slope_.z * e2;
  }

  void evaluate(double t, double& value, double& derivative) const override {
    const double s = t - middle_;
    value = cubic_[0] + s * (cubic_[1] + s * (cubic_[2] + s * cubic_[3]));
    derivative = cubic_[1] + s * (2 * cubic_[2] + s * 3 * cubic_[3]);
  }

  double above_until(double t, double t_end, double threshold) const override;

  FieldSample sample(double t) const override {
    FieldSample out;
    double derivative;
    evaluate(t, out.value, derivative);
    if (constant_) return out;
    Cell cell;
    field_->load(place_.cell, cell);
    const Vec3 g = cell.gradient(place_.local + slope_ * (t - middle_));
    for (int i = 0; i < 3; ++i)
      out.gradient[i] = place_.outside[i] ? 0.0 : g[i] / field_->voxel_size_[i];
    return out;
  }

 private:
  // Where the ray is just after t: its cell, for each axis the next face it crosses and when
  // (never: infinity), and when it leaves the cell. Faces are compared by their times, which depend
  // on the face alone, so that no rounding can repeat or skip one; faces closer to t than `sliver_`
  // (1e-10 of a cell) count as crossed.
  struct Step {
    Index3 cell;
    Index3 face;  // -1 or nodes() past the last one
    double time[3];
    double exit = -kInfinity;
    double at = -kInfinity;  // the t that it was located for
  };
  Step& located() const { return leader_ ? leader_->step_ : step_; }
  Vec3 at(double t) const { return anchor_ + direction_ * (t - anchor_t_); }
  double face_time(int axis, int face) const {
    return anchor_t_ + (face - anchor_[axis]) * inverse_[axis];
  }
  bool outside_with_background(double t) const {
    return field_->background_ && (t < box_in_ - sliver_ || t >= box_out_ - sliver_);
  }
  const Step& locate(double t) const {
    Step& step = located();
    if (t == step.at) return step;
    if (t != step.exit) {  // not on from the last step
      const Vec3 x = at(t);
      for (int i = 0; i < 3; ++i) {
        const int nodes = field_->grid_->nodes()[i];
        const double clamped = std::clamp(x[i], -1.0, static_cast<double>(nodes));
        // Rounding by conversion: to plain x86-64 floor is a call.
        int face = -1;
        if (inverse_[i] > 0) face = std::max(static_cast<int>(clamped + 1) - 1, 0);
        if (inverse_[i] < 0) face = std::min(nodes - static_cast<int>(nodes - clamped), nodes - 1);
        step.cell[i] = cell_of(x[i], nodes);
        set_face(step, i, face);
      }
    }
    for (int i = 0; i < 3; ++i)
      while (step.time[i] <= t + sliver_)
        set_face(step, i, step.face[i] + (inverse_[i] > 0 ? 1 : -1));
    step.exit = std::min({step.time[0], step.time[1], step.time[2]});
    step.at = t;
    return step;
  }
  void set_face(Step& step, int axis, int face) const {
    const int nodes = field_->grid_->nodes()[axis];
    step.face[axis] = face;
    step.time[axis] =
        inverse_[axis] != 0 && face >= 0 && face < nodes ? face_time(axis, face) : kInfinity;
    if (inverse_[axis] != 0)
      step.cell[axis] = std::clamp(inverse_[axis] > 0 ? face - 1 : face, 0, nodes - 2);
  }
  // When the ray leaves the brick of its cell.
  double brick_exit(const Step& step) const {
    constexpr int n = BrickGrid::kCells;
    double exit = kInfinity;
    for (int i = 0; i < 3; ++i) {
      const int last = field_->grid_->nodes()[i] - 1;
      int face = step.face[i];
      if (face < 0 || face > last) continue;
      const bool inside = inverse_[i] > 0 ? face > 0 : face < last;
      if (inside)
        face = inverse_[i] > 0 ? std::min((step.cell[i] / n + 1) * n, last) : step.cell[i] / n * n;
      exit = std::min(exit, face_time(i, face));
    }
    return exit;
  }
  void set_constant(double value) {
    cubic_[0] = value;
    cubic_[1] = cubic_[2] = cubic_[3] = 0;
  }

  const GridField* field_;
  Vec3 anchor_, direction_,
      inverse_;  // index space; inverse 0: the ray crosses no face along this axis
  double anchor_t_ = 0, unit_, sliver_, box_in_, box_out_;

  mutable Step step_;  // the last one located: where the next one starts from
  const Line* leader_ = nullptr;
  // The piece selected last, in s = t - middle.
  double cubic_[4], middle_ = 0;
  Place place_;
  Vec3 slope_;
  bool constant_ = true;
};

}  // namespace gpis
