#include "field/grid_field.h"

#include "field/check.h"

namespace gpis {

GridField::GridField(std::shared_ptr<const BrickGrid> grid, const Vec3& voxel_size,
                     const Vec3& origin, std::optional<double> background)
    : grid_(std::move(grid)), voxel_size_(voxel_size), origin_(origin), background_(background) {
  check_positive("GridField: voxel_size", voxel_size);
  check_finite("GridField: origin", origin);
  range_ = grid_->range();
  if (background_) {
    check_finite("GridField: background", *background_);
    range_.min = std::min(range_.min, *background_);
    range_.max = std::max(range_.max, *background_);
  }
  lipschitz_ = grid_->lipschitz(voxel_size);
}

std::shared_ptr<const GridField> GridField::without_background() const {
  auto out = std::make_shared<GridField>(*this);
  out->background_.reset();
  const Range range = grid_->range();
  out->range_ = factor_ > 0 ? Range{factor_ * range.min, factor_ * range.max}
                            : Range{factor_ * range.max, factor_ * range.min};
  return out;
}

std::shared_ptr<const GridField> GridField::scaled(double factor) const {
  auto out = std::make_shared<GridField>(*this);
  out->factor_ *= factor;
  if (background_) out->background_ = factor * *background_;
  out->range_ = factor > 0 ? Range{factor * range_.min, factor * range_.max}
                           : Range{factor * range_.max, factor * range_.min};
  out->lipschitz_ *= std::abs(factor);
  return out;
}

std::shared_ptr<const GridField> GridField::moved(const Vec3& stretch, const Vec3& shift) const {
  auto out = std::make_shared<GridField>(*this);
  out->voxel_size_ = voxel_size_ * stretch;
  out->origin_ = origin_ * stretch + shift;
  out->lipschitz_ = std::abs(factor_) * grid_->lipschitz(out->voxel_size_);
  return out;
}

bool GridField::same_lattice(const GridField& other) const {
  for (int i = 0; i < 3; ++i)
    if (grid_->nodes()[i] != other.grid_->nodes()[i] || voxel_size_[i] != other.voxel_size_[i] ||
        origin_[i] != other.origin_[i])
      return false;
  return true;
}

std::optional<Box3> GridField::support() const {
  const Index3& n = grid_->nodes();
  const Vec3 cells{n[0] - 1.0, n[1] - 1.0, n[2] - 1.0};
  return Box3{origin_, origin_ + cells * voxel_size_};
}

double GridField::value(const Vec3& p) const {
  const Place at = place(to_index(p));
  if (background_ && at.any_outside()) return *background_;
  Cell cell;
  load(at.cell, cell);
  return cell.value(at.local);
}

FieldSample GridField::sample(const Vec3& p) const {
  const Place at = place(to_index(p));
  if (background_ && at.any_outside()) return {*background_, {}};
  Cell cell;
  load(at.cell, cell);
  Vec3 gradient = cell.gradient(at.local);
  for (int i = 0; i < 3; ++i) gradient[i] = at.outside[i] ? 0.0 : gradient[i] / voxel_size_[i];
  return {cell.value(at.local), gradient};
}

std::unique_ptr<FieldLine> GridField::line(const Vec3& o, const Vec3& d) const {
  return std::make_unique<Line>(*this, o, d);
}

GridField::Line::Line(const GridField& field, const Vec3& o, const Vec3& d) : field_(&field) {
  const Index3& n = field.grid_->nodes();
  const Box3 box{{0, 0, 0}, {n[0] - 1.0, n[1] - 1.0, n[2] - 1.0}};
  const Vec3 start = field.to_index(o);
  direction_ = {d.x / field.voxel_size_.x, d.y / field.voxel_size_.y, d.z / field.voxel_size_.z};
  std::tie(box_in_, box_out_) = clip(box, start, direction_, -kInfinity, kInfinity);
  if (!(box_in_ <= box_out_)) {
    box_in_ = kInfinity;
    box_out_ = -kInfinity;
  }
  // Faces are measured from where the ray enters the grid, so that a far origin costs no precision
  // between them.
  anchor_ = start;
  if (std::isfinite(box_in_) && box_in_ > 0) {
    anchor_t_ = box_in_;
    anchor_ = start + direction_ * box_in_;
  }
  const double fastest =
      std::max({std::abs(direction_.x), std::abs(direction_.y), std::abs(direction_.z)});
  unit_ = 1 / fastest;
  sliver_ = 1e-10 * unit_ + 1e-15 * std::abs(anchor_t_);
  // A ray this close to parallel with a face counts as parallel: it does not cross it inside any
  // grid that can be stored.
  for (int i = 0; i < 3; ++i) {
    if (std::abs(direction_[i]) <= 1e-14 * fastest) direction_[i] = 0;
    inverse_[i] = direction_[i] != 0 ? 1 / direction_[i] : 0.0;
  }
  enter(anchor_t_, anchor_t_);
}

double GridField::Line::above_until(double t, double t_end, double threshold) const {
  while (t < t_end) {
    if (outside_with_background(t)) {
      if (!(*field_->background_ > threshold)) return t;
      t = t < box_in_ ? box_in_ : kInfinity;
      continue;
    }
    const Step& step = locate(t);
    const BrickGrid::Brick& brick = field_->grid_->brick_of(step.cell);
    if (field_->least(brick) > threshold) {
      t = brick_exit(step);
      continue;
    }
    if (brick.values < 0) return t;
    Cell cell;
    field_->load(step.cell, cell);
    if (!(*std::min_element(cell.corner, cell.corner + 8) > threshold)) return t;
    t = step.exit;
  }
  return std::min(t, t_end);
}

}  // namespace gpis
