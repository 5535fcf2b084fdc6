#include "process/dense_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <span>

namespace gpis {
namespace {

constexpr double kSliver = 1e-6;   // of an interval
constexpr int kMostHalvings = 12;  // of an interval, for what A does in it
constexpr double kAlike = 1.3;     // lengths at both ends of an interval
// Of the kinks allowed: hardly any.
constexpr double kFew = 0.4;
// Of a length scale; and a share of the variance that a cubic over it may miss.
constexpr double kShort = 0.1, kSmoothest = 1e-9;
// Of the variance behind a known start; and the least share of an interval for the first.
constexpr double kOffBehindStart = 0.01, kLeastShare = 1.0 / 16;
constexpr double kQuarters[] = {0.25, 0.5, 0.75};

// One of a sum of values and slopes of g.
struct Part {
  LocalPoint at;
  Functional what;
};

using Parts = std::span<const Part>;

double shared(const Covariance& covariance, Parts a, Parts b) {
  double sum = 0;
  for (const Part& p : a)
    for (const Part& q : b) sum += covariance.between(p.at, p.what, q.at, q.what);
  return sum;
}

double variance_of(const Covariance& covariance, Parts parts) {
  double sum = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j)
      sum += (i == j ? 1 : 2) *
             covariance.between(parts[i].at, parts[i].what, parts[j].at, parts[j].what);
  return sum;
}

Part value_at(const Covariance& covariance, const LineGeometry& line, double t) {
  return {covariance.at(line.origin + line.direction * t), {}};
}

// At a fraction s of [a, a + h]: what the cubic through both ends has there, less g.
std::array<Part, 3> error_of_cubic(const Covariance& covariance, const LineGeometry& line, double a,
                                   double h, double s) {
  const double r = 1 - s;
  const Vec3 d = line.direction;
  const auto at = [&](double t) { return covariance.at(line.origin + d * t); };
  return {Part{at(a), {r * r * (1 + 2 * s), d * (r * r * s * h)}}, Part{at(a + s * h), {-1, {}}},
          Part{at(a + h), {s * s * (1 + 2 * r), d * (-s * s * r * h)}}};
}

double missed(const Covariance& covariance, const LineGeometry& line, double a, double h,
              double s) {
  return variance_of(covariance, error_of_cubic(covariance, line, a, h, s));
}

// The cubic through values and slopes h apart misses a variance of q h³/192 in the middle, and one
// of order h⁵ of what has a second derivative: taken off by that of half the interval about the
// same place.
double intensity_from(const Covariance& covariance, const LineGeometry& line, double h) {
  const double rough =
      (32 * missed(covariance, line, h / 4, h / 2, 0.5) - missed(covariance, line, 0, h, 0.5)) / 3;
  return rough > kSmoothest * covariance.variance() ? 192 * rough / (h * h * h) : 0;
}

// Covariance of an integrated Brownian motion of intensity 1 at fractions of an interval h, given
// value and slope at both ends.
double bridged(double h, double s, double u) {
  if (s > u) std::swap(s, u);
  return h * h * h * s * s * (1 - u) * (1 - u) * (3 * u - s - 2 * s * u) / 6;
}

// How far off the variance of g is close to a known start, by the cubic to h and, of a rough path,
// by the bridge on top of it; relative.
double off_behind_start(const Covariance& covariance, const Vec3& d, double h) {
  const LineGeometry line{{}, d};
  const double s = 0.125, r = 1 - s;
  const LocalPoint start = covariance.at({}), there = covariance.at(d * h),
                   near = covariance.at(d * (s * h));
  const Part rows[] = {{start, {}}, {start, {0, d}}, {near, {}}, {there, {}}, {there, {0, d}}};
  Eigen::Matrix<double, 5, 5> k;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 5; ++j)
      k(i, j) = covariance.between(rows[i].at, rows[i].what, rows[j].at, rows[j].what);
  const Eigen::Matrix3d given =
      k.bottomRightCorner<3, 3>() -
      k.bottomLeftCorner<3, 2>() * k.topLeftCorner<2, 2>().ldlt().solve(k.topRightCorner<2, 3>());
  const Eigen::Vector2d weights{s * s * (1 + 2 * r), -s * s * r * h};
  const double bridge = intensity_from(covariance, line, h) * bridged(h, s, s);
  const double implied = weights.dot(given.bottomRightCorner<2, 2>() * weights) + bridge;
  return given(0, 0) > 0 ? std::abs(implied / given(0, 0) - 1) : 0;
}

Covariance unvaried(const GaussianProcess& process) {
  GaussianProcess out = process;
  out.anisotropy = nullptr;
  return Covariance(out);
}

}  // namespace

double DensePoints::roughness_under(const GaussianProcess& process) {
  if (!process.anisotropy) return 0;
  const Covariance covariance = unvaried(process);
  return intensity_from(covariance, {{}, {1, 0, 0}},
                        kShort / std::sqrt(Covariance(process).shortest_inverse2()));
}

double DensePoints::first_under(const GaussianProcess& process, double lengths) {
  const Covariance covariance = unvaried(process);
  double share = 1;
  for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    const double length = covariance.length_scale(covariance.at({}), d);
    while (std::isfinite(length) && share > kLeastShare &&
           off_behind_start(covariance, d, share * lengths * length) > kOffBehindStart)
      share /= 2;
  }
  return share;
}

void DensePoints::reset(const Covariance& covariance, const LineGeometry& line,
                        const LineRows* lengths, const Spacing& spacing, double anchor,
                        double step) {
  covariance_ = &covariance;
  line_ = line;
  lengths_ = lengths;
  spacing_ = spacing;
  anchor_ = anchor;
  step_ = step;
  first_ = 0;
  intensity_ =
      lengths || covariance.smooth() || std::isinf(step)
          ? 0
          : intensity_from(covariance, {line.origin + line.direction * anchor, line.direction},
                           kShort * covariance.length_scale({}, line.direction));
}

double DensePoints::length_at(double t) const {
  return lengths_->length_scale(lengths_->at(t));
}

// As far as a length at t allows: to the end of a cell, or an even part of the way there.
double DensePoints::farther(double t, double length) const {
  const double far = t + spacing_.lengths * length;
  const double cells = std::floor((far - anchor_) / step_ + 1e-6), end = anchor_ + cells * step_;
  if (end > t + 1e-9 * step_) return end;
  const double whole = anchor_ + (cells + 1) * step_;
  const double parts = std::ceil((whole - t) / (far - t) - 1e-6);
  return parts > 1 ? t + (whole - t) / parts : whole;
}

double DensePoints::after(double t) const {
  const double next = regular(t);
  return first_ > 0 ? std::min(next, t + std::max(first_, t - anchor_)) : next;
}

// As far as the lengths at both ends allow (half as far until the next one does: what is short may
// be in that one place) and the kinks of A between them, and no farther than a cubic goes.
double DensePoints::regular(double t) const {
  if (!lengths_) return anchor_ + (std::floor((t - anchor_) / step_ + 1e-6) + 1) * step_;
  const double here = length_at(t);
  double next = farther(t, here);
  double there = length_at(next);
  while (next - t > (1 + 1e-6) * spacing_.lengths * there) {
    next = t + 0.5 * (next - t);
    there = length_at(next);
  }
  const bool alike = here < kAlike * there && there < kAlike * here;
  const TensorField& a = *covariance_->anisotropy();
  for (int i = 0; i < kMostHalvings; ++i) {
    const double h = next - t;
    const double kinks =
        a.kinks(line_.origin, line_.direction, t + kSliver * h, next - kSliver * h) * h;
    const bool smooth = kinks <= kFew * spacing_.kinks;
    if (smooth && alike) break;
    const auto good = [&](double s) {
      return missed(*covariance_, line_, t, h, s) <= spacing_.missed * covariance_->variance();
    };
    // Without kinks A is a cubic there.
    if (kinks <= spacing_.kinks && good(0.5) && (smooth || (good(0.25) && good(0.75)))) break;
    next = t + 0.5 * h;
  }
  return next;
}

// What is rough about the covariance of Paciorek and Schervish is that of the kernel at the
// distance dᵀA⁻¹d.
double DensePoints::slope_intensity(double t) const {
  if (!lengths_) return intensity_;
  if (!(spacing_.roughness > 0)) return 0;
  const double length =
      lengths_->plain_length_scale(lengths_->at(t)) * std::sqrt(covariance_->shortest_inverse2());
  return spacing_.roughness / (length * length * length);
}

double DensePoints::error_of_cubics(const Interval& a, const Interval& b) const {
  const double h = a.end - a.begin, k = b.end - b.begin;
  const double intensity = a.begin == b.begin ? slope_intensity(a.begin + 0.5 * h) : 0;
  double largest = 0;
  for (const double s : kQuarters) {
    const auto here = error_of_cubic(*covariance_, line_, a.begin, h, s);
    const std::array there{value_at(*covariance_, line_, a.begin + s * h)};
    const std::array end{value_at(*covariance_, line_, b.begin)};
    largest = std::max(largest, std::abs(shared(*covariance_, here, end)));
    for (const double u : kQuarters) {
      const auto other = error_of_cubic(*covariance_, line_, b.begin, k, u);
      const std::array at{value_at(*covariance_, line_, b.begin + u * k)};
      largest = std::max(
          largest, std::abs(shared(*covariance_, here, at) + shared(*covariance_, there, other) +
                            shared(*covariance_, here, other) + intensity * bridged(h, s, u)));
    }
  }
  return largest / covariance_->variance();
}

}  // namespace gpis
