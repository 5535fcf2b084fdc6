#include "field/box_field.h"

namespace gpis {

BoxField::Piece BoxField::piece_at(const Vec3& q) const {
  Piece piece;
  double nearest = -kInfinity;
  for (int i = 0; i < 3; ++i) {
    const double depth = std::abs(q[i]) - half_[i];
    if (depth > 0) {
      piece.side[i] = q[i] > 0 ? 1 : -1;
      ++piece.outside_axes;
    }
    if (depth > nearest) {
      nearest = depth;
      piece.axis = i;
    }
  }
  if (piece.outside_axes == 0) piece.side[piece.axis] = q[piece.axis] < 0 ? -1 : 1;
  return piece;
}

FieldSample BoxField::Piece::sample(const Vec3& q, const Vec3& half, const Vec3& v) const {
  FieldSample out;
  if (outside_axes <= 1) {
    out.value = side[axis] * q[axis] - half[axis];
    out.gradient[axis] = side[axis];
    return out;
  }
  Vec3 past;  // from the edge or corner
  for (int i = 0; i < 3; ++i) past[i] = side[i] == 0 ? 0.0 : q[i] - side[i] * half[i];
  out.value = length(past);
  if (!(out.value > 0))
    for (int i = 0; i < 3; ++i) past[i] = side[i] == 0 ? 0.0 : v[i];
  out.gradient = normalize(past);
  return out;
}

FieldSample BoxField::sample(const Vec3& p) const {
  const Vec3 q = p - center_;
  return piece_at(q).sample(q, half_, q);
}

std::unique_ptr<FieldLine> BoxField::line(const Vec3& o, const Vec3& d) const {
  return std::make_unique<Line>(*this, o, d);
}

// Breaks: the planes of the faces, and inside the box the planes where the nearest face changes:
// where an axis passes the centre, and where two axes are equally deep.
BoxField::Line::Line(const BoxField& field, const Vec3& o, const Vec3& d)
    : field_(&field), start_(o - field.center_), direction_(d) {
  const Vec3& h = field.half_;
  const auto add = [&](double position, double speed, double target, bool inside_only) {
    const double t = (target - position) / speed;
    if (!std::isfinite(t)) return;
    if (inside_only && field.piece_at(at(t)).outside_axes > 0) return;
    breaks_[count_++] = t;
  };
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    for (const double sign : {-1.0, 1.0}) add(start_[i], d[i], sign * h[i], false);
    add(start_[i], d[i], 0, true);
    for (const double si : {-1.0, 1.0})
      for (const double sj : {-1.0, 1.0})
        add(si * start_[i] - sj * start_[j], si * d[i] - sj * d[j], h[i] - h[j], true);
  }
  std::sort(breaks_.begin(), breaks_.begin() + count_);
  enter(0, 0);
}

double BoxField::Line::next_break(double t) const {
  const double* end = breaks_.data() + count_;
  const double* next = std::upper_bound(breaks_.data(), end, t);
  const double face = next == end ? kInfinity : *next;
  // Past an edge or corner the distance is sqrt(miss² + s²), s from the nearest point: too sharp
  // for one step where miss is small, so the steps halve towards it and double from it, between
  // miss and the size of the box.
  const double middle = std::isfinite(face) ? (t + face) / 2 : t + std::max(1.0, std::abs(t));
  const Piece piece = field_->piece_at(at(middle));
  if (piece.outside_axes < 2) return face;
  Vec3 past, v;
  for (int i = 0; i < 3; ++i) {
    if (piece.side[i] == 0) continue;
    past[i] = start_[i] - piece.side[i] * field_->half_[i];
    v[i] = direction_[i];
  }
  const double speed = length(v), size = field_->smallest_half();
  if (speed == 0) return face;
  const double nearest = -dot(past, v) / (speed * speed);
  const double unit = std::max(length(past + v * nearest), 1e-6 * size) / speed;
  const double s = (t - nearest) / unit, far = size / (speed * unit);
  if (s > far) return face;
  double stop;
  if (s < -1.01 * far)
    stop = -far;
  else if (s < -1.01)
    stop = s / 2;
  else
    stop = s < -1e-3 ? 0 : std::max(1.0, 2 * s);
  return std::min(face, nearest + stop * unit);
}

}  // namespace gpis
