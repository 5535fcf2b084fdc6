// What the spectral sampler needs once per object: its terms and the tables of their spectra.
#include "field/check.h"
#include "process/spectral_path.h"

namespace gpis {
namespace {

// Tables for lines of 8, 16, 32, … length scales, each line takes the shortest that it fits in.
// Those beyond kEveryReach are made where finite bounds ask for them. Lines longer than the last
// take it all the same: correlations at lags within its reach are right on a line of any length,
// those beyond are not (the plan says so).
constexpr double kShortest = 8, kEveryReach = 256;
constexpr std::size_t kMostWaves = 1 << 17, kMostLongWaves = 1 << 13;  // in all, in a long table
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
  std::size_t waves = 0;  // on a line that takes the last tables
  for (std::size_t i = 0; i < radials.size(); ++i) {
    const bool constant = radials[i].family == Radial::Family::constant;
    std::size_t per_frequency = 0, most = 1;
    for (const Component& c : components)
      if (c.table == i) per_frequency += c.term.modulated() ? 2 : 1;
    Table table;
    for (double next = kShortest; next < 2 * longest[i] || table.empty(); next *= 2) {
      if (next > kEveryReach && !std::isfinite(longest[i])) break;
      std::optional<LineSpectrum> spectrum = line_spectrum(radials[i], next);
      const std::size_t count = spectrum ? spectrum->weight.size() : 0;
      if (next > kEveryReach && (!spectrum || count * per_frequency > kMostLongWaves)) break;
      if (!spectrum)
        refuse("The spectral sampler does not reach a rational quadratic kernel of alpha ",
               radials[i].alpha, " over ", next, " length scales: take a larger alpha.");
      most = std::max(most, count);
      table.push_back(std::move(*spectrum));
      if (constant) break;
    }
    waves += most * per_frequency;
    if (!constant && table.back().reach < longest[i]) {
      reach = std::min(reach, table.back().reach);
      if (std::isfinite(longest[i]))
        known_share = std::min(known_share, table.back().reach / longest[i]);
    }
    tables.push_back(std::move(table));
  }
  for (const Component& c : components) {
    double error = 0;
    for (const LineSpectrum& s : tables[c.table]) error = std::max(error, s.error);
    correlation_error += c.term.weight / variance * error;
  }
  if (waves > kMostWaves)
    refuse("The spectral sampler would need ", waves,
           " waves for this kernel: take a larger periodic_scale, or smaller bounds.");
}

}  // namespace gpis
