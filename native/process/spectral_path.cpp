#include "process/spectral_path.h"

#include "core/sincos.h"
#include "core/symmetric_eigen.h"
#include "process/across.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

// What a path departs from its cubic over a cell, in standard deviations of g: where the squared
// exponential's steps of half a length scale stand.
constexpr double kCellDeviation = 0.01;
constexpr double kNear = 1e-3;  // see near_start_reach

// The largest |κ'| at distances of at least q.
double steepest(const Radial& radial, double q) {
  double at = 1;
  if (radial.family == Radial::Family::rational_quadratic)
    at = std::sqrt(2 * radial.alpha / (2 * radial.alpha + 1));
  return -radial.slope(std::max(q, at));
}

}  // namespace

void SpectralPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                         Counters& counters) {
  plan_ = &plan;
  anchor_ = state_t_ = anchor;
  direction_ = line.direction;
  cell_ = -1;
  next_pull_ = 0;
  pull_ = 0;
  drawn_ = remembered_ = held_ = false;
  near_.forget();
  terms_.clear();
  for (const Plan::Component& c : plan.components)
    place(c, line.direction, t_end - anchor, counters);
  const TermLine& last = terms_.back();
  rate_.resize(last.first + last.count * (last.paired + 1));
  variance_.resize(rate_.size());
  for (const TermLine& l : terms_) fill(l);
  slope_variance_ = (variance_ * rate_.square()).sum();
  // 4.5 standard deviations of g'''' in the remainder of the cubic (see ConvolutionPath).
  deviation_ = 4.5 / 288 * std::sqrt((variance_ * rate_.square().square().square()).sum());
  step_ = std::pow(kCellDeviation * value_deviation() / deviation_, 0.25);
  if (std::isfinite(step_)) turn_by(step_, step_cos_, step_sin_);
}

void SpectralPath::place(const Plan::Component& component, const Vec3& direction, double reach_t,
                         Counters& counters) {
  const Term& term = component.term;
  const Mat3 bt = transpose(term.whitening);
  const Vec3 whitened = term.whitening * direction;
  TermLine line{};
  line.term = &term;
  line.first =
      terms_.empty() ? 0 : terms_.back().first + terms_.back().count * (terms_.back().paired + 1);
  line.inverse_length = length(whitened);
  line.turn = dot(direction, term.wave_vector);
  const double spread = std::sqrt(term.weight * term.radial.lambda2());
  if (line.inverse_length > 0) {
    const Frame frame(whitened / line.inverse_length);
    line.along = bt * frame.n;
    line.across[0] = bt * frame.s * spread;
    line.across[1] = bt * frame.t * spread;
    const Plan::Table& table = plan_->tables[component.table];
    std::size_t level = 0;
    const double reach = reach_t * line.inverse_length;
    while (level + 1 < table.size() && table[level].reach < reach) ++level;
    if (table[level].reach < reach) ++counters.line_reach_limit;
    line.spectrum = &table[level];
    line.count = static_cast<Eigen::Index>(line.spectrum->weight.size());
  } else {  // the envelope is constant along the line: every slope of it is across
    const Mat3 axes;
    for (int i = 0; i < 3; ++i) line.across[i] = bt * axes.row[i] * spread;
    line.count = 1;
  }
  line.paired = line.spectrum && term.modulated();
  terms_.push_back(line);
}

void SpectralPath::fill(const TermLine& line) {
  for (Eigen::Index i = 0; i < line.count; ++i) {
    const double omega = line.spectrum ? line.spectrum->frequency[i] * line.inverse_length : 0;
    const double weight = line.term->weight * (line.spectrum ? line.spectrum->weight[i] : 1);
    rate_[line.first + i] = omega + line.turn;
    variance_[line.first + i] = line.paired ? 0.5 * weight : weight;
    if (!line.paired) continue;
    rate_[line.first + line.count + i] = omega - line.turn;
    variance_[line.first + line.count + i] = 0.5 * weight;
  }
}

void SpectralPath::draw(Rng& rng, Counters& counters) {
  drawn_ = true;
  const Eigen::Index n = rate_.size();
  value_.resize(n);
  slope_.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    value_[i] = rng.normal();
    slope_[i] = rng.normal();
  }
  angle_ = variance_.sqrt();
  value_ *= angle_;
  slope_ *= angle_;
  counters.line_normals += 2 * n;
}

void SpectralPath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  draw(rng, counters);
  right_g_ = g = value_.sum();
  right_dg_ = dg = (rate_ * slope_).sum();
}

Vec3 SpectralPath::waves_gradient(const Array& slope) const {
  Vec3 sum;
  for (const TermLine& line : terms_) {
    double along = 0, turned = 0;
    for (int side = 0; side <= line.paired; ++side) {
      const auto part = slope.segment(line.first + side * line.count, line.count);
      turned += (side ? -1 : 1) * part.sum();
      if (line.spectrum)
        along +=
            (part * Eigen::Map<const Array>(line.spectrum->frequency.data(), line.count)).sum();
    }
    sum += line.along * along + line.term->wave_vector * turned;
  }
  return sum;
}

// Pseudo-inverse of G = Cov ∇g as it is on this path: where G is 0 (infinite lengths, plane waves)
// the gradient is too.
Mat3 SpectralPath::gradient_precision() const {
  Mat3 g = Mat3{} * 0;
  for (const TermLine& line : terms_) {
    const Vec3& k = line.term->wave_vector;
    const double along = line.spectrum ? line.spectrum->slope_variance : 0;
    g = g + (outer(line.along, line.along) * along + outer(k, k)) * line.term->weight;
    for (const Vec3& across : line.across) g = g + outer(across, across);
  }
  return pseudo_inverse(g);
}

// Adds cov(·, g(0)) value + cov(·, ∇g(0)) gradient to the path: its waves are independent, of
// variance c and with cov(B, ∇g(0)) = c V.
void SpectralPath::shift(double value, const Vec3& gradient) {
  value_ += variance_ * value;
  for (TermLine& line : terms_) {
    const double along = dot(line.along, gradient), turned = dot(line.term->wave_vector, gradient);
    for (int side = 0; side <= line.paired; ++side) {
      const Eigen::Index first = line.first + side * line.count;
      const double turn = side ? -turned : turned;
      for (Eigen::Index i = 0; i < line.count; ++i) {
        const double omega = line.spectrum ? line.spectrum->frequency[i] : 0;
        slope_[first + i] += variance_[first + i] * (omega * along + turn);
      }
    }
    for (int m = 0; m < 3; ++m) line.normal_cos[m] += dot(line.across[m], gradient);
  }
}

void SpectralPath::draw_across(Rng& rng, Counters& counters) {
  remembered_ = true;
  for (TermLine& line : terms_)
    for (int m = 0; m < 3; ++m) {
      const bool any = length(line.across[m]) > 0, both = any && line.term->modulated();
      line.normal_cos[m] = any ? rng.normal() : 0;
      line.normal_sin[m] = both ? rng.normal() : 0;
      counters.line_normals += any + both;
    }
}

Vec3 SpectralPath::start_gradient() const {
  Vec3 sum = waves_gradient(slope_);
  for (const TermLine& line : terms_)
    for (int m = 0; m < 3; ++m) sum += line.across[m] * line.normal_cos[m];
  return sum;
}

// Matheron's rule on the value, or value and slope, or value and gradient at the anchor; value and
// gradient of a stationary process are independent at a point.
double SpectralPath::start(const PathStart& known, Rng& rng, Counters& counters) {
  if (!drawn_) draw(rng, counters);
  const double value = (known.value - value_.sum()) / plan_->variance;
  Vec3 mean;  // of the gradient's part in the conditional mean, for pull
  Vec3 correction;
  if (known.gradient_known) {
    draw_across(rng, counters);
    const Mat3 precision = gradient_precision();
    mean = precision * known.gradient;
    correction = precision * (known.gradient - start_gradient());
  } else if (known.slope_known && slope_variance_ > 0) {
    const double slope = (rate_ * slope_).sum();
    mean = direction_ * (known.slope / slope_variance_);
    correction = direction_ * ((known.slope - slope) / slope_variance_);
  }
  shift(value, correction);
  hold(known.value / plan_->variance, mean);
  right_g_ = value_.sum();
  right_dg_ = (rate_ * slope_).sum();
  const double slope = std::sqrt(slope_variance_);
  // Unless the kernel cannot have it.
  if (known.slope_known && std::abs(known.slope - right_dg_) < 1e-6 * (slope + std::abs(right_dg_)))
    right_dg_ = known.slope;
  near_.know(anchor_, known.value, right_dg_, near_start_reach(kNear, slope, deviation_));
  return right_dg_;
}

// What the conditional mean Σ w [κ (v cos θ + (k·c) sin θ) - κ' (E·c) cos θ] can be, term by term.
void SpectralPath::hold(double value, const Vec3& gradient) {
  held_ = true;
  for (TermLine& line : terms_) {
    const bool turns = line.turn != 0;
    const auto below = [turns](double v) { return turns ? std::abs(v) : std::max(0.0, -v); };
    line.pull_value = line.term->weight * below(value);
    line.pull_slope = line.term->weight * below(dot(line.along, gradient));
    line.pull_turned = line.term->weight * std::abs(dot(line.term->wave_vector, gradient)) * turns;
  }
  pull_ = pull_from(0);
  next_pull_ = 4;
}

double SpectralPath::pull_from(double tau) const {
  double sum = 0;
  for (const TermLine& line : terms_) {
    const double q = line.spectrum ? tau * line.inverse_length : 0;
    sum += line.term->radial.value(q) * (line.pull_value + line.pull_turned);
    if (line.pull_slope > 0 && line.term->radial.family != Radial::Family::constant)
      sum += steepest(line.term->radial, q) * line.pull_slope;
  }
  return sum;
}

void SpectralPath::turn_by(double tau, Array& cosine, Array& sine) {
  angle_ = rate_ * tau;
  cosine.resize(angle_.size());
  sine.resize(angle_.size());
  sincos(angle_.data(), static_cast<int>(angle_.size()), sine.data(), cosine.data());
}

void SpectralPath::prepare(long cell, Rng&, Counters&) {
  if (cell == cell_) return;
  if (held_ && cell >= next_pull_) {  // it only falls: seldom is often enough
    pull_ = pull_from(cell * step_);
    next_pull_ = cell + cell / 2 + 4;
  }
  if (std::isinf(step_)) return;
  const bool next = cell == cell_ + 1;
  if (!next) turn_by((cell - cell_) * step_, turned_cos_, turned_sin_);
  const Array& c = next ? step_cos_ : turned_cos_;
  const Array& s = next ? step_sin_ : turned_sin_;
  angle_ = value_ * c + slope_ * s;
  slope_ = slope_ * c - value_ * s;
  value_.swap(angle_);
  cell_ = cell;
  state_t_ = anchor_ + (cell + 1) * step_;
  right_g_ = value_.sum();
  right_dg_ = (rate_ * slope_).sum();
}

void SpectralPath::at_right(long cell, double& g, double& dg) {
  if (cell != cell_) return evaluate(anchor_ + (cell + 1) * step_, g, dg);
  g = right_g_;
  dg = right_dg_;
}

void SpectralPath::evaluate(double t, double& g, double& dg) {
  const auto waves = [this](double at, double& v, double& dv) { sum_waves(at, v, dv); };
  near_.holds(t) ? near_.read(t, g, dg, waves) : waves(t, g, dg);
}

void SpectralPath::sum_waves(double t, double& g, double& dg) {
  turn_by(t - state_t_, turned_cos_, turned_sin_);
  g = (value_ * turned_cos_ + slope_ * turned_sin_).sum();
  dg = (rate_ * (slope_ * turned_cos_ - value_ * turned_sin_)).sum();
}

// Across the line every term's slopes are cγ(0) + √(1-c²)ξ with its own c(q), turned by its θ; the
// free parts of all terms add up to one covariance across d.
PathGradient SpectralPath::gradient(double t, double, double, Rng&) {
  turn_by(t - state_t_, turned_cos_, turned_sin_);
  angle_ = slope_ * turned_cos_ - value_ * turned_sin_;
  PathGradient law;
  law.mean = waves_gradient(angle_);
  Across across(direction_);
  for (const TermLine& line : terms_) {
    const double tau = t - anchor_, q = line.spectrum ? tau * line.inverse_length : 0;
    const double c = remembered_ ? line.term->radial.transverse(q) : 0;
    const double cosine = c * std::cos(line.turn * tau), sine = c * std::sin(line.turn * tau);
    for (int m = 0; m < 3; ++m) {
      if (remembered_)
        law.mean += line.across[m] * (cosine * line.normal_cos[m] + sine * line.normal_sin[m]);
      across.add(line.across[m], (1 - c) * (1 + c));
    }
  }
  across.write(law);
  return law;
}

std::unique_ptr<LineSampler> make_spectral(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<SpectralPath, Fields::any>(process, bounds);
}

}  // namespace gpis
