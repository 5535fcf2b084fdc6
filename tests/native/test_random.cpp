// The random numbers behind every sample: normals by the ziggurat, streams by their seeds.
#include <boost/math/distributions/chi_squared.hpp>
#include <vector>

#include "check.h"
#include "process/surface.h"

using namespace gpis;
using namespace gpis::test;
namespace {

double upper(double z) {
  return 0.5 * std::erfc(z / std::sqrt(2));
}

// Are numbers in [0, 1) uniform? Pearson's χ² over `bins`.
class Uniformity {
 public:
  explicit Uniformity(int bins) : counts_(bins) {}
  void add(double u) {
    ++counts_[std::min<std::size_t>(static_cast<std::size_t>(u * counts_.size()),
                                    counts_.size() - 1)];
    ++total_;
  }
  double p_value() const {
    const double expected = total_ / counts_.size();
    double statistic = 0;
    for (const double c : counts_) statistic += (c - expected) * (c - expected) / expected;
    return cdf(complement(boost::math::chi_squared(counts_.size() - 1.0), statistic));
  }

 private:
  std::vector<double> counts_;
  double total_ = 0;
};

// 6 tests of level 1e-4: 6e-4 together.
constexpr double kLevel = 1e-4;
constexpr int kDraws = 4'000'000;

}  // namespace

TEST(normals_follow_the_normal_distribution) {
  Rng rng(11, 0);
  Uniformity all(1000);
  std::vector<double> z(1000);
  Mean fourth;
  for (int i = 0; i < kDraws / 1000; ++i) {
    rng.normals(z.data(), z.size());
    for (const double x : z) {
      all.add(upper(x));
      fourth.add(x * x * x * x);
    }
  }
  CHECK(all.p_value(), >, kLevel);
  CHECK(std::abs(fourth.z(3)), <, 3.9);
}

TEST(tail_of_the_normals) {
  const double tail = 3.6541528853610088;  // of the ziggurat, drawn on its own
  Rng rng(13, 0);
  Uniformity behind(20);
  double beyond = 0;
  for (int i = 0; i < 8 * kDraws; ++i) {
    const double x = rng.normal();
    if (std::abs(x) <= tail) continue;
    ++beyond;
    // Both tails after one another.
    const double u = upper(std::abs(x)) / upper(tail);
    behind.add(x > 0 ? u / 2 : 1 - u / 2);
  }
  CHECK(behind.p_value(), >, kLevel);
  const double expected = 2 * upper(tail) * 8 * kDraws;
  CHECK(std::abs(beyond - expected) / std::sqrt(expected), <, 3.9);
}

// Every ray has a stream of its own and takes its first few numbers.
TEST(first_normals_of_neighbouring_streams_are_independent) {
  Uniformity first(1000), pairs(40 * 40);
  double before = 0;
  for (int i = 0; i < kDraws / 4; ++i) {
    Rng rng(12, i);
    const double a = upper(rng.normal()), b = upper(rng.normal());
    first.add(a);
    // The second of this stream beside the first of the one before.
    pairs.add((std::floor(40 * b) + before) / 40);
    before = a;
  }
  CHECK(first.p_value(), >, kLevel);
  CHECK(pairs.p_value(), >, kLevel);
}

TEST(a_stream_is_that_of_its_seeds) {
  Rng a(1, 2, 3), b(1, 2, 3);
  std::vector<double> one(8), many(8);
  for (double& x : one) x = a.normal();
  b.normals(many.data(), many.size());
  CHECK(one == many, ==, true);
  CHECK(a(), ==, b());
  CHECK(Rng(1, 2, 3)(), !=, Rng(1, 2, 4)());
  CHECK(Rng(1, 2, 3)(), !=, Rng(1, 3, 3)());
  CHECK(Rng(1, 2, 3)(), !=, Rng(2, 2, 3)());
}

// Numbers in 60 digits, by tests/stability/tables.py: log Φ(-a).
TEST(log_of_the_normal_tail_is_that_of_many_digits) {
  constexpr double kTable[][2] = {
      {0, -0.6931471805599453094},     {8, -35.013437159914549895},  {29.5, -439.42947460915022775},
      {30, -454.32124395634319710},    {35, -616.97510126192251347}, {40, -804.60844201375378816},
      {10000, -50000010.129278915180},
  };
  for (const auto& [a, expected] : kTable)
    // 1e-10 of the probability itself, but for the rounding of a²/2.
    CHECK(std::abs(log_normal_tail(a) - expected), <, 1e-10 + 3e-16 * std::abs(expected));
}

// E[Z - a | Z > a], and the mean of the density ∝ z₊ N(z; -a, 1), from the same script.
TEST(far_tails_have_the_moments_of_many_digits) {
  constexpr double kTable[][3] = {
      {-8, 8.00000000000000505, 8.12499999999999992},
      {-1, 1.28759997093917836, 1.77663872520173926},
      {0, 0.79788456080286536, 1.25331413731550025},
      {1, 0.52513527616098121, 0.90427123332969182},
      {8, 0.12136811223611268, 0.23939650684006689},
      {40, 0.02496884720726372, 0.04990665764851819},
      {1000, 0.00099999800000999, 0.00199999400004200},
  };
  Rng rng(17, 0);
  for (const auto& [a, beyond, flux] : kTable) {
    // In units of what is expected: Mean allows for rounding of 1e-9 of 1.
    Mean truncated, weighted;
    for (int i = 0; i < kDraws / 20; ++i) {
      truncated.add((truncated_normal(a, rng) - a) / beyond);
      weighted.add(flux_weighted_normal(-a, rng) / flux);
    }
    CHECK(std::abs(truncated.z(1)), <, 4.5);  // 14 tests: 1e-4 together
    CHECK(std::abs(weighted.z(1)), <, 4.5);
  }
  // Where squares are infinite, and where a mean of that many deviations is itself.
  for (const double a : {1e9, 1e30, 1e160, 1e300, kInfinity}) {
    const double beyond = truncated_normal(a, rng), least = std::min(a, 1e300);
    CHECK(beyond, >, least);
    CHECK(beyond, <=, least * (1 + 1e-15));
    CHECK(flux_weighted_normal(-a, rng), >=, 0);
    CHECK(flux_weighted_normal(-a, rng) * least, <, 50);
    CHECK(flux_weighted_normal(a, rng), >, 0);
  }
}
