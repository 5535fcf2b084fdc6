#include "process/realisation.h"

#include "field/check.h"
#include "process/covariance.h"
#include "process/scale_mixture.h"

namespace gpis {
namespace {

bool on_lattice(const ProductTerm& product) {
  const auto family = product.factors[0].radial.family;
  return product.factors.size() == 1 &&
         (family == Radial::Family::squared_exponential || family == Radial::Family::constant);
}

std::vector<ProductTerm> products_of(const GaussianProcess& process) {
  const auto products = process.kernel->products();
  if (!products)
    refuse("A realisation takes kernels of at most ", Kernel::kMaxTerms, " terms; ",
           process.kernel->describe(), " has more.");
  return *products;
}

// Under an anisotropy: every term a sum of squared exponentials of many lengths (formulas C11).
std::vector<Realisation::Varying> varying_fields(const GaussianProcess& process, double& error) {
  const Covariance covariance(process);  // refuses other kernels
  std::vector<Realisation::Varying> fields;
  for (const ProductTerm& product : products_of(process)) {
    const Term& term = product.factors[0];
    const ScaleMixture mixture = scale_mixture(term.radial);
    error += product.weight / covariance.variance() * mixture.error;
    for (const auto& [weight, length] : mixture.parts)
      fields.push_back({VaryingLattice(process.anisotropy, length / term.max_inverse_length(),
                                       static_cast<int>(fields.size())),
                        std::sqrt(product.weight * weight)});
  }
  return fields;
}

std::vector<LatticeField> lattice_fields(const GaussianProcess& process) {
  std::vector<LatticeField> fields;
  int number = 0;
  if (process.anisotropy) return fields;
  for (const ProductTerm& product : products_of(process))
    if (on_lattice(product)) {
      Term term = product.factors[0];
      term.weight = product.weight;
      fields.emplace_back(term, number);
      number += fields.back().lattices();
    }
  return fields;
}

int count_lattices(const std::vector<LatticeField>& fields) {
  int count = 0;
  for (const LatticeField& field : fields) count += field.lattices();
  return count;
}

}  // namespace

Realisation::Realisation(const GaussianProcess& process, Access access, PosteriorPtr posterior)
    : posterior_(std::move(posterior)),
      varying_(process.anisotropy ? varying_fields(process, varying_error_)
                                  : std::vector<Varying>{}),
      lattices_(lattice_fields(process)),
      noise_(access == Access::rays ? LatticeNoise::Cache{{3, 3, 3}, lattices()}  // 2 MB a lattice
                                    : LatticeNoise::Cache{{6, 4, 4}, 1}) {
  if (process.anisotropy) return;
  // Numbers apart from those of the lattices: independent streams.
  int number = 1 << 20;
  for (const ProductTerm& product : products_of(process))
    if (!on_lattice(product)) spectra_.emplace_back(product, number++);
}

int Realisation::lattices() const {
  return count_lattices(lattices_) + static_cast<int>(varying_.size());
}

void Realisation::draw(std::uint64_t seed, std::optional<double> time) {
  if (drawn_ && seed == seed_ && time == time_) return;  // the bricks in the cache are still good
  drawn_ = true;
  seed_ = seed;
  time_ = time;
  noise_.reset(seed, time);
  for (SpectralField& field : spectra_) spectral_normals_ += field.draw(seed, time);
  if (posterior_) weights_.assign(posterior_->blocks(), {});
}

FieldSample Realisation::sample(const Vec3& x) {
  FieldSample g = free_sample(x);
  if (posterior_ && posterior_->conditions().near({x, {}}, 0, 0)) add_conditions(x, g);
  return g;
}

void Realisation::add_conditions(const Vec3& x, FieldSample& g) {
  const LocalPoint at = posterior_->covariance().at(x);
  posterior_->blend(x, [&](int block, double weight, const Vec3& slope) {
    const Eigen::Vector4d part = posterior_->sum(block, weights(block), at);
    g.value += weight * part[0];
    g.gradient += Vec3{part[1], part[2], part[3]} * weight + slope * part[0];
  });
}

const std::vector<double>& Realisation::weights(int block) {
  std::vector<double>& w = weights_[block];
  const JointRows& rows = posterior_->rows(block);
  if (!w.empty() || rows.count() == 0) return w;
  w.resize(rows.count());
  for (int i = 0; i < rows.count(); ++i) {
    const Functional& what = rows.functional(i);
    const FieldSample g = free_sample(rows.point(i).x);
    w[i] = rows.value(i) - what.value * g.value - dot(what.slope, g.gradient);
    if (rows.noise(i) > 0) {
      Rng rng(seed_, (std::uint64_t{1} << 40) + posterior_->condition(block, i));
      w[i] += std::sqrt(rows.noise(i)) * rng.normal();
    }
  }
  return w = rows.weights(rows.whiten(w));
}

FieldSample Realisation::free_sample(const Vec3& x) {
  FieldSample g;
  add_lattices(x, g);
  for (SpectralField& field : spectra_) field.add(x, g);
  return g;
}

void Realisation::add_lattices(const Vec3& x, FieldSample& g) {
  for (LatticeField& field : lattices_) field.add(noise_, x, g);
  for (Varying& part : varying_) {
    const FieldSample varying = part.lattice.sample(noise_, smoothed_, x);
    g.value += part.scale * varying.value;
    g.gradient += varying.gradient * part.scale;
  }
}

void Realisation::set_line(const Vec3& o, const Vec3& d) {
  origin_ = o;
  direction_ = d;
  for (SpectralField& field : spectra_) field.set_line(o, d);
  near_ = posterior_ && posterior_->conditions().near({o, d}, -kInfinity, kInfinity);
}

void Realisation::on_line(double t, double& g, double& dg) {
  const Vec3 x = origin_ + direction_ * t;
  FieldSample sample;
  add_lattices(x, sample);
  g = sample.value;
  dg = dot(sample.gradient, direction_);
  for (SpectralField& field : spectra_) field.add_on_line(t, g, dg);
  if (!near_) return;
  FieldSample conditions;
  add_conditions(x, conditions);
  g += conditions.value;
  dg += dot(conditions.gradient, direction_);
}

double Realisation::fourth_derivative() const {
  double variance = 0;
  for (const LatticeField& field : lattices_)
    variance += field.fourth_derivative_variance(direction_);
  for (const SpectralField& field : spectra_) variance += field.fourth_derivative_variance();
  for (const Varying& part : varying_)
    variance += part.scale * part.scale * part.lattice.fourth_derivative_variance(direction_);
  return std::sqrt(variance);
}

double Realisation::expected_fourth_derivative(const Vec3& d) const {
  double variance = 0;
  for (const LatticeField& field : lattices_) variance += field.fourth_derivative_variance(d);
  for (const SpectralField& field : spectra_)
    variance += field.expected_fourth_derivative_variance(d);
  for (const Varying& part : varying_)
    variance += part.scale * part.scale * part.lattice.fourth_derivative_variance(d);
  return std::sqrt(variance);
}

void Realisation::fill(const Vec3& origin, double spacing, const std::array<int, 3>& size,
                       float* g) {
  const std::size_t slice = static_cast<std::size_t>(size[1]) * size[2];
  std::fill(g, g + slice * size[0], 0.0f);
  const auto row = [&](int i, int j) { return g + i * slice + j * size[2]; };
  for (LatticeField& field : lattices_) field.add_box(noise_, origin, spacing, size, g);
  constexpr int kNeighbours = 16;  // along a row, that share most of their nodes with other rows
  for (Varying& part : varying_)
    for (int k0 = 0; k0 < size[2]; k0 += kNeighbours)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i)
          for (int k = k0; k < std::min(k0 + kNeighbours, size[2]); ++k) {
            const Vec3 x = origin + Vec3{double(i), double(j), double(k)} * spacing;
            row(i, j)[k] +=
                static_cast<float>(part.scale * part.lattice.value(noise_, smoothed_, x));
          }
  for (SpectralField& field : spectra_)
    for (int i = 0; i < size[0]; ++i)
      field.add_slice(origin + Vec3{i * spacing, 0, 0}, spacing, size[1], size[2], row(i, 0));
  if (!posterior_) return;
  for (int i = 0; i < size[0]; ++i)
    for (int j = 0; j < size[1]; ++j) {
      const Vec3 o = origin + Vec3{double(i), double(j), 0} * spacing;
      if (!posterior_->conditions().near({o, {0, 0, spacing}}, 0, size[2] - 1)) continue;
      for (int k = 0; k < size[2]; ++k) {
        const Vec3 x = o + Vec3{0, 0, k * spacing};
        if (!posterior_->conditions().near({x, {}}, 0, 0)) continue;
        FieldSample conditions;
        add_conditions(x, conditions);
        row(i, j)[k] += static_cast<float>(conditions.value);
      }
    }
}

std::string Realisation::describe() const {
  std::ostringstream text;
  const int lattices = count_lattices(lattices_);
  if (!varying_.empty()) {
    text
        << varying_.size() << (varying_.size() == 1 ? " lattice" : " lattices")
        << " of white noise under length scales that vary, exactly Gaussian, correlation exact to ";
    if (varying_error_ > 0)
      text << number_text(correlation_error()) << ", variance of slopes to 2e-3";
    else
      text << "3e-7";
  }
  if (lattices > 0)
    text << lattices << (lattices == 1 ? " lattice" : " lattices")
         << " of white noise, exactly Gaussian, correlation exact to 3e-7";
  if (lattices > 0 && !spectra_.empty()) text << "; ";
  if (!spectra_.empty())
    text << spectra_.size() << " x " << SpectralField::kFeatures
         << " random spectral features, exact covariance, Gaussian up to an excess kurtosis of "
            "7e-4 (values) and 5e-3 (slopes)";
  return text.str();
}

}  // namespace gpis
