// Realisations in all of space. Under length scales that vary: their values are Σ w_j(x) ξ_j with
// the weights of formulas C11, written here a second time: Σ_j w_j(x) w_j(y) is the covariance of
// Paciorek and Schervish. Rows of a grid take the noise smoothed, from coarser lattices: where they
// are off by d from these sums, their covariance is by 2d at most. And lines through a realisation
// are that realisation, whatever the kernel.
#include "check.h"
#include "core/symmetric_eigen.h"
#include "field/constant_field.h"
#include "field/transformed_tensor_field.h"
#include "kernel/locally_periodic.h"
#include "kernel/plane_wave.h"
#include "kernel/product_kernel.h"
#include "kernel/scaled_kernel.h"
#include "kernel/stationary_kernel.h"
#include "kernel/sum_kernel.h"
#include "process/covariance.h"
#include "process/realisation.h"
#include "process/scale_mixture.h"
#include "process/surface.h"
#include "varying_fields.h"

namespace gpis {
namespace {

template <class K, class... Args>
KernelPtr make(Args&&... args) {
  return std::make_shared<K>(std::forward<Args>(args)...);
}

GaussianProcess process(KernelPtr kernel, TensorFieldPtr anisotropy, double mean = 0) {
  GaussianProcess out;
  out.sigma = std::make_shared<ConstantField>(1.0);
  out.mean = std::make_shared<ConstantField>(mean);
  out.kernel = std::move(kernel);
  out.anisotropy = std::move(anisotropy);
  out.bounds = Box3{{-2, -4, -4}, {8, 4, 4}};
  return out;
}

// φ_A(x - s) h^{3/2} for all nodes s = h n that matter at x.
struct Weights {
  Node first;
  std::array<int, 3> size;
  std::vector<double> w;

  Weights(const SymMat3& a, const Vec3& x, double h) {
    for (int k = 0; k < 3; ++k) {
      const double reach = std::sqrt(22 * a[k]);  // e^{-22} = 3e-10
      first[k] = static_cast<std::int64_t>(std::ceil((x[k] - reach) / h));
      size[k] = static_cast<int>(std::floor((x[k] + reach) / h)) - static_cast<int>(first[k]) + 1;
    }
    const Cholesky3 factor(a);
    const Mat3 inverse = factor.inverse().matrix();
    const double scale =
        std::pow(2 / kPi, 0.75) * std::pow(factor.determinant(), -0.25) * std::pow(h, 1.5);
    for (int k = 0; k < size[2]; ++k)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i) {
          const Vec3 u =
              x - Vec3{double(first[0] + i), double(first[1] + j), double(first[2] + k)} * h;
          w.push_back(scale * std::exp(-dot(u, inverse * u)));
        }
  }

  double times(LatticeNoise& noise, int lattice) const {
    std::vector<double> normals(w.size());
    noise.window(lattice, 0, first, size, normals.data());
    double sum = 0;
    for (std::size_t i = 0; i < w.size(); ++i) sum += w[i] * normals[i];
    return sum;
  }

  double times(const Weights& other) const {
    double sum = 0;
    for (int k = 0; k < size[2]; ++k)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i) {
          const std::int64_t a = first[0] + i - other.first[0], b = first[1] + j - other.first[1],
                             c = first[2] + k - other.first[2];
          if (a < 0 || b < 0 || c < 0 || a >= other.size[0] || b >= other.size[1] ||
              c >= other.size[2])
            continue;
          sum += w[(static_cast<std::size_t>(k) * size[1] + j) * size[0] + i] *
                 other.w[(c * other.size[1] + b) * other.size[0] + a];
        }
    return sum;
  }
};

// Apart by next to nothing, by one and by six units.
const std::vector<Vec3> kPoints{
    {-1.3, 0.2, 0.1}, {-1.2, 0.25, 0.05}, {1.9, -0.3, 0.4}, {2.6, 0.1, -0.2}, {4.6, 0.3, 0.5}};

constexpr double kOff = 3e-6;

void check(const KernelPtr& kernel, const TensorFieldPtr& field, double stated) {
  const GaussianProcess gp = process(kernel, field);
  const Covariance covariance(gp);
  const ScaleMixture mixture = scale_mixture(kernel->terms()->front().radial);
  const double shortest = std::sqrt(field->eigenvalues().min);
  Realisation realisation(gp, Realisation::Access::rays, nullptr);
  std::vector<std::vector<Weights>> parts;  // by part, by point
  std::vector<double> expected(kPoints.size() * kPoints.size());
  for (const auto& [weight, length] : mixture.parts) {
    parts.emplace_back();
    for (const Vec3& x : kPoints)
      parts.back().emplace_back(field->value(x) * (length * length), x, 0.5 * length * shortest);
  }
  Realisation rows(gp, Realisation::Access::rows, nullptr);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    realisation.draw(seed, std::nullopt);
    rows.draw(seed, std::nullopt);
    LatticeNoise noise({{3, 3, 3}, 1});
    noise.reset(seed, std::nullopt);
    for (std::size_t p = 0; p < kPoints.size(); ++p) {
      double sum = 0;
      for (std::size_t part = 0; part < parts.size(); ++part)
        sum += std::sqrt(mixture.parts[part].weight) *
               parts[part][p].times(noise, static_cast<int>(part));
      CHECK(std::abs(realisation.sample(kPoints[p]).value - sum), <, kOff);
      float row[2];
      rows.fill(kPoints[p] - Vec3{0, 0, 0.3}, 0.3, {1, 1, 2}, row);
      CHECK(std::abs(row[1] - sum), <, kOff);
    }
  }
  for (std::size_t p = 0; p < kPoints.size(); ++p)
    for (std::size_t q = p; q < kPoints.size(); ++q) {
      double implied = 0;
      for (std::size_t part = 0; part < parts.size(); ++part)
        implied += mixture.parts[part].weight * parts[part][p].times(parts[part][q]);
      const double exact = covariance.value(covariance.at(kPoints[p]), covariance.at(kPoints[q]));
      CHECK(std::abs(implied - exact) + 2 * kOff, <, stated);
    }
}

}  // namespace

TEST(realisations_under_varying_lengths_have_their_covariance) {
  const TensorFieldPtr rotating = test::along_x(test::rotating, 97);
  const std::pair<const char*, TensorFieldPtr> fields[] = {
      {"e^{x/4}", test::along_x(test::growing, 61, 5)},  // a realisation serves a ratio of 8
      {"4 within 1", test::along_x(test::stepping, 641)},
      {"rotating 3:1", rotating}};
  for (const auto& [name, field] : fields) {
    test::context() = name;
    check(make<SquaredExponential>(1.0), field, 1e-5);
  }
  test::context() = "matern 3/2, rotating";
  check(make<Matern>(1.5, 1.0), rotating, 5.1e-4);
  test::context().clear();
}

// Slopes are those of the values.
TEST(gradients_of_realisations_under_varying_lengths_are_theirs) {
  for (const auto& at : {test::growing, test::stepping, test::rotating}) {
    const TensorFieldPtr field = test::along_x(at, 97, 5);
    Realisation realisation(process(make<SquaredExponential>(1.0), field),
                            Realisation::Access::rays, nullptr);
    realisation.draw(7, std::nullopt);
    const double h = 1e-3;
    for (int i = 0; i < 40; ++i) {
      // Near the middle of a cell: ∂A jumps at its ends.
      const Vec3 x{-2 + 7.0 / 96 * (2 * i + 0.4), 0.3 * std::sin(i), 0.2 * std::cos(3 * i)};
      const FieldSample g = realisation.sample(x);
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 step;
        step[axis] = h;
        const double slope =
            (realisation.sample(x + step).value - realisation.sample(x - step).value) / (2 * h);
        CHECK(std::abs(slope - g.gradient[axis]), <, 1e-3);
      }
    }
  }
}

// What lies outside of the bounds asked for does not count.
TEST(eigenvalues_of_a_tensor_field_over_a_box) {
  const auto moved = std::make_shared<TransformedTensorField>(
      test::along_x(test::growing, 61),
      Affine{{Vec3{0.6, -1.6, 0}, Vec3{0.8, 1.2, 0}, Vec3{0, 0, -0.5}}, {1, 2, 3}});
  for (const TensorFieldPtr& field : {test::along_x(test::rotating, 97), TensorFieldPtr(moved)}) {
    const Range all = field->eigenvalues();
    Rng rng(3, 0);
    for (int n = 0; n < 100; ++n) {
      Box3 box;
      for (int corner = 0; corner < 2; ++corner)
        box.include({rng.uniform() * 14 - 4, rng.uniform() * 14 - 4, rng.uniform() * 14 - 4});
      const Range range = field->eigenvalues(box);
      CHECK(range.min, >=, all.min);
      CHECK(range.max, <=, all.max);
      for (int i = 0; i < 100; ++i) {
        const Vec3 u{rng.uniform(), rng.uniform(), rng.uniform()}, size = box.max - box.min;
        const auto e =
            eigenvalues_of(field->value(box.min + Vec3{u.x * size.x, u.y * size.y, u.z * size.z}));
        CHECK(e[0], >=, range.min * (1 - 1e-6));
        CHECK(e[2], <=, range.max * (1 + 1e-6));
      }
    }
    const Box3 everywhere{{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
    CHECK(field->eigenvalues(everywhere).min, ==, all.min);
    CHECK(field->eigenvalues(everywhere).max, ==, all.max);
  }
  const TensorFieldPtr growing = test::along_x(test::growing, 61);
  // The nodes of the cells that it meets, 1/6 apart.
  const Range range = growing->eigenvalues(Box3{{0.05, -1, -1}, {0.95, 1, 1}});
  CHECK(std::abs(range.min - 1), <, 1e-6);
  CHECK(std::abs(range.max - std::exp(0.5)), <, 1e-6);
}

TEST(lines_through_a_realisation_are_that_realisation) {
  const TensorFieldPtr rotating = test::along_x(test::rotating, 97);
  const KernelPtr se =
      make<SquaredExponential>(LengthScales({0.7, 1.3, 0.9}, {0.9, 0.3, -0.2, 0.1}));
  const std::pair<KernelPtr, TensorFieldPtr> cases[] = {
      {se, nullptr},
      {make<Matern>(1.5, 0.8), nullptr},
      {make<Matern>(2.5, 0.8), nullptr},
      {make<Wong>(0.8), nullptr},
      {make<RationalQuadratic>(0.7, 0.8), nullptr},
      {make<LocallyPeriodic>(1.2, 1.5, Vec3{0.6, 0.8, 0}, 1.1), nullptr},
      {make<PlaneWave>(Vec3{2, -1, 1.5}), nullptr},
      {make<ProductKernel>(se, make<PlaneWave>(Vec3{2, -1, 1.5})), nullptr},
      {make<SumKernel>(make<ScaledKernel>(0.6, se),
                       make<ScaledKernel>(0.4, make<Matern>(1.5, 1.0))),
       nullptr},
      {make<SquaredExponential>(1.0), rotating},
      {make<RationalQuadratic>(2.0, 1.0), rotating},
  };
  const Vec3 direction = normalize({0.96, 0.28, 0.1});
  for (const auto& [kernel, field] : cases) {
    test::context() = kernel->describe();
    const double mean = 7;
    const auto gp = std::make_shared<GaussianProcess>(process(kernel, field, mean));
    const ProcessSurface surface(gp, {{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, {}}, Memory{},
                                 Sampler::realisation, 1e-16);
    Realisation whole(*gp, Realisation::Access::rays, nullptr);
    for (std::uint64_t ray = 0; ray < 3; ++ray) {
      Line line;
      Counters counters;
      Rng rng(5, ray), same(5, ray);
      const double t = surface.first_hit(line, {{-1, 0, 0}, direction}, 6,
                                         surface.start_from(nullptr), rng, counters);
      CHECK(t, ==, kInfinity);
      whole.draw(same(), std::nullopt);
      for (const double at : {0.1, 1.7, 3.3, 5.9}) {
        CHECK(surface.sampled_at(line, at), ==, true);
        const FieldSample g = whole.sample(Vec3{-1, 0, 0} + direction * at);
        CHECK(std::abs(surface.value(line, at, rng) - mean - g.value), <, 1e-9);
      }
    }
  }
  test::context().clear();
}

}  // namespace gpis
