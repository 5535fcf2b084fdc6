#include "field/convex_body.h"

#include <cmath>

#include "field/box_field.h"
#include "field/plane_field.h"
#include "field/sphere_field.h"
#include "field/transformed_field.h"

namespace gpis {

std::optional<ConvexBody> ConvexBody::of(const Field& field) {
  if (const auto* moved = dynamic_cast<const TransformedField*>(&field)) {
    std::optional<ConvexBody> body = of(moved->field());
    if (!body) return body;
    body->to_body_ = body->moved_ ? body->to_body_ * moved->to_field() : moved->to_field();
    body->moved_ = true;
    return body;
  }
  ConvexBody body;
  if (const auto* plane = dynamic_cast<const PlaneField*>(&field)) {
    body.kind_ = Kind::plane;
    body.center_ = plane->point();
    body.gradient_ = plane->gradient();
  } else if (const auto* box = dynamic_cast<const BoxField*>(&field)) {
    body.kind_ = Kind::box;
    body.center_ = box->center();
    body.box_ = {-box->half(), box->half()};
  } else if (const auto* sphere = dynamic_cast<const SphereField*>(&field)) {
    body.kind_ = Kind::sphere;
    body.center_ = sphere->center();
    body.radius_ = sphere->radius();
  } else {
    return {};
  }
  return body;
}

ConvexBody::Stretch ConvexBody::inside(const Vec3& o, const Vec3& d) const {
  constexpr Stretch none{kInfinity, -kInfinity};
  const Vec3 from = (moved_ ? to_body_.point(o) : o) - center_;
  const Vec3 v = moved_ ? to_body_.vector(d) : d;
  if (kind_ == Kind::plane) {
    const double value = dot(gradient_, from), slope = dot(gradient_, v);
    if (slope > 0) return {-kInfinity, -value / slope};
    if (slope < 0) return {-value / slope, kInfinity};
    return value < 0 ? Stretch{-kInfinity, kInfinity} : none;
  }
  if (kind_ == Kind::box) {
    const auto [begin, end] = clip(box_, from, v, -kInfinity, kInfinity);
    return {begin, end};
  }
  // From the nearest point: a difference of two large distances would lose a small chord.
  const double speed2 = dot(v, v), nearest = -dot(from, v) / speed2;
  const Vec3 miss = from + v * nearest;
  const double half2 = radius_ * radius_ - dot(miss, miss);
  if (!(half2 > 0)) return none;
  const double half = std::sqrt(half2 / speed2);
  return {nearest - half, nearest + half};
}

}  // namespace gpis
