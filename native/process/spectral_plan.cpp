// What the spectral sampler needs once per object: its terms and the tables of their spectra.
#include "field/check.h"
#include "process/spectral_path.h"

namespace gpis {
namespace {

// Lines longer than the last table take it all the same: correlations at lags within its reach are
// right on a line of any length, those beyond are not (the plan says so). A constant needs one.
constexpr double kReaches[] = {8, 16, 32, 64, 128, 256};
constexpr std::size_t kMostWaves = 1 << 17;
constexpr double kNegligible = 1e-7;  // share of the variance of a term that is left out

std::vector<Term> terms_of(const Kernel& kernel) {
  const auto terms = kernel.terms();
  if (!terms)
    refuse("The spectral sampler does not serve ", kernel.describe(),
           ": it is no sum of independent terms (or of too many). Take the nystrom or the dense "
           "sampler.");
  for (const Term& term : *terms)
    if (!term.radial.smooth())
      refuse("The spectral sampler does not serve ", kernel.describe(),
             ": a part of it is rough, its spectrum decays too slowly. Take the markov or the "
             "dense sampler.");
  return *terms;
}

}  // namespace

SpectralPath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : Plan(terms_of(*process.kernel), bounds) {}

SpectralPath::Plan::Plan(const std::vector<Term>& terms, const Box3& bounds) {
  const double diagonal = length(bounds.max - bounds.min);
  std::vector<Radial> radials;
  std::vector<double> longest;  // reach asked of every radial part
  double all = 0;
  for (const Term& term : terms) all += term.weight;
  for (const Term& term : terms) {
    if (term.weight < kNegligible * all) {
      correlation_error += 2 * term.weight / all;
      continue;
    }
    std::size_t i = 0;
    while (i < radials.size() &&
           (radials[i].family != term.radial.family || radials[i].alpha != term.radial.alpha))
      ++i;
    if (i == radials.size()) {
      radials.push_back(term.radial);
      longest.push_back(0);
    }
    const double inverse_length = term.max_inverse_length();
    const double reach = inverse_length > 0 ? diagonal * inverse_length : 0;
    longest[i] = std::max(longest[i], std::isnan(reach) ? kInfinity : reach);
    components.push_back({term, i});
    variance += term.weight;
  }
  std::size_t waves = 0;
  for (std::size_t i = 0; i < radials.size(); ++i) {
    Table table;
    for (const double reach : kReaches) {
      table.push_back(line_spectrum(radials[i], reach));
      if (reach >= longest[i] || radials[i].family == Radial::Family::constant) break;
    }
    if (radials[i].family != Radial::Family::constant && table.back().reach < longest[i])
      reach = std::min(reach, table.back().reach);
    tables.push_back(std::move(table));
  }
  for (const Component& c : components) {
    const LineSpectrum& last = tables[c.table].back();
    waves += last.weight.size() * (c.term.modulated() ? 2 : 1);
    double error = 0;
    for (const LineSpectrum& s : tables[c.table]) error = std::max(error, s.error);
    correlation_error += c.term.weight / variance * error;
  }
  if (waves > kMostWaves)
    refuse("The spectral sampler would need ", waves,
           " waves for this kernel: take a larger periodic_scale, or smaller bounds.");
}

}  // namespace gpis
