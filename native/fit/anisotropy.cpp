#include "fit/anisotropy.h"

#include <atomic>

#include "core/symmetric_eigen.h"

namespace gpis {
namespace {

// The most that the term of varying length scales may be of G, by the trace of their quotient.
constexpr double kMostChange = 0.75;
// The term depends on A itself: A of the round before.
constexpr int kRounds = 4;

SymMat3 at(const std::vector<float>& grid, std::size_t node) {
  SymMat3 m;
  for (int k = 0; k < 6; ++k) m[k] = grid[6 * node + k];
  return m;
}

// The inverse with square roots of eigenvalues in [shortest, longest].
SymMat3 limited_inverse(const SymMat3& p, double shortest, double longest, bool& limited) {
  const double trace = p.xx + p.yy + p.zz;
  // Both bounds hold for certain: no need of the eigenvalues.
  const double most = 1 / (shortest * shortest), least = 1 / (longest * longest);
  limited = false;
  const Cholesky3 factor(p);
  if (factor.positive && trace <= most) {
    const SymMat3 a = factor.inverse();
    if (a.xx + a.yy + a.zz <= 1 / least) return a;
  }
  const SymmetricEigen3 eigen(p);
  SymMat3 a;
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.values[k];
    const double kept = std::clamp(value, least, most);
    limited |= !(std::abs(value - kept) <= 1e-6 * kept);
    a = a + SymMat3::of(outer(eigen.vectors[k], eigen.vectors[k])) * (1 / kept);
  }
  return a;
}

}  // namespace

AnisotropyFit fit_anisotropy(
    std::vector<float>& slopes, const std::array<int, 3>& nodes, double voxel_size, double shortest,
    double longest, const std::function<void(int, const std::function<void(int)>&)>& each) {
  const std::size_t row = nodes[2], slice = row * nodes[1];
  const std::array<std::size_t, 3> stride{slice, row, 1};
  std::vector<float> a(slopes.size()), next(slopes.size());
  std::atomic<std::size_t> limited{0}, change_limited{0};
  const auto store = [&](std::vector<float>& to, std::size_t node, const SymMat3& p) {
    bool changed;
    const SymMat3 m = limited_inverse(p, shortest, longest, changed);
    for (int k = 0; k < 6; ++k) to[6 * node + k] = static_cast<float>(m[k]);
    return changed;
  };
  each(nodes[0], [&](int i) {
    for (std::size_t node = i * slice; node < (i + 1) * slice; ++node)
      store(a, node, at(slopes, node));
  });
  for (int round = 0; round < kRounds; ++round) {
    limited = change_limited = 0;
    each(nodes[0], [&](int i) {
      std::size_t clamped = 0, changes = 0;
      std::size_t node = i * slice;
      for (int j = 0; j < nodes[1]; ++j)
        for (int k = 0; k < nodes[2]; ++k, ++node) {
          const std::array<int, 3> index{i, j, k};
          const SymMat3 here = at(a, node);
          const Mat3 inverse = Cholesky3(here).inverse().matrix();
          std::array<Mat3, 3> change;  // A⁻¹∂A
          bool varies = false;
          for (int axis = 0; axis < 3; ++axis) {
            const bool low = index[axis] > 0, high = index[axis] + 1 < nodes[axis];
            const SymMat3 difference =
                at(a, high ? node + stride[axis] : node) - at(a, low ? node - stride[axis] : node);
            varies |= trace_of_product(difference, difference) > 0;
            change[axis] = inverse * difference.matrix() * (1 / (voxel_size * (low + high)));
          }
          SymMat3 g = at(slopes, node);
          if (varies) {
            const auto term = [&](int x, int y) {
              const Mat3 product = change[x] * change[y];
              return (product.row[0].x + product.row[1].y + product.row[2].z) / 8;
            };
            SymMat3 t{term(0, 0), term(1, 1), term(2, 2), term(0, 1), term(0, 2), term(1, 2)};
            const Cholesky3 factor(g);
            const double share =
                factor.positive ? trace_of_product(factor.inverse(), t) : kInfinity;
            if (share > kMostChange) {
              ++changes;
              t = t * (std::isfinite(share) ? kMostChange / share : 0.0);
            }
            g = g - t;
          }
          clamped += store(next, node, g);
        }
      limited += clamped;
      change_limited += changes;
    });
    a.swap(next);
  }
  slopes.swap(a);
  return {limited, change_limited};
}

}  // namespace gpis
