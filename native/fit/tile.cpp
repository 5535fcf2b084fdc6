#include "fit/tile.h"

#include <bit>

#include "core/rng.h"

namespace gpis {
namespace {

constexpr int kRealisationsBetweenLooks = 16;

std::array<int, 3> tiles_along(const NodeGrid& nodes) {
  std::array<int, 3> tiles;
  for (int axis = 0; axis < 3; ++axis)
    tiles[axis] = (nodes.resolution[axis] - 1) / TileWorker::kSize[axis] + 1;
  return tiles;
}

void write(Fit& fit, std::size_t node, const Jet& jet) {
  fit.mean[node] = static_cast<float>(jet.mean);
  fit.sigma[node] = static_cast<float>(jet.sigma);
  for (int k = 0; k < 6; ++k) fit.anisotropy[6 * node + k] = static_cast<float>(jet.slopes[k]);
}

}  // namespace

int tiles_of(const NodeGrid& nodes) {
  const auto [x, y, z] = tiles_along(nodes);
  return x * y * z;
}

TileWorker::TileWorker(const Composition& composition, const FitQuery& query, const NodeGrid& nodes)
    : composition_(composition),
      query_(query),
      nodes_(nodes),
      tiles_(tiles_along(nodes)),
      jets_(composition.leaves()),
      values_(composition.leaves()),
      weights_(composition.leaves()),
      realisations_(composition.sources()),
      noise_(composition.sources()) {}

void TileWorker::place(int tile) {
  const std::array<int, 3> at{tile / (tiles_[1] * tiles_[2]), tile / tiles_[2] % tiles_[1],
                              tile % tiles_[2]};
  for (int axis = 0; axis < 3; ++axis) {
    first_[axis] = at[axis] * kSize[axis];
    size_[axis] = std::min(kSize[axis], nodes_.resolution[axis] - first_[axis]);
  }
}

bool TileWorker::certain(const Composition::Alive& alive, const Jet* jets) const {
  // With everything drawn, nothing is taken for granted.
  if (query_.certainty < kInfinity && std::has_single_bit(alive.leaves)) return true;
  for (int l = 0; l < composition_.leaves(); ++l)
    if (alive.leaves >> l & 1 && jets[l].sigma > 0) return false;
  return true;
}

std::size_t TileWorker::count(int tile) {
  place(tile);
  std::size_t sampled = 0;
  for (int i = 0; i < size_[0]; ++i)
    for (int j = 0; j < size_[1]; ++j)
      for (int k = 0; k < size_[2]; ++k) {
        const Vec3 x = nodes_.at(first_[0] + i, first_[1] + j, first_[2] + k);
        for (int l = 0; l < composition_.leaves(); ++l) jets_[l] = composition_.value(l, x);
        sampled += !certain(composition_.alive(jets_.data(), query_.certainty), jets_.data());
      }
  return sampled;
}

// A node where nothing has to be drawn: F is its one leaf, or a function of certain ones.
void TileWorker::settle(Fit& fit, std::size_t node, const Vec3& x,
                        const Composition::Alive& alive) {
  for (int l = 0; l < composition_.leaves(); ++l) values_[l] = jets_[l].mean;
  if (std::has_single_bit(alive.leaves)) {
    write(fit, node, composition_.jet(std::countr_zero(alive.leaves), x));
    return;
  }
  Jet jet;
  jet.mean = composition_.tree().compose(values_.data(), weights_.data());
  const auto winner = std::max_element(weights_.begin(), weights_.end()) - weights_.begin();
  jet.slopes = composition_.jet(static_cast<int>(winner), x).slopes;
  write(fit, node, jet);
}

void TileWorker::prepare(Fit& fit, std::size_t node, const std::array<int, 3>& offset,
                         const Vec3& x, const Composition::Alive& alive) {
  for (int l = 0; l < composition_.leaves(); ++l)
    if (alive.leaves >> l & 1) jets_[l] = composition_.jet(l, x);
  const Greatest closed = composition_.closed_form(jets_.data(), alive, query_.closed_form);
  if (query_.closed_form) {
    write(fit, node, closed.jet);
    fit.skewness[node] = static_cast<float>(closed.skewness);
    fit.kolmogorov[node] = static_cast<float>(closed.kolmogorov);
    return;
  }
  Node sampled{node, offset, closed.jet.slopes, {}};
  sampled.moments.reference = closed.mean;
  if (closed.variance > 0) sampled.moments.scale = std::sqrt(closed.variance);
  for (int l = 0; l < composition_.leaves(); ++l) {
    const Jet& jet = jets_[l];
    const double sign = composition_.tree().leaves()[l].sign;
    const Vec3 per_value = jet.sigma > 0 ? jet.sigma_gradient / jet.sigma : Vec3{};
    leaves_.push_back({jet.mean, sign * jet.sigma, jet.mean_gradient, per_value,
                       jet.slopes * (jet.sigma * jet.sigma)});
  }
  used_ |= alive.leaves;
  sampled_.push_back(sampled);
}

void TileWorker::work(int tile, int realisations, const std::atomic<bool>& cancelled, Fit& fit) {
  place(tile);
  sampled_.clear();
  leaves_.clear();
  used_ = 0;
  std::array<int, 3> low = size_, high{-1, -1, -1};
  for (int i = 0; i < size_[0]; ++i)
    for (int j = 0; j < size_[1]; ++j)
      for (int k = 0; k < size_[2]; ++k) {
        const std::array<int, 3> offset{i, j, k};
        const std::size_t node = nodes_.index(first_[0] + i, first_[1] + j, first_[2] + k);
        const Vec3 x = nodes_.at(first_[0] + i, first_[1] + j, first_[2] + k);
        for (int l = 0; l < composition_.leaves(); ++l) jets_[l] = composition_.value(l, x);
        const Composition::Alive alive = composition_.alive(jets_.data(), query_.certainty);
        if (certain(alive, jets_.data())) {
          settle(fit, node, x, alive);
          continue;
        }
        prepare(fit, node, offset, x, alive);
        for (int axis = 0; axis < 3; ++axis) {
          low[axis] = std::min(low[axis], offset[axis]);
          high[axis] = std::max(high[axis], offset[axis]);
        }
      }
  if (sampled_.empty()) return;

  for (int axis = 0; axis < 3; ++axis) {
    box_first_[axis] = low[axis];
    box_size_[axis] = high[axis] - low[axis] + 1;
  }
  drawn_ += sampled_.size();
  filled_ += static_cast<std::size_t>(box_size_[0]) * box_size_[1] * box_size_[2];
  const bool smooth = composition_.tree().has_blends();
  for (int r = 0; r < realisations; ++r) {
    if (r % kRealisationsBetweenLooks == 0 && cancelled) return;
    draw(r);
    smooth ? add_smooth() : add();
  }
  for (const Node& s : sampled_) {
    const Moments::Summary summary = s.moments.summary(realisations, s.slopes);
    write(fit, s.node, summary.jet);
    fit.mean_error[s.node] = static_cast<float>(summary.mean_error);
    fit.sigma_error[s.node] = static_cast<float>(summary.sigma_error);
    fit.skewness[s.node] = static_cast<float>(summary.skewness);
    fit.kolmogorov[s.node] = static_cast<float>(summary.kolmogorov);
  }
}

// g of the sources that the leaves in use take, over the box of the sampled nodes.
void TileWorker::draw(int realisation) {
  const std::size_t count = static_cast<std::size_t>(box_size_[0]) * box_size_[1] * box_size_[2];
  for (int source = 0; source < composition_.sources(); ++source) {
    bool needed = false;
    for (int l = 0; l < composition_.leaves(); ++l) {
      if (!(used_ >> l & 1)) continue;
      const Mixture& m = composition_.mixture(l);
      needed |= source == 0 ? m.common != 0
                            : m.own != 0 && composition_.tree().leaves()[l].noise == source - 1;
    }
    std::vector<float>& g = noise_[source];
    g.resize(needed ? count : 0);
    if (!needed) continue;
    const GaussianProcess& process =
        *composition_.tree().leaves()[composition_.leaf_of_source(source)].process;
    if (!realisations_[source]) {
      Realisation::check(process, query_.bounds);
      realisations_[source] =
          std::make_unique<Realisation>(process, Realisation::Access::rows, nullptr);
    }
    // One realisation is one function of space, whatever tile looks at it.
    const std::uint64_t key =
        mix64(mix64(mix64(query_.seed) ^ static_cast<std::uint64_t>(realisation)) ^
              static_cast<std::uint64_t>(source));
    Realisation& field = *realisations_[source];
    field.draw(key, process.time);
    field.fill(
        nodes_.at(first_[0] + box_first_[0], first_[1] + box_first_[1], first_[2] + box_first_[2]),
        nodes_.voxel_size, box_size_, g.data());
    const double deviation = std::sqrt(process.kernel->variance());
    if (deviation != 1)
      for (float& value : g) value /= static_cast<float>(deviation);
  }
}

std::size_t TileWorker::drawn_at(const Node& s) const {
  return (static_cast<std::size_t>(s.offset[0] - box_first_[0]) * box_size_[1] + s.offset[1] -
          box_first_[1]) *
             box_size_[2] +
         s.offset[2] - box_first_[2];
}

double TileWorker::drawn_value(const LeafAt& leaf, int number, std::size_t at) const {
  if (!(used_ >> number & 1)) return leaf.mean;
  const Mixture& m = composition_.mixture(number);
  double g = 0;
  if (m.common != 0) g += m.common * noise_[0][at];
  if (m.own != 0) g += m.own * noise_[1 + composition_.tree().leaves()[number].noise][at];
  return leaf.mean + leaf.deviation * g;
}

void TileWorker::add() {
  const ProcessTree& tree = composition_.tree();
  const int count = composition_.leaves();
  const LeafAt* leaf = leaves_.data();
  for (Node& s : sampled_) {
    const std::size_t at = drawn_at(s);
    const auto value = [&](int l) { return drawn_value(leaf[l], l, at); };
    const ProcessTree::Winner winner = tree.winner(tree.root(), value);
    const LeafAt& won = leaf[winner.leaf];
    s.moments.add(winner.value, won.gradient + won.per_value * (winner.value - won.mean),
                  won.spread);
    leaf += count;
  }
}

void TileWorker::add_smooth() {
  const ProcessTree& tree = composition_.tree();
  const int count = composition_.leaves();
  const LeafAt* leaf = leaves_.data();
  for (Node& s : sampled_) {
    const std::size_t at = drawn_at(s);
    for (int l = 0; l < count; ++l) values_[l] = drawn_value(leaf[l], l, at);
    const double f = tree.compose(values_.data(), weights_.data());
    // ∇F is the leaves' mixed by their weights; their noises may have something in common.
    Vec3 slope;
    SymMat3 spread;
    for (int a = 0; a < count; ++a) {
      if (weights_[a] == 0) continue;
      slope += (leaf[a].gradient + leaf[a].per_value * (values_[a] - leaf[a].mean)) * weights_[a];
      spread = spread + leaf[a].spread * (weights_[a] * weights_[a]);
      for (int b = 0; b < a; ++b) {
        const double common = composition_.correlation(a, b);
        // Same kernel where there is any correlation: the spreads differ by the deviations.
        if (common != 0 && weights_[b] != 0 && leaf[a].deviation != 0)
          spread = spread + leaf[a].spread * (2 * weights_[a] * weights_[b] * common *
                                              leaf[b].deviation / leaf[a].deviation);
      }
    }
    s.moments.add(f, slope, spread);
    leaf += count;
  }
}

}  // namespace gpis
