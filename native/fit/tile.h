// One tile of a fit: which of its nodes have to be sampled, and their moments. Tiles are whole in
// memory while they are worked on, so what a fit takes does not grow with the realisations.
#pragma once

#include <atomic>
#include <memory>

#include "fit/composition.h"
#include "fit/fit.h"
#include "fit/moments.h"
#include "process/realisation.h"

namespace gpis {

// What one thread needs to work on tiles.
class TileWorker {
 public:
  static constexpr std::array<int, 3> kSize{16, 16, 32};

  TileWorker(const Composition& composition, const FitQuery& query, const NodeGrid& nodes);

  // Nodes that have to be sampled.
  std::size_t count(int tile);
  // Fills `fit` at the nodes of the tile, with G in place of the anisotropy. Stops early once
  // `cancelled`.
  void work(int tile, int realisations, const std::atomic<bool>& cancelled, Fit& fit);

  std::size_t drawn() const { return drawn_; }
  std::size_t filled() const { return filled_; }

 private:
  // A leaf at a sampled node, ready for its values: F = mean + deviation · g there.
  struct LeafAt {
    double mean, deviation;
    Vec3 gradient, per_value;  // E[∇F | f] = gradient + per_value · (f - mean)
    SymMat3 spread;            // covariance of ∇F given f
  };
  struct Node {
    std::size_t node;           // of the grid
    std::array<int, 3> offset;  // in the tile
    SymMat3 slopes;             // G of the leaf that mostly wins
    Moments moments;
  };
  void place(int tile);
  bool certain(const Composition::Alive& alive, const Jet* jets) const;
  void settle(Fit& fit, std::size_t node, const Vec3& x, const Composition::Alive& alive);
  void prepare(Fit& fit, std::size_t node, const std::array<int, 3>& offset, const Vec3& x,
               const Composition::Alive& alive);
  void draw(int realisation);
  // Where a node's values are in the box that was drawn, and the value of one of its leaves.
  std::size_t drawn_at(const Node& s) const;
  double drawn_value(const LeafAt& leaf, int number, std::size_t at) const;
  void add();
  void add_smooth();

  const Composition& composition_;
  const FitQuery& query_;
  const NodeGrid& nodes_;
  std::array<int, 3> tiles_, first_{}, size_{};
  std::size_t drawn_ = 0, filled_ = 0;

  std::vector<Jet> jets_;  // of the leaves at the node in hand
  std::vector<double> values_, weights_;
  std::vector<Node> sampled_;
  std::vector<LeafAt> leaves_;                              // leaf l of sampled node n: n·L + l
  std::uint64_t used_ = 0;                                  // leaves that may win somewhere here
  std::vector<std::unique_ptr<Realisation>> realisations_;  // by source, made when first needed
  std::array<int, 3> box_first_{}, box_size_{};             // around the sampled nodes
  std::vector<std::vector<float>> noise_;                   // by source
};

// Tiles of a grid.
int tiles_of(const NodeGrid& nodes);

}  // namespace gpis
