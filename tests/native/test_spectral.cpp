// The spectral path against the kernel it was planned for: joint law of value and gradient at two
// points of a line, free and with memory, through the path's own methods.
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "check.h"
#include "kernel/locally_periodic.h"
#include "kernel/plane_wave.h"
#include "kernel/product_kernel.h"
#include "kernel/scaled_kernel.h"
#include "kernel/stationary_kernel.h"
#include "kernel/sum_kernel.h"
#include "process/spectral_path.h"

namespace gpis {
namespace {

constexpr double kZ = 6.109;  // two-sided significance of 1e-9 for one comparison

template <class K, class... Args>
KernelPtr make(Args&&... args) {
  return std::make_shared<K>(std::forward<Args>(args)...);
}

std::vector<KernelPtr> kernels() {
  const LengthScales turned({0.5, 1, 2}, {0.9, 0.3, -0.2, 0.1});
  const Vec3 axis{0.6, 0, 0.8};
  const KernelPtr se = make<SquaredExponential>(turned), wave = make<PlaneWave>(Vec3{2, -1, 3});
  const KernelPtr periodic = make<LocallyPeriodic>(turned, 0.8, axis, 0.7);
  return {se,
          make<RationalQuadratic>(0.3, turned),
          make<RationalQuadratic>(0.5, turned),
          make<RationalQuadratic>(1.0, turned),
          make<RationalQuadratic>(2.0, turned),
          periodic,
          wave,
          make<SquaredExponential>(LengthScales({0.5, 1, kInfinity}, {0.9, 0.3, -0.2, 0.1})),
          make<ScaledKernel>(0.3, make<SumKernel>(periodic, make<RationalQuadratic>(1.0, 0.7))),
          make<ProductKernel>(make<SquaredExponential>(1.0), se),
          make<ProductKernel>(wave, make<RationalQuadratic>(0.5, turned)),
          make<SumKernel>(wave, make<SquaredExponential>(Vec3{1, kInfinity, kInfinity}))};
}

// Covariance of (g, ∇g) at 0 and at r: cov(g(x), ∂g(y)) = -∂k, cov(∂g(x), g(y)) = ∂k.
Eigen::Matrix<double, 8, 8> joint_covariance(const Kernel& k, const Vec3& r) {
  const auto block = [&](const Vec3& lag) {
    Eigen::Matrix4d b;
    const Vec3 slope = k.gradient(lag);
    const Mat3 mixed = k.mixed(lag);
    b(0, 0) = k.covariance(lag);
    for (int i = 0; i < 3; ++i) {
      b(0, i + 1) = -slope[i];
      b(i + 1, 0) = slope[i];
      for (int j = 0; j < 3; ++j) b(i + 1, j + 1) = mixed.row[i][j];
    }
    return b;
  };
  Eigen::Matrix<double, 8, 8> c;
  c << block({}), block(-r), block(r), block({});
  return c;
}

struct Moments {
  explicit Moments(int n) : sum(Eigen::MatrixXd::Zero(n, n)) {}
  Eigen::MatrixXd sum;
  long count = 0;

  void add(const Eigen::VectorXd& v) {
    sum += v * v.transpose();
    ++count;
  }
  // Largest z against a covariance; `stated` is what the path says that it is off by.
  double worst(const Eigen::MatrixXd& covariance, double stated) const {
    double worst = 0;
    for (int i = 0; i < sum.rows(); ++i)
      for (int j = 0; j <= i; ++j) {
        const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
        const double error =
            std::sqrt((scale * scale + covariance(i, j) * covariance(i, j)) / count) + 1e-12;
        const double off = std::abs(sum(i, j) / count - covariance(i, j)) - stated * scale;
        worst = std::max(worst, off / error);
      }
    return worst;
  }
};

const Box3 kBounds{{-3, -3, -3}, {3, 3, 3}};
// Of slopes and gradients, 1e-4 of the variance more than what is said of values.
constexpr double kStatedSlopes = 1e-4;

Eigen::Vector4d with_gradient(double g, const Vec3& gradient) {
  return {g, gradient.x, gradient.y, gradient.z};
}

}  // namespace

TEST(spectral_value_and_gradient_with_memory) {
  // (g, ∇g) at the anchor from the prior, then the path: the eight together follow the kernel.
  const Vec3 direction{0.4, -1.1, 0.5};  // not of unit length
  for (const KernelPtr& kernel : kernels()) {
    test::context() = kernel->describe();
    const SpectralPath::Plan plan(*kernel->terms(), kBounds);
    const Eigen::Matrix4d start = joint_covariance(*kernel, {}).topLeftCorner<4, 4>();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(start);
    // Eigenvalues of rounding are 0: a direction in which g is constant.
    Eigen::Vector4d spread = eigen.eigenvalues();
    const double largest = spread.maxCoeff();
    for (double& v : spread) v = v > 1e-12 * largest ? std::sqrt(v) : 0;
    const Eigen::Matrix4d factor = eigen.eigenvectors() * spread.asDiagonal();
    for (const double t : {0.6, 2.9}) {
      Moments moments(8);
      SpectralPath path;
      Counters counters;
      double slope_error = 0;
      for (int n = 0; n < 10'000; ++n) {
        Rng rng(11, n);
        Eigen::Vector4d xi;
        for (double& x : xi) x = rng.normal();
        const Eigen::Vector4d known = factor * xi;
        path.reset(plan, {{1, 2, 3}, direction}, 0.5, 4.5, counters);
        PathStart begin;
        begin.value = known[0];
        begin.slope_known = begin.gradient_known = true;
        begin.gradient = {known[1], known[2], known[3]};
        begin.slope = dot(direction, begin.gradient);
        const double slope = path.start(begin, rng, counters);
        slope_error = std::max(slope_error, std::abs(slope - begin.slope));
        for (long cell = 0; 0.5 + cell * path.step() <= t + 0.5; ++cell)
          path.prepare(cell, rng, counters);
        double g, dg;
        path.at(0, t + 0.5, rng, g, dg);
        const PathGradient law = path.gradient(t + 0.5, g, dg, rng);
        const Vec3 gradient = law.mean + law.b1 * rng.normal() + law.b2 * rng.normal();
        slope_error = std::max(slope_error, std::abs(dot(gradient, direction) - dg));
        Eigen::VectorXd all(8);
        all << known, with_gradient(g, gradient);
        moments.add(all);
      }
      CHECK(moments.worst(joint_covariance(*kernel, direction * t),
                          plan.correlation_error + kStatedSlopes),
            <, kZ);
      CHECK(slope_error, <, 1e-9);
    }
  }
  test::context().clear();
}

TEST(spectral_value_and_gradient_without_memory) {
  // g and its slope at the anchor, g and ∇g further on; the transverse gradient is drawn at the hit
  // alone, so that of the anchor takes no part.
  const Vec3 direction{0.5, 0.5, 0.7};
  for (const KernelPtr& kernel : kernels()) {
    test::context() = kernel->describe();
    const SpectralPath::Plan plan(*kernel->terms(), kBounds);
    for (const double t : {0.3, 2.2}) {
      const Eigen::Matrix<double, 8, 8> joint = joint_covariance(*kernel, direction * t);
      Eigen::Matrix<double, 6, 8> pick = Eigen::Matrix<double, 6, 8>::Zero();
      pick(0, 0) = 1;
      for (int i = 0; i < 3; ++i) pick(1, i + 1) = direction[i];
      for (int i = 0; i < 4; ++i) pick(i + 2, i + 4) = 1;
      Moments moments(6);
      SpectralPath path;
      Counters counters;
      for (int n = 0; n < 10'000; ++n) {
        Rng rng(12, n);
        path.reset(plan, {{}, direction}, 0, 3, counters);
        double g0, dg0, g, dg;
        path.start_free(rng, counters, g0, dg0);
        // A gap: cells that nobody asked for are never drawn.
        if (std::isfinite(path.step()))
          path.prepare(static_cast<long>(t / path.step()), rng, counters);
        path.at(0, t, rng, g, dg);
        const PathGradient law = path.gradient(t, g, dg, rng);
        Eigen::VectorXd all(6);
        all << g0, dg0, with_gradient(g, law.mean + law.b1 * rng.normal() + law.b2 * rng.normal());
        moments.add(all);
      }
      CHECK(moments.worst(pick * joint * pick.transpose(), plan.correlation_error + kStatedSlopes),
            <, kZ);
    }
  }
  test::context().clear();
}

TEST(spectral_path_is_one_function) {
  // Ends of cells, points between them and slopes belong together, also after a gap; a start is
  // kept exactly.
  for (const KernelPtr& kernel : kernels()) {
    test::context() = kernel->describe();
    const SpectralPath::Plan plan(*kernel->terms(), kBounds);
    SpectralPath path;
    Counters counters;
    Rng rng(13, 1);
    path.reset(plan, {{}, {0.8, 0, -0.7}}, 0.25, 3, counters);
    PathStart known;
    known.value = 1.5;
    known.slope_known = true;
    known.slope = 0.75;
    CHECK(std::abs(path.start(known, rng, counters) - 0.75), <, 1e-12);
    double g, dg, right, dright;
    path.at(0, 0.25, rng, g, dg);
    CHECK(std::abs(g - 1.5), <, 1e-12);
    if (!std::isfinite(path.step())) continue;
    path.at(0, 0.25, rng, right, dright);
    long last = -1;
    for (const long cell : {0, 1, 2, 40, 41}) {
      path.prepare(cell, rng, counters);
      const double a = 0.25 + cell * path.step(), b = a + path.step();
      if (cell == last + 1) {  // where the cell before ended
        path.at(cell, a, rng, g, dg);
        CHECK(std::abs(g - right) + std::abs(dg - dright), <, 1e-10);
      }
      last = cell;
      path.at_right(cell, right, dright);
      path.at(cell, b, rng, g, dg);
      CHECK(std::abs(g - right) + std::abs(dg - dright), <, 1e-10);
      double before, after, slope;
      path.at(cell, a + 0.3 * path.step() - 1e-5, rng, before, slope);
      path.at(cell, a + 0.3 * path.step() + 1e-5, rng, after, slope);
      path.at(cell, a + 0.3 * path.step(), rng, g, dg);
      CHECK(std::abs((after - before) / 2e-5 - dg), <, 1e-6 * (1 + std::abs(dg)));
    }
  }
  test::context().clear();
}

TEST(spectral_pull_bounds_the_conditional_mean) {
  for (const KernelPtr& kernel : kernels()) {
    test::context() = kernel->describe();
    const SpectralPath::Plan plan(*kernel->terms(), kBounds);
    SpectralPath path;
    Counters counters;
    const Vec3 d{0.1, 0.9, -0.3};
    for (const double value : {2.0, -2.0})
      for (const double slope : {3.0, -3.0}) {
        Rng rng(14, 1);
        path.reset(plan, {{}, d}, 0, 6, counters);
        PathStart known;
        known.value = value;
        known.slope_known = true;
        known.slope = slope;
        path.start(known, rng, counters);
        if (!std::isfinite(path.step())) continue;
        const double slope_variance = kernel->derivative_variance(d);
        const auto mean = [&](double t) {
          return kernel->covariance(d * t) * value / kernel->variance() -
                 dot(kernel->gradient(d * t), d) * slope / slope_variance;
        };
        for (long cell = 0; cell * path.step() < 4; ++cell) {
          path.prepare(cell, rng, counters);
          double lowest = 0;
          for (double t = cell * path.step(); t < 8; t += 0.02) lowest = std::min(lowest, mean(t));
          CHECK(path.pull(cell * path.step()), >, -lowest - 1e-3);
        }
      }
  }
  test::context().clear();
}

TEST(spectra_add_up_to_the_correlation) {
  // What a table certifies, by another sum at other lags, and the variance of slopes; a longer line
  // takes more frequencies, a rough kernel is refused.
  std::vector<Radial> radials{{Radial::Family::squared_exponential}};
  for (const double alpha : {0.3, 0.5, 1.0, 2.0, 50.0, 1e5})
    radials.push_back({Radial::Family::rational_quadratic, alpha});
  for (const Radial& radial : radials) {
    std::size_t before = 0;
    for (const double reach : {8.0, 64.0}) {
      const LineSpectrum s = line_spectrum(radial, reach).value();
      test::context() = "alpha " + std::to_string(radial.alpha);
      CHECK(s.error, <, 3.01e-5);
      CHECK(s.weight.size(), >, before);
      before = s.weight.size();
      double slopes = 0;
      for (int lag = 0; lag < 1000; ++lag) {
        const double q = reach * std::pow(lag / 999.0, 2);
        double sum = 0;
        for (std::size_t i = 0; i < s.weight.size(); ++i)
          sum += s.weight[i] * std::cos(s.frequency[i] * q);
        CHECK(std::abs(sum - radial.value(q)), <, 1.05 * s.error + 1e-12);
      }
      for (std::size_t i = 0; i < s.weight.size(); ++i)
        slopes += s.weight[i] * s.frequency[i] * s.frequency[i];
      CHECK(std::abs(slopes - 1), <, 1e-4);
    }
  }
  test::context().clear();
  bool refused = false;
  try {
    line_spectrum({Radial::Family::matern32}, 8);
  } catch (const std::invalid_argument&) {
    refused = true;
  }
  CHECK(refused, ==, true);
  // Too many frequencies for one line: the caller says so, or makes do with a shorter table.
  CHECK(line_spectrum(radials[0], 1e5).has_value(), ==, false);
}

}  // namespace gpis
