#include "process/radial_line.h"

#include "field/check.h"
#include "process/gaussian_process.h"

namespace gpis {

RadialLine::Plan::Plan(const Term& term)
    : radial(term.radial),
      lambda2(term.radial.lambda2()),
      whitening(term.whitening),
      gradient_of(transpose(term.whitening)),
      constant{0, 0, 1} {
  for (int i = 0; i < 3; ++i) {
    const Vec3& row = term.whitening.row[i];
    const double square = dot(row, row);
    slopes_of.row[i] = square > 0 ? row / square : Vec3{};
    if (square == 0) {
      constant = {};
      constant[i] = 1;
    }
  }
}

PathGradient RadialLine::gradient(double t, double slope) const {
  const double c = remembered_ ? plan_->radial.transverse(q(t)) : 0;
  PathGradient law;
  law.free_variance = (1 - c) * (1 + c);
  const double spread = std::sqrt(plan_->lambda2 * law.free_variance);
  const Frame e = frame();
  law.mean =
      plan_->gradient_of * (e.s * (c * gamma1_) + e.t * (c * gamma2_) + e.n * per_length(slope));
  law.b1 = plan_->gradient_of * (e.s * spread);
  law.b2 = plan_->gradient_of * (e.t * spread);
  return law;
}

Term single_term(const GaussianProcess& process, const char* sampler) {
  const auto terms = process.kernel->terms();
  if (!terms || terms->size() != 1 || length(terms->front().wave_vector) != 0)
    refuse("", sampler, " serves one radial correlation, not ", process.kernel->describe(), ".");
  return terms->front();
}

}  // namespace gpis
