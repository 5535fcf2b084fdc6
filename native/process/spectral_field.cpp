#include "process/spectral_field.h"

#include <boost/random/gamma_distribution.hpp>
#include <stdexcept>

#include "process/lattice_field.h"

namespace gpis {
namespace {

double squared_normal(Rng& rng) {
  const double z = rng.normal();
  return z * z;
}
double chi_squared(int n, Rng& rng) {
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += squared_normal(rng);
  return sum;
}

// A frequency of the spectral density of κ(|r|) in three dimensions (formulas C8), or of that
// density times |k|² (`biased`): |k|² is a product or quotient of χ² or Gamma variables, whose
// degrees of freedom move by two.
Vec3 draw_frequency(const Radial& radial, bool biased, Rng& rng) {
  using Family = Radial::Family;
  const Vec3 z{rng.normal(), rng.normal(), rng.normal()};
  const double plain = dot(z, z), z2 = plain + (biased ? chi_squared(2, rng) : 0);
  double k2 = 0;
  switch (radial.family) {
    case Family::constant:
      break;
    case Family::squared_exponential:
      k2 = z2;
      break;
    case Family::matern12:
      k2 = z2 / squared_normal(rng);  // only plain: E|k|² is infinite
      break;
    case Family::matern32:
      k2 = 3 * z2 / chi_squared(biased ? 1 : 3, rng);
      break;
    case Family::matern52:
      k2 = 5 * z2 / chi_squared(biased ? 3 : 5, rng);
      break;
    case Family::rational_quadratic: {
      boost::random::gamma_distribution<double> gamma(radial.alpha + (biased ? 1 : 0));
      k2 = z2 * gamma(rng) / radial.alpha;
      break;
    }
    case Family::wong:
      // From the three-dimensional Cauchy density ∝ 1/(k² + 1/3)², accepted with probability 1 -
      // ((k² + 1/3)/(k² + 3))², or with 3/16 of k² times that.
      for (;;) {
        k2 = chi_squared(3, rng) / (3 * squared_normal(rng));
        const double ratio = (k2 + 1.0 / 3) / (k2 + 3);
        const double accept =
            biased ? k2 * (k2 + 5.0 / 3) / ((k2 + 3) * (k2 + 3)) : 1 - ratio * ratio;
        if (rng.uniform() < accept) break;
      }
  }
  return z * std::sqrt(k2 / plain);
}

}  // namespace

SpectralField::SpectralField(ProductTerm term, int number)
    : term_(std::move(term)), number_(number) {
  for (Array* a : {&omega_[0], &omega_[1], &omega_[2], &a_, &b_, &along_, &at_origin_, &phase_,
                   &sine_, &cosine_})
    a->resize(kFeatures);
  for (const Term& factor : term_.factors)
    if (!factor.radial.differentiable()) return;
  for (const Term& factor : term_.factors) {
    const double inverse = factor.max_inverse_length();
    squares_.push_back(3 * factor.radial.lambda2() * inverse * inverse);
    square_ += squares_.back();
  }
}

Vec3 SpectralField::draw_frequency(bool biased, Rng& rng, double& weight) const {
  std::size_t by = term_.factors.size();  // the factor that is biased
  if (biased) {
    by = 0;
    if (term_.factors.size() > 1)
      for (double left = rng.uniform() * square_; by + 1 < squares_.size(); ++by)
        if ((left -= squares_[by]) < 0) break;
  }
  Vec3 sum;
  double square = 0;
  bool turned = false;
  for (std::size_t i = 0; i < term_.factors.size(); ++i) {
    const Term& factor = term_.factors[i];
    const Vec3 k = gpis::draw_frequency(factor.radial, i == by, rng);
    sum += transpose(factor.whitening) * k;
    const double inverse = factor.max_inverse_length();
    square += dot(k, k) * inverse * inverse;
    if (!factor.modulated()) continue;
    // cos a cos b = (cos(a + b) + cos(a - b)) / 2
    sum += factor.wave_vector * (turned && rng.uniform() < 0.5 ? -1 : 1);
    turned = true;
  }
  weight = square_ > 0 ? 2 / (1 + square / square_) : 1;
  return sum;
}

std::uint64_t SpectralField::draw(std::uint64_t seed, std::optional<double> time) {
  const std::uint64_t key = mix64(mix64(seed) ^ static_cast<std::uint64_t>(number_));
  Rng rng(key, 0);
  std::uint64_t normals = 3 * kFeatures * term_.factors.size();
  for (int k = 0; k < kFeatures; ++k) {
    double weight;
    const Vec3 omega = draw_frequency(square_ > 0 && k % 2 == 1, rng, weight);
    for (int axis = 0; axis < 3; ++axis) omega_[axis][k] = omega[axis];
    phase_[k] = std::sqrt(term_.weight * weight / kFeatures);
  }
  const auto amplitudes = [&](Rng& from, double scale) {
    for (int k = 0; k < kFeatures; ++k) {
      a_[k] += scale * from.normal();
      b_[k] += scale * from.normal();
    }
    normals += 2 * kFeatures;
  };
  a_.setZero();
  b_.setZero();
  if (time) {
    const TimeWindow window(*time);
    for (int m = 0; m < TimeWindow::kNodes; ++m) {
      Rng at_node(key, static_cast<std::uint64_t>(window.first + m), 1);
      amplitudes(at_node, window.weight[m]);
    }
  } else {
    amplitudes(rng, 1);
  }
  a_ *= phase_;
  b_ *= phase_;
  basis_spacing_ = 0;
  return normals;
}

void SpectralField::add(const Vec3& x, FieldSample& g) {
  phase_ = omega_[0] * x.x + omega_[1] * x.y + omega_[2] * x.z;
  turn(phase_);
  g.value += (a_ * cosine_ + b_ * sine_).sum();
  phase_ = b_ * cosine_ - a_ * sine_;
  for (int axis = 0; axis < 3; ++axis) g.gradient[axis] += (phase_ * omega_[axis]).sum();
}

void SpectralField::set_line(const Vec3& o, const Vec3& d) {
  at_origin_ = omega_[0] * o.x + omega_[1] * o.y + omega_[2] * o.z;
  along_ = omega_[0] * d.x + omega_[1] * d.y + omega_[2] * d.z;
}

void SpectralField::add_on_line(double t, double& g, double& dg) {
  phase_ = at_origin_ + t * along_;
  turn(phase_);
  g += (a_ * cosine_ + b_ * sine_).sum();
  dg += ((b_ * cosine_ - a_ * sine_) * along_).sum();
}

double SpectralField::fourth_derivative_variance() const {
  // The amplitudes' own squares in place of their expectations: a path differs from its cubic by
  // what it is, not by what it is on average.
  return 0.5 * ((a_.square() + b_.square()) * along_.square().square().square()).sum();
}

double SpectralField::expected_fourth_derivative_variance(const Vec3& d) const {
  // As a squared exponential of half the length scale: 1024 features of Matérn 3/2 come to that.
  double wave = 0, variance = 0;
  for (const Term& factor : term_.factors) {
    const Vec3 whitened = factor.whitening * d;
    wave += std::abs(dot(factor.wave_vector, d));
    variance += 4 * factor.radial.lambda2() * dot(whitened, whitened);
  }
  return term_.weight * eighth_moment(wave, variance);
}

void SpectralField::add_slice(const Vec3& origin, double spacing, int rows, int count, float* g) {
  if (basis_spacing_ != spacing || basis_.cols() != count) {
    basis_.resize(2 * kFeatures, count);
    for (int k = 0; k < count; ++k) {
      phase_ = omega_[2] * (k * spacing);
      turn(phase_);
      basis_.col(k).head(kFeatures) = cosine_.cast<float>().matrix();
      basis_.col(k).tail(kFeatures) = sine_.cast<float>().matrix();
    }
    basis_spacing_ = spacing;
  }
  // Along z, a cos(φ + ω_z z) + b sin(φ + ω_z z) is a product of a row by the basis.
  Matrix row(rows, 2 * kFeatures);
  for (int j = 0; j < rows; ++j) {
    phase_ = omega_[0] * origin.x + omega_[1] * (origin.y + j * spacing) + omega_[2] * origin.z;
    turn(phase_);
    row.row(j).head(kFeatures) = (a_ * cosine_ + b_ * sine_).cast<float>().matrix();
    row.row(j).tail(kFeatures) = (b_ * cosine_ - a_ * sine_).cast<float>().matrix();
  }
  Eigen::Map<Matrix>(g, rows, count).noalias() += row * basis_;
}

}  // namespace gpis
