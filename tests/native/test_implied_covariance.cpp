// The implied covariance of every sampler for every kernel it serves, without noise: on its way
// through space a line is a linear map of the normals that it draws, values = mean + B ξ, so that
// its covariance is B Bᵀ. B is solved from a few rays whose ξ are read off a copy of their
// generator; the rays go the way that a render's go, and the same equations prove that the map is
// linear.
#include <Eigen/Dense>

#include "check.h"
#include "field/constant_field.h"
#include "field/tensor_grid_field.h"
#include "kernel/locally_periodic.h"
#include "kernel/plane_wave.h"
#include "kernel/product_kernel.h"
#include "kernel/scaled_kernel.h"
#include "kernel/stationary_kernel.h"
#include "kernel/sum_kernel.h"
#include "process/covariance.h"
#include "process/plan.h"
#include "process/surface.h"

namespace gpis {
namespace {

constexpr double kLevel = 7;           // the mean, in deviations: no ray hits
constexpr double kMissedRoot = 1e-16;  // and nothing is certainly absent there
const Affine kHere{{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, {}};
const std::vector<double> kTimes{0.02, 0.3, 0.55, 0.9, 1.4, 1.95, 2.3, 2.6};

template <class K, class... Args>
KernelPtr make(Args&&... args) {
  return std::make_shared<K>(std::forward<Args>(args)...);
}

GaussianProcess process(KernelPtr kernel, TensorFieldPtr anisotropy = nullptr) {
  GaussianProcess out;
  out.sigma = std::make_shared<ConstantField>(1.0);
  out.mean = std::make_shared<ConstantField>(kLevel * std::sqrt(kernel->variance()));
  out.kernel = std::move(kernel);
  out.anisotropy = std::move(anisotropy);
  out.bounds = Box3{{-2, -2, -2}, {8, 4, 4}};
  return out;
}

// Of all values and of the start, rows and columns (g, ∇g at the origin), then g at the times.
Eigen::MatrixXd exact(const GaussianProcess& gp, const Vec3& direction) {
  const Covariance covariance(gp);
  const LocalPoint zero = covariance.at({});
  const auto n = static_cast<Eigen::Index>(kTimes.size());
  Eigen::MatrixXd all(4 + n, 4 + n);
  all.topLeftCorner<4, 4>() = covariance.block(zero, zero);
  for (Eigen::Index i = 0; i < n; ++i) {
    const LocalPoint x = covariance.at(direction * kTimes[i]);
    all.block<4, 1>(0, 4 + i) = covariance.cross(zero, x, {});
    all.block<1, 4>(4 + i, 0) = all.block<4, 1>(0, 4 + i).transpose();
    for (Eigen::Index j = 0; j < n; ++j)
      all(4 + i, 4 + j) = covariance.value(x, covariance.at(direction * kTimes[j]));
  }
  return all;
}

struct Implied {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double not_linear = 0;  // largest residual of the equations
  double stated = 0;      // what the sampler says of its correlation
};

Implied implied(const GaussianProcess& gp, Sampler sampler, const Vec3& direction,
                const State* known) {
  const ProcessSurface surface(std::make_shared<GaussianProcess>(gp), kHere, Memory{}, sampler,
                               kMissedRoot);
  const double deviation = std::sqrt(gp.kernel->variance());
  const auto values_of = [&](std::uint64_t ray, Eigen::VectorXd& values, Counters& counters) {
    Line line;
    Rng rng(3, ray);
    const Start start = surface.start_from(known);
    const double t =
        surface.first_hit(line, {{}, direction}, kTimes.back() + 0.05, start, rng, counters);
    bool good = !(t < kInfinity) && counters.truncated_normals == 0;
    values.resize(static_cast<Eigen::Index>(kTimes.size()));
    for (std::size_t i = 0; i < kTimes.size() && good; ++i) {
      good = surface.sampled_at(line, kTimes[i]);
      if (good)
        values[static_cast<Eigen::Index>(i)] =
            surface.value(line, kTimes[i], rng) - kLevel * deviation;
    }
    return good;
  };
  // Bridges draw in value(), and count it where the march's counters are.
  Counters first;
  Eigen::VectorXd values;
  values_of(0, values, first);
  const auto normals = static_cast<Eigen::Index>(first.line_normals) + 16;
  const Eigen::Index rays = normals + 1 + 24;
  Eigen::MatrixXd drawn(rays, normals + 1), seen(rays, kTimes.size());
  Eigen::Index row = 0;
  for (std::uint64_t ray = 1; row < rays && ray < 3 * static_cast<std::uint64_t>(rays); ++ray) {
    Counters counters;
    if (!values_of(ray, values, counters)) continue;
    Rng same(3, ray);
    drawn(row, 0) = 1;
    for (Eigen::Index i = 1; i <= normals; ++i) drawn(row, i) = same.normal();
    seen.row(row++) = values.transpose();
  }
  CHECK(row, ==, rays);
  const Eigen::MatrixXd map = drawn.colPivHouseholderQr().solve(seen);
  Implied out;
  out.not_linear = (drawn * map - seen).cwiseAbs().maxCoeff();
  out.mean = map.row(0).transpose();
  const Eigen::MatrixXd b = map.bottomRows(normals);
  out.covariance = b.transpose() * b;
  out.stated = surface.planned().line_sampler->correlation_error();
  return out;
}

// Of (g, ∇g) at the origin given nothing, or given all four.
struct Law {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

Law law(const Eigen::MatrixXd& joint, const Eigen::Vector4d* known) {
  const Eigen::Index n = joint.rows() - 4;
  Law out{Eigen::VectorXd::Zero(n), joint.bottomRightCorner(n, n)};
  if (!known) return out;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(joint.topLeftCorner<4, 4>());
  Eigen::Vector4d inverse = eigen.eigenvalues();
  // A direction in which g is constant is known already.
  for (double& v : inverse) v = v > 1e-9 * eigen.eigenvalues().maxCoeff() ? 1 / v : 0;
  const Eigen::MatrixXd weights = joint.bottomLeftCorner(n, 4) * eigen.eigenvectors() *
                                  inverse.asDiagonal() * eigen.eigenvectors().transpose();
  out.mean = weights * *known;
  out.covariance -= weights * joint.topRightCorner(4, n);
  return out;
}

// Errors of mean and covariance in units of the prior's deviation: the free line's is what the plan
// states, from a known start they may be a few times that.
void check(const GaussianProcess& gp, Sampler sampler, bool from_a_surface) {
  const Vec3 direction = normalize({0.96, 0.28, 0.1});
  const Eigen::MatrixXd joint = exact(gp, direction);
  const double variance = gp.kernel->variance();
  // A start that the process may have: a gradient along no direction in which g is constant.
  const Eigen::Vector4d known = joint.topLeftCorner<4, 4>() * Eigen::Vector4d(0.4, 0.3, -0.5, 0.2);
  const State state{kLevel * std::sqrt(variance) + known[0], {known[1], known[2], known[3]}};
  const Implied got = implied(gp, sampler, direction, from_a_surface ? &state : nullptr);
  const Law expected = law(joint, from_a_surface ? &known : nullptr);
  const double most = (from_a_surface ? 4 : 1.05) * got.stated + 1e-9;
  CHECK(got.not_linear, <, 1e-6);
  CHECK((got.mean - expected.mean).cwiseAbs().maxCoeff() / std::sqrt(variance), <, most);
  CHECK((got.covariance - expected.covariance).cwiseAbs().maxCoeff() / variance, <, most);
  CHECK(got.stated, <, sampler == Sampler::nystrom ? 3e-3 : 1e-3);
}

struct Case {
  KernelPtr kernel;
  std::vector<Sampler> samplers;
};

using enum Sampler;
const char* const kNames[] = {"auto", "convolution", "markov", "spectral", "nystrom", "dense"};

std::vector<Case> cases() {
  const LengthScales turned({0.7, 1.3, 0.9}, {0.9, 0.3, -0.2, 0.1});
  const LengthScales flat({0.7, 1.1, kInfinity}, {0.9, 0.3, -0.2, 0.1});
  const KernelPtr se = make<SquaredExponential>(turned), rough = make<Matern>(1.5, turned);
  const KernelPtr wave = make<PlaneWave>(Vec3{2, -1, 1.5});
  const KernelPtr rq = make<RationalQuadratic>(0.7, turned);
  return {
      {se, {automatic, convolution, spectral, nystrom, dense}},
      {make<SquaredExponential>(flat), {automatic, convolution, spectral, nystrom, dense}},
      {make<ScaledKernel>(1.7, se), {automatic, convolution, spectral, nystrom, dense}},
      {rq, {automatic, spectral, nystrom, dense}},
      {make<RationalQuadratic>(2.0, flat), {automatic, spectral, nystrom, dense}},
      {make<LocallyPeriodic>(turned, 1.5, Vec3{0.6, 0.8, 0}, 1.1),
       {automatic, spectral, nystrom, dense}},
      {wave, {automatic, spectral, nystrom, dense}},
      {make<ProductKernel>(rq, wave), {automatic, spectral, nystrom, dense}},
      {make<SumKernel>(make<ScaledKernel>(0.5, se), make<RationalQuadratic>(1.0, 0.8)),
       {automatic, spectral, nystrom, dense}},
      {rough, {automatic, markov, dense}},
      {make<Matern>(2.5, turned), {automatic, markov, dense}},
      {make<Matern>(2.5, flat), {automatic, markov, dense}},
      {make<Wong>(turned), {automatic, markov, dense}},
      {make<SumKernel>(make<ScaledKernel>(0.6, se), make<ScaledKernel>(0.4, rough)),
       {automatic, markov, dense}},
      {make<SumKernel>(make<Wong>(0.8), make<ScaledKernel>(0.5, make<Matern>(2.5, 1.1))),
       {automatic, markov, dense}},
      {make<ProductKernel>(make<Matern>(2.5, 1.0), make<SquaredExponential>(2.0)),
       {automatic, dense}},
  };
}

// A grid that varies along x alone, as tests/tensor_grids.py has it.
TensorFieldPtr along_x(const std::function<SymMat3(double)>& at, int nodes) {
  const double voxel = 10.0 / (nodes - 1);
  TensorGridField::Bricks bricks;
  for (int e = 0; e < 6; ++e)
    bricks[e] = std::make_shared<BrickGrid>(Index3{nodes, 2, 2}, [&](int i, int, int) {
      return static_cast<float>(at(-2 + i * voxel)[e]);
    });
  return std::make_shared<TensorGridField>(
      bricks, Affine{{Vec3{voxel, 0, 0}, Vec3{0, 10, 0}, Vec3{0, 0, 10}}, {-2, -5, -5}},
      [](const Index3&) { return std::string("node"); });
}

SymMat3 isotropic(double length) {
  return SymMat3::identity(length * length);
}

SymMat3 rotating(double x) {
  const double c = std::cos(x * kPi / 6), s = std::sin(x * kPi / 6), a = 3, b = 1.0 / 3;
  return {c * c * a + s * s * b, s * s * a + c * c * b, 1, c * s * (a - b), 0, 0};
}

double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

}  // namespace

TEST(implied_covariance_of_stationary_lines) {
  for (const Case& c : cases())
    for (const Sampler sampler : c.samplers)
      for (const bool start : {false, true}) {
        test::context() = c.kernel->describe() + ", " + kNames[static_cast<int>(sampler)];
        check(process(c.kernel), sampler, start);
      }
  test::context().clear();
}

TEST(implied_covariance_of_varying_length_scales) {
  const std::pair<const char*, TensorFieldPtr> fields[] = {
      {"e^{x/4}", along_x([](double x) { return isotropic(std::exp(0.25 * x)); }, 97)},
      {"4 within 1",
       along_x([](double x) { return isotropic(std::pow(4, smooth_step(x - 2))); }, 641)},
      {"rotating 3:1", along_x(rotating, 97)},
  };
  const KernelPtr kernels[] = {make<SquaredExponential>(1.0), make<RationalQuadratic>(1.0, 1.0),
                               make<Matern>(1.5, 1.0), make<Matern>(2.5, 1.0), make<Wong>(1.0)};
  for (const auto& [name, field] : fields)
    for (const KernelPtr& kernel : kernels)
      for (const bool start : {false, true}) {
        test::context() = kernel->describe() + ", " + name;
        check(process(kernel, field), automatic, start);
      }
  test::context().clear();
}

}  // namespace gpis
