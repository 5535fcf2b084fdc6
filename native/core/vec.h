// Vectors, matrices and affine maps of the whole renderer, in double precision.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace gpis {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Vec3 {
  double x = 0, y = 0, z = 0;

  double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  double& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator-(const Vec3& a) {
  return {-a.x, -a.y, -a.z};
}
inline Vec3 operator*(const Vec3& a, const Vec3& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
inline Vec3 operator*(const Vec3& a, double s) {
  return {a.x * s, a.y * s, a.z * s};
}
inline Vec3 operator*(double s, const Vec3& a) {
  return a * s;
}
inline Vec3 operator/(const Vec3& a, double s) {
  return {a.x / s, a.y / s, a.z / s};
}
inline Vec3& operator+=(Vec3& a, const Vec3& b) {
  return a = a + b;
}
inline Vec3& operator*=(Vec3& a, const Vec3& b) {
  return a = a * b;
}
inline Vec3& operator*=(Vec3& a, double s) {
  return a = a * s;
}

inline double dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(const Vec3& a) {
  return std::sqrt(dot(a, a));
}
inline Vec3 normalize(const Vec3& a) {
  return a / length(a);
}
inline double max_component(const Vec3& a) {
  return std::max(a.x, std::max(a.y, a.z));
}
inline bool is_finite(const Vec3& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

// Colours are vectors of linear RGB.
using Color = Vec3;
inline double luminance(const Color& c) {
  return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
}

// Row-major 3x3 matrix.
struct Mat3 {
  std::array<Vec3, 3> row{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
};

inline Vec3 operator*(const Mat3& m, const Vec3& v) {
  return {dot(m.row[0], v), dot(m.row[1], v), dot(m.row[2], v)};
}
inline Mat3 transpose(const Mat3& m) {
  return {{Vec3{m.row[0].x, m.row[1].x, m.row[2].x}, Vec3{m.row[0].y, m.row[1].y, m.row[2].y},
           Vec3{m.row[0].z, m.row[1].z, m.row[2].z}}};
}
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  const Mat3 bt = transpose(b);
  Mat3 r;
  for (int i = 0; i < 3; ++i)
    r.row[i] = {dot(a.row[i], bt.row[0]), dot(a.row[i], bt.row[1]), dot(a.row[i], bt.row[2])};
  return r;
}
inline Mat3 operator+(const Mat3& a, const Mat3& b) {
  return {{a.row[0] + b.row[0], a.row[1] + b.row[1], a.row[2] + b.row[2]}};
}
inline Mat3 operator*(const Mat3& m, double s) {
  return {{m.row[0] * s, m.row[1] * s, m.row[2] * s}};
}
inline Mat3 outer(const Vec3& a, const Vec3& b) {
  return {{b * a.x, b * a.y, b * a.z}};
}
inline double determinant(const Mat3& m) {
  return dot(m.row[0], cross(m.row[1], m.row[2]));
}
// The caller has checked that the determinant is not zero.
inline Mat3 inverse(const Mat3& m) {
  const double s = 1 / determinant(m);
  return transpose(Mat3{{cross(m.row[1], m.row[2]) * s, cross(m.row[2], m.row[0]) * s,
                         cross(m.row[0], m.row[1]) * s}});
}

// x -> linear * x + translation.
struct Affine {
  Mat3 linear;
  Vec3 translation;

  Vec3 point(const Vec3& p) const { return linear * p + translation; }
  Vec3 vector(const Vec3& v) const { return linear * v; }
};
inline Affine inverse(const Affine& a) {
  const Mat3 m = inverse(a.linear);
  return {m, -(m * a.translation)};
}
inline Affine operator*(const Affine& a, const Affine& b) {
  return {a.linear * b.linear, a.point(b.translation)};
}

struct Ray {
  Vec3 origin;
  Vec3 direction;  // unit length in world space

  Vec3 at(double t) const { return origin + direction * t; }
};

struct Box3 {
  Vec3 min{kInfinity, kInfinity, kInfinity};
  Vec3 max{-kInfinity, -kInfinity, -kInfinity};

  static constexpr Box3 everywhere() {
    return {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
  }
  bool empty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
  bool contains(const Vec3& p) const {
    for (int i = 0; i < 3; ++i)
      if (p[i] < min[i] || p[i] > max[i]) return false;
    return true;
  }
  void include(const Vec3& p) {
    for (int i = 0; i < 3; ++i) {
      min[i] = std::min(min[i], p[i]);
      max[i] = std::max(max[i], p[i]);
    }
  }
};

// The interval of t in which origin + t direction lies in the box; empty if first > second. A
// direction component of zero keeps or rejects the whole slab (no 0·inf), so rays along a face
// count as inside.
inline std::pair<double, double> clip(const Box3& box, const Vec3& o, const Vec3& d, double t0,
                                      double t1) {
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) {
      if (o[i] < box.min[i] || o[i] > box.max[i]) return {kInfinity, -kInfinity};
      continue;
    }
    const double a = (box.min[i] - o[i]) / d[i], b = (box.max[i] - o[i]) / d[i];
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  }
  return {t0, t1};
}

// Orthonormal frame about a unit normal (Duff et al. 2017, "Building an orthonormal basis,
// revisited").
struct Frame {
  Vec3 s, t, n;

  explicit Frame(const Vec3& normal) : n(normal) {
    const double sign = std::copysign(1.0, n.z);
    const double a = -1 / (sign + n.z), b = n.x * n.y * a;
    s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
  }
  Vec3 to_world(const Vec3& v) const { return s * v.x + t * v.y + n * v.z; }
  Vec3 to_local(const Vec3& v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
};

}  // namespace gpis
