#include "process/markov_path.h"

#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

template <class Model>
Term term_of(const GaussianProcess& process) {
  const Term term = single_term(process, "The Markov sampler");
  if (term.radial.family != Model::kFamily)
    refuse("The Markov sampler serves Matern 3/2, Matern 5/2 and Wong, not ",
           process.kernel->describe(), ": take sampler 'auto'.");
  return term;
}

}  // namespace

template <class Model>
MarkovPath<Model>::Plan::Plan(const GaussianProcess& process, const Box3&)
    : line(term_of<Model>(process)) {}

template <class Model>
void MarkovPath<Model>::at(long cell, double t, Rng& rng, double& g, double& dg) {
  const double q = std::clamp(line_.q(t), cell * width_, (cell + 1) * width_);
  const auto right = std::upper_bound(nodes_.begin(), nodes_.end(), q,
                                      [](double x, const Node& node) { return x < node.q; });
  const auto left = right - 1;
  // A state itself, met again through the rounding of t.
  const double rounding = 1e-13 + 1e-15 * q;
  const bool at_left = right == nodes_.end() || q - left->q < rounding;
  if (at_left || right->q - q < rounding) {
    const Node& node = at_left ? *left : *right;
    read(node, g, dg);
    g += line_.per_length(dg) * (q - node.q);
    return;
  }
  const double width = right->q - left->q;
  if (width < kFinest) {
    const double h = Model::kRate * width, s = (q - left->q) / width, r = 1 - s;
    const double c1 = left->z[0] + h * left->z[1] / 3, c2 = right->z[0] - h * right->z[1] / 3;
    g = r * r * (r * left->z[0] + 3 * s * c1) + s * s * (3 * r * c2 + s * right->z[0]);
    dg = 3 * (r * r * (c1 - left->z[0]) + 2 * r * s * (c2 - c1) + s * s * (right->z[0] - c2)) /
         width * line_.inverse_length();
    return;
  }
  Node node{q, {}};
  const auto draw = [&](const Bridge<Model>& bridge) {
    node.z = bridge.from_left * left->z + bridge.from_right * right->z + bridge.factor * noise(rng);
  };
  const double middle = 0.5 * (left->q + right->q);
  const int level = -2 - std::ilogb(width);
  if (std::abs(q - middle) < rounding && width == std::ldexp(kStep, -level) && level < kLevels) {
    node.q = middle;
    draw(kTables.halves[level]);
  } else {
    draw(Bridge<Model>(Model::kRate * (q - left->q), Model::kRate * (right->q - q)));
  }
  counters_->line_normals += Model::kSize;
  read(node, g, dg);
  nodes_.insert(right, node);
}

std::unique_ptr<LineSampler> make_markov(const GaussianProcess& process, const Box3& bounds) {
  const Term term = single_term(process, "The Markov sampler");
  if (term.radial.family == Radial::Family::matern52)
    return make_sampler<MarkovPath<Matern52>, Fields::any>(process, bounds);
  if (term.radial.family == Radial::Family::wong)
    return make_sampler<MarkovPath<Wong>, Fields::any>(process, bounds);
  return make_sampler<MarkovPath<Matern32>, Fields::any>(process, bounds);
}

}  // namespace gpis
