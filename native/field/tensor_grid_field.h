// A regular grid of symmetric positive definite matrices; each of the six entries is trilinear
// between nodes, which keeps the matrices positive definite: a convex combination of such matrices
// is one (math.md §2). Outside the nodes' box: the nearest value.
#pragma once

#include <functional>
#include <string>

#include "field/brick_grid.h"
#include "field/tensor_field.h"

namespace gpis {

class TensorGridField final : public TensorField {
 public:
  using Bricks = std::array<std::shared_ptr<const BrickGrid>, 6>;  // xx, yy, zz, xy, xz, yz

  // `node_name(i, j, k)` is how a sentence names a node. Refuses a matrix that is not positive
  // definite, naming its node and eigenvalues.
  TensorGridField(Bricks bricks, const Affine& index_to_object,
                  const std::function<std::string(const Index3&)>& node_name);

  SymMat3 value(const Vec3& p) const override;
  TensorSample sample(const Vec3& p) const override;
  TensorSlope along(const Vec3& o, const Vec3& d, double t, double side) const override;
  Range eigenvalues() const override { return eigenvalues_; }
  Range eigenvalues(const Box3& box) const override;
  std::optional<SymMat3> constant() const override;
  std::vector<Vec3> extremes() const override { return extremes_; }
  double kinks(const Vec3& o, const Vec3& d, double t_begin, double t_end) const override;

 private:
  // Where a point in index space lies: its cell, and where in it.
  struct Place {
    Index3 cell;
    Vec3 local;
    bool outside[3];
  };
  Place place(const Vec3& index) const;

  SymMat3 node(const Index3& at) const;
  double kink_at(int axis, const Index3& at) const;
  double kink_across(int axis, const Place& at, int face) const;
  // Over the nodes first … last; `check` is called with the node, the least and the greatest
  // eigenvalue of every one that widens the range.
  template <class Check>
  Range eigenvalues_of_nodes(const Index3& first, const Index3& last, const Check& check) const;
  // Fills kinks_; the node with the largest, none without any.
  std::optional<Index3> find_kinks();

  Bricks bricks_;
  Affine object_to_index_;
  Range eigenvalues_;
  std::vector<Vec3> extremes_;
  // At every node, a bound c of the second difference D of A across it along each axis: -cA <= D <=
  // cA. The same holds between nodes with the largest c of them.
  std::array<std::shared_ptr<const BrickGrid>, 3> kinks_;
};

}  // namespace gpis
