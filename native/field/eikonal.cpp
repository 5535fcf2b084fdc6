#include "field/eikonal.h"

#include <algorithm>
#include <cmath>

namespace gpis {
namespace {

// The value at a node from its least neighbour along each axis: Godunov's upwind scheme.
double upwind(double a, double b, double c, double h) {
  if (a > b) std::swap(a, b);
  if (b > c) std::swap(b, c);
  if (a > b) std::swap(a, b);
  double u = a + h;
  if (u <= b) return u;
  u = (a + b + std::sqrt(2 * h * h - (a - b) * (a - b))) / 2;
  if (u <= c) return u;
  const double sum = a + b + c;
  return (sum + std::sqrt(sum * sum - 3 * (a * a + b * b + c * c - h * h))) / 3;
}

}  // namespace

void solve_eikonal(std::vector<float>& f, const std::vector<char>& fixed, const Index3& n,
                   double h) {
  constexpr double kFar = 1e30;
  constexpr int kRounds = 8;  // of all eight directions; two or three reach the end
  const std::size_t stride[3] = {static_cast<std::size_t>(n[1]) * n[2],
                                 static_cast<std::size_t>(n[2]), 1};
  std::vector<double> u(f.size());
  for (std::size_t i = 0; i < f.size(); ++i) u[i] = std::abs(f[i]);

  double change = h;
  for (int sweep = 0; sweep < 8 * kRounds && (sweep % 8 != 0 || change > 1e-6 * h); ++sweep) {
    if (sweep % 8 == 0) change = 0;
    int at[3];
    const auto along = [&](int axis, int step) {
      return sweep & (1 << axis) ? n[axis] - 1 - step : step;
    };
    for (int i = 0; i < n[0]; ++i) {
      at[0] = along(0, i);
      for (int j = 0; j < n[1]; ++j) {
        at[1] = along(1, j);
        for (int k = 0; k < n[2]; ++k) {
          at[2] = along(2, k);
          const std::size_t here = at[0] * stride[0] + at[1] * stride[1] + at[2];
          if (fixed[here]) continue;
          double least[3];
          for (int axis = 0; axis < 3; ++axis)
            least[axis] = std::min(at[axis] > 0 ? u[here - stride[axis]] : kFar,
                                   at[axis] < n[axis] - 1 ? u[here + stride[axis]] : kFar);
          const double value = upwind(least[0], least[1], least[2], h);
          if (value >= u[here]) continue;
          change = std::max(change, std::min(u[here] - value, h));
          u[here] = value;
        }
      }
    }
  }
  for (std::size_t i = 0; i < f.size(); ++i) f[i] = std::copysign(static_cast<float>(u[i]), f[i]);
}

}  // namespace gpis
