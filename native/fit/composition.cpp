#include "fit/composition.h"

#include "field/check.h"
#include "fit/blend_moments.h"

namespace gpis {
namespace {

using Kind = ProcessTree::Kind;

std::uint64_t bit(int i) {
  return std::uint64_t{1} << i;
}

// Distance from a box, with its gradient; 0 inside.
FieldSample distance_to(const Box3& box, const Vec3& x) {
  Vec3 d;
  for (int axis = 0; axis < 3; ++axis)
    d[axis] = x[axis] < box.min[axis]   ? x[axis] - box.min[axis]
              : x[axis] > box.max[axis] ? x[axis] - box.max[axis]
                                        : 0.0;
  const double distance = length(d);
  return {distance, distance > 0 ? d / distance : Vec3{}};
}

// The greatest of two turned into the least: of the negated.
Jet negated(Jet jet) {
  jet.mean = -jet.mean;
  jet.mean_gradient = -jet.mean_gradient;
  return jet;
}

}  // namespace

Composition::Composition(TreePtr tree, double correlation)
    : tree_(std::move(tree)), correlation_(correlation) {
  if (tree_->nodes().size() > static_cast<std::size_t>(kMostNodes))
    refuse("A fit takes trees of up to ", kMostNodes, " operands and operations, this one has ",
           tree_->nodes().size(), ". Fit a part of it first.");
  const int noises = tree_->noises();
  if (correlation != 0) tree_->check_one_kernel("compose_and_fit with a correlation");
  if (correlation < 0 && noises > 2)
    refuse("correlation is ", correlation, ": more than two operands cannot all be opposed.");
  const double common = std::sqrt(std::abs(correlation)),
               own = std::sqrt(1 - std::abs(correlation));
  for (std::size_t i = 0; i < tree_->leaves().size(); ++i) {
    const ProcessTree::Leaf& leaf = tree_->leaves()[i];
    const GaussianProcess& process = *leaf.process;
    if (!process.kernel->differentiable())
      refuse("Operand ", i, ": the kernel ", process.kernel->describe(),
             " has no gradient, and length scales are fitted to gradients: take Matern 3/2 for a "
             "rough surface.");
    if (process.conditions)
      refuse("Operand ", i,
             " has conditions; a fit takes operands without: what is known at points is no "
             "stationary covariance.");
    Covariance covariance(process);
    const double variance = covariance.variance();
    const SymMat3 slopes =
        process.anisotropy ? SymMat3{}
                           : SymMat3::of(process.kernel->derivative_covariance()) * (1 / variance);
    leaves_.push_back({leaf.process, leaf.sign, std::sqrt(variance), covariance, slopes});
    mixtures_.push_back({correlation < 0 && leaf.noise == 1 ? -common : common, own});
  }
}

int Composition::leaf_of_source(int source) const {
  for (int i = 0; i < leaves(); ++i)
    if (source == 0 || tree_->leaves()[i].noise == source - 1) return i;
  return -1;
}

double Composition::correlation(int a, int b) const {
  return tree_->leaves()[a].noise == tree_->leaves()[b].noise ? 1.0 : correlation_;
}

Jet Composition::value(int leaf, const Vec3& x) const {
  const Leaf& l = leaves_[leaf];
  const double mean = l.process->mean->value(x);
  if (l.process->bounds) {
    const double outside = distance_to(*l.process->bounds, x).value;
    if (outside > 0) return {l.sign * std::max(mean, outside), 0, {}, {}, {}};
  }
  return {l.sign * mean, l.weight * l.process->sigma->value(x), {}, {}, {}};
}

Jet Composition::jet(int leaf, const Vec3& x) const {
  const Leaf& l = leaves_[leaf];
  const FieldSample mean = l.process->mean->sample(x);
  SymMat3 slopes = l.slopes;
  if (l.process->anisotropy) {
    const LocalPoint at = l.covariance.at(x);
    const Eigen::Matrix4d block = l.covariance.block(at, at) / l.covariance.variance();
    slopes = {block(1, 1), block(2, 2), block(3, 3), block(1, 2), block(1, 3), block(2, 3)};
  }
  if (l.process->bounds) {
    const FieldSample outside = distance_to(*l.process->bounds, x);
    if (outside.value > 0) {
      const FieldSample& f = mean.value > outside.value ? mean : outside;
      return {l.sign * f.value, 0, f.gradient * l.sign, {}, slopes};
    }
  }
  const FieldSample sigma = l.process->sigma->sample(x);
  return {l.sign * mean.value, l.weight * sigma.value, mean.gradient * l.sign,
          sigma.gradient * l.weight, slopes};
}

// Whether node a exceeds node b by more than `margin`, but for what `certainty` leaves out.
bool Composition::above(int a, int b, const Jet* leaves, double certainty, double margin) const {
  const auto& nodes = tree_->nodes();
  const ProcessTree::Node &na = nodes[a], &nb = nodes[b];
  if (na.kind != Kind::leaf) {
    // A blend takes a quarter of its radius off the least, and puts it onto the greatest.
    const bool least = na.kind == Kind::least;
    const double more = margin + (least ? na.blend / 4 : 0);
    for (const int child : na.children)
      if (above(child, b, leaves, certainty, more) != least) return !least;
    return least;
  }
  if (nb.kind != Kind::leaf) {
    const bool greatest = nb.kind == Kind::greatest;
    const double more = margin + (greatest ? nb.blend / 4 : 0);
    for (const int child : nb.children)
      if (above(a, child, leaves, certainty, more) != greatest) return !greatest;
    return greatest;
  }
  const Jet &x = leaves[na.leaf], &y = leaves[nb.leaf];
  const double rho =
      tree_->leaves()[na.leaf].sign * tree_->leaves()[nb.leaf].sign * correlation(na.leaf, nb.leaf);
  const double difference = x.sigma - y.sigma;
  const double variance = difference * difference + 2 * x.sigma * y.sigma * (1 - rho);
  const double nu = variance > 0 ? std::sqrt(variance) : 0.0;
  const double by = x.mean - y.mean - margin;
  // Of two that are the same variable one counts: a body is its union with itself.
  return nu > 0 ? by > certainty * nu : by > 0 || (by == 0 && margin == 0 && a > b);
}

void Composition::mark(int node, const Jet* leaves, double certainty, Alive& out) const {
  const ProcessTree::Node& n = tree_->nodes()[node];
  out.nodes |= bit(node);
  if (n.kind == Kind::leaf) {
    out.leaves |= bit(n.leaf);
    return;
  }
  for (const int child : n.children) {
    bool beaten = false;
    for (const int other : n.children)
      if (other != child && !beaten)
        beaten = n.kind == Kind::least ? above(child, other, leaves, certainty, n.blend)
                                       : above(other, child, leaves, certainty, n.blend);
    if (!beaten) mark(child, leaves, certainty, out);
  }
}

Composition::Alive Composition::alive(const Jet* leaves, double certainty) const {
  Alive out;
  mark(tree_->root(), leaves, certainty, out);
  return out;
}

Composition::Partial Composition::fold(int node, const Jet* jets, const Alive& alive,
                                       bool shape) const {
  const ProcessTree::Node& n = tree_->nodes()[node];
  if (n.kind == Kind::leaf) {
    const Jet& jet = jets[n.leaf];
    Partial leaf{{jet.mean, jet.sigma * jet.sigma, 0, 0, 1, jet}, {}};
    const double deviation = leaves_[n.leaf].sign * jet.sigma;
    leaf.along[0] = deviation * mixtures_[n.leaf].common;
    leaf.along[1 + tree_->leaves()[n.leaf].noise] = deviation * mixtures_[n.leaf].own;
    return leaf;
  }
  const bool least = n.kind == Kind::least;
  Partial best;
  bool first = true;
  for (const int child : n.children) {
    if (!(alive.nodes & bit(child))) continue;
    const Partial part = fold(child, jets, alive, shape);
    if (first) {
      best = part;
      first = false;
      continue;
    }
    double covariance = 0;
    for (int s = 0; s < sources(); ++s) covariance += best.along[s] * part.along[s];
    Jet a = best.greatest.jet, b = part.greatest.jet;
    if (least) a = negated(a), b = negated(b);
    Greatest g = n.blend > 0 ? smooth_greatest(a, b, covariance, n.blend, shape)
                             : greatest(a, b, covariance, shape);
    if (least) {
      g.mean = -g.mean;
      g.skewness = -g.skewness;
      g.jet = negated(g.jet);
    }
    for (int s = 0; s < sources(); ++s)
      best.along[s] = g.first_share * best.along[s] + (1 - g.first_share) * part.along[s];
    best.greatest = g;
  }
  return best;
}

Greatest Composition::closed_form(const Jet* leaves, const Alive& alive, bool shape) const {
  return fold(tree_->root(), leaves, alive, shape).greatest;
}

}  // namespace gpis
