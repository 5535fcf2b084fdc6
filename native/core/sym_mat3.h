// Symmetric 3x3 matrices by their six entries: squared length scales and their derivatives.
#pragma once

#include "core/vec.h"

namespace gpis {

struct SymMat3 {
  double xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;

  double operator[](int i) const { return (&xx)[i]; }
  double& operator[](int i) { return (&xx)[i]; }

  static SymMat3 identity(double s = 1) { return {s, s, s, 0, 0, 0}; }
  // The symmetric part is all there is: m must be symmetric but for rounding.
  static SymMat3 of(const Mat3& m) {
    return {m.row[0].x, m.row[1].y, m.row[2].z, m.row[0].y, m.row[0].z, m.row[1].z};
  }
  Mat3 matrix() const { return {{Vec3{xx, xy, xz}, Vec3{xy, yy, yz}, Vec3{xz, yz, zz}}}; }
};
static_assert(sizeof(SymMat3) == 6 * sizeof(double));  // operator[]

inline SymMat3 operator+(const SymMat3& a, const SymMat3& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
inline SymMat3 operator*(const SymMat3& a, double s) {
  return {a.xx * s, a.yy * s, a.zz * s, a.xy * s, a.xz * s, a.yz * s};
}
inline SymMat3 operator-(const SymMat3& a, const SymMat3& b) {
  return a + b * -1.0;
}
inline Vec3 operator*(const SymMat3& a, const Vec3& v) {
  return {a.xx * v.x + a.xy * v.y + a.xz * v.z, a.xy * v.x + a.yy * v.y + a.yz * v.z,
          a.xz * v.x + a.yz * v.y + a.zz * v.z};
}
// tr(a b)
inline double trace_of_product(const SymMat3& a, const SymMat3& b) {
  return a.xx * b.xx + a.yy * b.yy + a.zz * b.zz + 2 * (a.xy * b.xy + a.xz * b.xz + a.yz * b.yz);
}
// m a mᵀ
inline SymMat3 congruence(const Mat3& m, const SymMat3& a) {
  return SymMat3::of(m * a.matrix() * transpose(m));
}
// a = L diag(d) Lᵀ with a unit lower L: determinant and inverse of a positive definite matrix keep
// their relative precision up to its condition number, where minors would lose its square.
struct Cholesky3 {
  double l10, l20, l21, d0, d1, d2;
  bool positive;

  explicit Cholesky3(const SymMat3& a) {
    d0 = a.xx;
    l10 = a.xy / d0;
    l20 = a.xz / d0;
    d1 = a.yy - l10 * a.xy;
    const double e = a.yz - l20 * a.xy;
    l21 = e / d1;
    d2 = a.zz - l20 * a.xz - l21 * e;
    positive = d0 > 0 && d1 > 0 && d2 > 0;
  }
  double determinant() const { return d0 * d1 * d2; }
  Vec3 solve(const Vec3& v) const {
    const double y = v.y - l10 * v.x, z = v.z - l20 * v.x - l21 * y;
    const double sz = z / d2, sy = y / d1 - l21 * sz;
    return {v.x / d0 - l10 * sy - l20 * sz, sy, sz};
  }
  SymMat3 inverse() const {  // L⁻ᵀ diag(1/d) L⁻¹
    const double m20 = l10 * l21 - l20, i0 = 1 / d0, i1 = 1 / d1, i2 = 1 / d2;
    return {i0 + l10 * l10 * i1 + m20 * m20 * i2,
            i1 + l21 * l21 * i2,
            i2,
            -l10 * i1 - m20 * l21 * i2,
            m20 * i2,
            -l21 * i2};
  }
};

}  // namespace gpis
