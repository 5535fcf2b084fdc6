// The implied covariance of every sampler for every kernel it serves, without noise: on its way
// through space a line is a linear map of the normals that it draws, values = mean + B ξ, so that
// its covariance is B Bᵀ. B is solved from a few rays whose ξ are read off a copy of their
// generator (of a realisation: off the lattice that its first number is the seed of); the rays go
// the way that a render's go, and the same equations prove that the map is linear.
#include <Eigen/Dense>

#include "check.h"
#include "field/constant_field.h"
#include "kernel/locally_periodic.h"
#include "kernel/plane_wave.h"
#include "kernel/product_kernel.h"
#include "kernel/scaled_kernel.h"
#include "kernel/stationary_kernel.h"
#include "kernel/sum_kernel.h"
#include "process/covariance.h"
#include "process/lattice_noise.h"
#include "process/plan.h"
#include "process/surface.h"
#include "varying_fields.h"

namespace gpis {
namespace {

constexpr double kLevel = 7;           // the mean, in deviations: no ray hits
constexpr double kMissedRoot = 1e-16;  // and nothing is certainly absent there
const Affine kHere{{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, {}};
using Times = std::vector<double>;
const Times kTimes{0.02, 0.3, 0.55, 0.9, 1.4, 1.95, 2.3, 2.6};
const Times kLong{0.3, 1.1, 2.4, 3.3, 4.9, 6.0};  // up to 8 length scales

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
Eigen::MatrixXd exact(const GaussianProcess& gp, const Vec3& direction, const Times& times) {
  const Covariance covariance(gp);
  const LocalPoint zero = covariance.at({});
  const auto n = static_cast<Eigen::Index>(times.size());
  Eigen::MatrixXd all(4 + n, 4 + n);
  all.topLeftCorner<4, 4>() = covariance.block(zero, zero);
  for (Eigen::Index i = 0; i < n; ++i) {
    const LocalPoint x = covariance.at(direction * times[i]);
    all.block<4, 1>(0, 4 + i) = covariance.cross(zero, x, {});
    all.block<1, 4>(4 + i, 0) = all.block<4, 1>(0, 4 + i).transpose();
    for (Eigen::Index j = 0; j < n; ++j)
      all(4 + i, 4 + j) = covariance.value(x, covariance.at(direction * times[j]));
  }
  return all;
}

struct Implied {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double not_linear = 0;  // largest residual of the equations
  double stated = 0;      // what the sampler says of its correlation
};

// The normals of the one lattice that a flat kernel's realisation of this seed has, as far as lines
// of `times` reach it: a line of nodes, or a square of them.
std::vector<double> lattice_normals(const GaussianProcess& gp, std::uint64_t seed,
                                    const Vec3& direction, double end) {
  const Mat3 whitening = gp.kernel->terms()->front().whitening;
  const Mat3 inverse_a = transpose(whitening) * whitening;
  const bool line = length(cross(inverse_a * Vec3{1, 0, 0}, inverse_a * Vec3{0, 1, 0})) < 1e-12;
  const int reach = static_cast<int>(2 * end * length(whitening * direction)) + 9;
  const int side = 2 * reach + 1;
  LatticeNoise noise({{3, 3, 3}, 1});
  noise.reset(seed, std::nullopt);
  std::vector<double> normals(line ? side : side * side);
  noise.window(0, line ? 6u : 4u, {-reach, line ? 0 : -reach, 0}, {side, line ? 1 : side, 1},
               normals.data());
  return normals;
}

Implied implied(const GaussianProcess& gp, Sampler sampler, const Vec3& direction,
                const State* known, const Times& times) {
  const ProcessSurface surface(std::make_shared<GaussianProcess>(gp), kHere, Memory{}, sampler,
                               kMissedRoot);
  const double deviation = std::sqrt(gp.kernel->variance());
  const auto values_of = [&](std::uint64_t ray, Eigen::VectorXd& values, Counters& counters) {
    Line line;
    Rng rng(3, ray);
    const Start start = surface.start_from(known);
    const double t =
        surface.first_hit(line, {{}, direction}, times.back() + 0.05, start, rng, counters);
    bool good = !(t < kInfinity) && counters.truncated_normals == 0;
    values.resize(static_cast<Eigen::Index>(times.size()));
    for (std::size_t i = 0; i < times.size() && good; ++i) {
      good = surface.sampled_at(line, times[i]);
      if (good)
        values[static_cast<Eigen::Index>(i)] =
            surface.value(line, times[i], rng) - kLevel * deviation;
    }
    return good;
  };
  // Bridges draw in value(), and count it where the march's counters are.
  Counters first;
  Eigen::VectorXd values;
  values_of(0, values, first);
  const auto drawn_by = [&](std::uint64_t ray, Eigen::Index count) {
    Rng same(3, ray);
    if (sampler == Sampler::realisation)
      return lattice_normals(gp, same(), direction, times.back());
    std::vector<double> out(count);
    for (double& v : out) v = same.normal();
    return out;
  };
  const auto normals = static_cast<Eigen::Index>(
      drawn_by(0, static_cast<Eigen::Index>(first.line_normals) + 16).size());
  const Eigen::Index rays = normals + 1 + 24;
  Eigen::MatrixXd drawn(rays, normals + 1), seen(rays, times.size());
  Eigen::Index row = 0;
  for (std::uint64_t ray = 1; row < rays && ray < 3 * static_cast<std::uint64_t>(rays); ++ray) {
    Counters counters;
    if (!values_of(ray, values, counters)) continue;
    const std::vector<double> xi = drawn_by(ray, normals);
    drawn(row, 0) = 1;
    for (Eigen::Index i = 1; i <= normals; ++i) drawn(row, i) = xi[i - 1];
    seen.row(row++) = values.transpose();
  }
  CHECK(row, ==, rays);
  const Eigen::MatrixXd map = drawn.householderQr().solve(seen);
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

// Errors of mean and covariance in units of the prior's deviation are what the plan states, from a
// known start too (the solve that conditions on it turns 1e-7 into a few times that).
void check(const GaussianProcess& gp, Sampler sampler, bool from_a_surface,
           const Times& times = kTimes) {
  const Vec3 direction = normalize({0.96, 0.28, 0.1});
  const Eigen::MatrixXd joint = exact(gp, direction, times);
  const double variance = gp.kernel->variance();
  // A start that the process may have: a gradient along no direction in which g is constant.
  const Eigen::Vector4d known = joint.topLeftCorner<4, 4>() * Eigen::Vector4d(0.4, 0.3, -0.5, 0.2);
  const State state{kLevel * std::sqrt(variance) + known[0], {known[1], known[2], known[3]}};
  const Implied got = implied(gp, sampler, direction, from_a_surface ? &state : nullptr, times);
  const Law expected = law(joint, from_a_surface ? &known : nullptr);
  const double most = 1.05 * got.stated + (from_a_surface ? 1e-6 : 1e-9);
  CHECK(got.not_linear, <, 2e-5);  // rounding, by the weights of rows that all but follow
  CHECK((got.mean - expected.mean).cwiseAbs().maxCoeff() / std::sqrt(variance), <, most);
  CHECK((got.covariance - expected.covariance).cwiseAbs().maxCoeff() / variance, <, most);
  CHECK(got.stated, <, sampler == Sampler::nystrom ? 3e-3 : 1e-3);
}

struct Case {
  KernelPtr kernel;
  std::vector<Sampler> samplers;
};

using enum Sampler;
const char* const kNames[] = {"auto",    "convolution", "markov",     "spectral",
                              "nystrom", "dense",       "realisation"};

std::vector<Case> cases() {
  const LengthScales turned({0.7, 1.3, 0.9}, {0.9, 0.3, -0.2, 0.1});
  const LengthScales flat({0.7, 1.1, kInfinity}, {0.9, 0.3, -0.2, 0.1});
  const KernelPtr waves = make<SquaredExponential>(LengthScales({0.7, kInfinity, kInfinity}));
  const KernelPtr se = make<SquaredExponential>(turned), rough = make<Matern>(1.5, turned);
  const KernelPtr wave = make<PlaneWave>(Vec3{2, -1, 1.5});
  const KernelPtr rq = make<RationalQuadratic>(0.7, turned);
  return {
      {se, {automatic, convolution, spectral, nystrom, dense}},
      {make<SquaredExponential>(flat),
       {automatic, convolution, spectral, nystrom, dense, realisation}},
      {make<ScaledKernel>(0.6, waves), {automatic, convolution, nystrom, realisation}},
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
      // Of many turns per length scale.
      {make<ProductKernel>(make<Matern>(2.5, 5.0), make<PlaneWave>(Vec3{20, 0, 0})), {automatic}},
      {make<SumKernel>(make<ScaledKernel>(0.5, make<PlaneWave>(Vec3{30, 0, 0})),
                       make<ScaledKernel>(0.5, make<SquaredExponential>(0.5))),
       {automatic, nystrom}},
  };
}

// Length scales that grow, step and turn.
std::vector<std::pair<const char*, TensorFieldPtr>> fields() {
  return {{"e^{x/4}", test::along_x(test::growing, 97)},
          {"4 within 1", test::along_x(test::stepping, 641)},
          {"rotating 3:1", test::along_x(test::rotating, 97)}};
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

// Nothing is forgotten, and nothing repeats, over many length scales.
TEST(implied_covariance_over_long_distances) {
  const KernelPtr se = make<SquaredExponential>(0.75), rough = make<Matern>(1.5, 0.75);
  const KernelPtr wave = make<LocallyPeriodic>(2.0, 1.5, Vec3{0.6, 0.8, 0}, 1.1);
  const KernelPtr waves = make<SquaredExponential>(LengthScales({0.75, kInfinity, kInfinity}));
  const Case cases[] = {
      {se, {automatic, convolution, spectral, nystrom, dense}},
      {rough, {automatic, markov, dense}},
      {make<SumKernel>(make<ScaledKernel>(0.6, se), make<ScaledKernel>(0.4, rough)), {automatic}},
      {wave, {automatic, spectral, nystrom, dense}},
      {make<RationalQuadratic>(0.7, 0.75), {automatic, spectral, nystrom, dense}},
      {waves, {realisation}},
  };
  for (const Case& c : cases)
    for (const Sampler sampler : c.samplers)
      for (const bool start : {false, true}) {
        test::context() = c.kernel->describe() + ", " + kNames[static_cast<int>(sampler)];
        check(process(c.kernel), sampler, start, kLong);
      }
  const KernelPtr periodic = make<ProductKernel>(
      make<LocallyPeriodic>(5.0, 1.8, Vec3{1, 0, 0}, 0.6), make<Matern>(2.5, 5.0));
  test::context() = periodic->describe();  // more rows than a line keeps
  check(process(periodic), automatic, false, kLong);
  for (const auto& [name, field] : fields()) {
    test::context() = std::string("long, ") + name;
    check(process(make<SquaredExponential>(1.0), field), automatic, false, kLong);
  }
  test::context().clear();
}

TEST(implied_covariance_of_varying_length_scales) {
  const KernelPtr kernels[] = {make<SquaredExponential>(1.0), make<RationalQuadratic>(1.0, 1.0),
                               make<Matern>(1.5, 1.0), make<Matern>(2.5, 1.0), make<Wong>(1.0)};
  for (const auto& [name, field] : fields())
    for (const KernelPtr& kernel : kernels)
      for (const bool start : {false, true}) {
        test::context() = kernel->describe() + ", " + name;
        check(process(kernel, field), automatic, start);
      }
  // Bridges are drawn where the march asks for them, in the order in which it does: along a crease
  // not the same for all rays (tests/native/test_joint.py has those).
  const auto crease = test::along_x(test::crease, 101), dab = test::along_x(test::dab, 201);
  for (const auto& [kernel, field] : {std::pair{kernels[0], crease},
                                      {kernels[3], crease},
                                      {kernels[1], dab},
                                      {kernels[2], dab},
                                      {kernels[3], dab}}) {
    test::context() = kernel->describe() + (field == dab ? ", dab" : ", crease");
    check(process(kernel, field), automatic, field == crease);
  }
  test::context().clear();
}

}  // namespace gpis
