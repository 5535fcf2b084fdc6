// A bounding volume tree over triangles: distance to the nearest one, and the generalized winding
// number of all of them.
#pragma once

#include <array>
#include <vector>

#include "core/vec.h"

namespace gpis {

using Triangle = std::array<Vec3, 3>;

class TriangleTree {
 public:
  explicit TriangleTree(std::vector<Triangle> triangles);

  // Distance to the nearest triangle if it is below `limit`, else limit.
  double distance(const Vec3& p, double limit) const;

  // How often the triangles wind around p: 1 inside a closed surface whose triangles face outwards,
  // 0 outside it, in between near an open one (Jacobson, Kavan, Sorkine-Hornung 2013). Far
  // triangles are summed up by the first two terms of their multipole expansion (Barill, Dickson,
  // Schmidt, Levin, Jacobson 2018).
  double winding_number(const Vec3& p) const;

 private:
  struct Node {
    Box3 box;
    int first, count;  // triangles; all below this node
    int right;         // index of the second child, the first one follows the node; 0 for a leaf
    // Multipole about the area-weighted centre c, of all points x within `radius` of it. dipole: ∫n
    // dA; quadrupole: ∫(x - c) nᵀ dA; and of ∫(x - c)(x - c)n dA what the field needs: its trace
    // over pairs, and the ten coefficients of its cubic form.
    Vec3 center;
    double radius;
    Vec3 dipole;
    Mat3 quadrupole;
    Vec3 octupole_trace;
    std::array<double, 10> octupole;
  };
  void build(int first, int count);

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace gpis
