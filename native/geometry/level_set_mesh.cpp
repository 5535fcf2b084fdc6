#include "geometry/level_set_mesh.h"

#include <stdexcept>
#include <utility>

namespace gpis {
namespace {

// A corner of a cell is three bits, x y z. The six tetrahedra are the paths from corner 000 to 111
// along the axes in every order; even orders have positive volume.
struct Tetrahedron {
  std::array<int, 4> corner;
  bool positive;
};
constexpr Tetrahedron path(int a, int b, bool positive) {
  return {{0, 1 << a, (1 << a) | (1 << b), 7}, positive};
}
constexpr std::array<Tetrahedron, 6> kTetrahedra{path(0, 1, true),  path(1, 2, true),
                                                 path(2, 0, true),  path(1, 0, false),
                                                 path(2, 1, false), path(0, 2, false)};

class Marcher {
 public:
  Marcher(const float* values, const std::array<int, 3>& nodes, const Vec3& voxel_size,
          const Vec3& origin, double level)
      : values_(values),
        n_(nodes),
        h_(voxel_size),
        origin_(origin),
        level_(level),
        slice_(static_cast<std::size_t>(nodes[1]) * nodes[2] * 8) {
    for (auto& edges : edge_vertex_) edges.assign(slice_, -1);
  }

  LevelSetMesh run() {
    for (int i = 0; i + 1 < n_[0]; ++i) {
      for (int j = 0; j + 1 < n_[1]; ++j)
        for (int k = 0; k + 1 < n_[2]; ++k) cell({i, j, k});
      edge_vertex_[i % 2].assign(slice_, -1);  // for slice i + 2
    }
    return std::move(mesh_);
  }

 private:
  using Node = std::array<int, 3>;

  static Node moved(const Node& at, int corner) {
    return {at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)};
  }
  double value(const Node& at) const {
    return values_[(static_cast<std::size_t>(at[0]) * n_[1] + at[1]) * n_[2] + at[2]];
  }

  void cell(const Node& at) {
    double v[8];
    unsigned inside = 0;
    for (int c = 0; c < 8; ++c) {
      v[c] = value(moved(at, c));
      inside |= (v[c] < level_ ? 1u : 0u) << c;
    }
    if (inside == 0 || inside == 255) return;
    for (const Tetrahedron& t : kTetrahedra) tetrahedron(at, v, inside, t);
  }

  void tetrahedron(const Node& at, const double* v, unsigned inside, const Tetrahedron& t) {
    // Corners with the inside ones first; every exchange changes the orientation.
    std::array<int, 4> c = t.corner;
    bool positive = t.positive;
    int count = 0;
    for (int i = 0; i < 4; ++i) {
      if (!(inside >> c[i] & 1)) continue;
      if (i != count) {
        std::swap(c[i], c[count]);
        positive = !positive;
      }
      ++count;
    }
    const auto on = [&](int a, int b) { return edge(at, v, c[a], c[b]); };
    // Seen from outside, a tetrahedron (a, b, c, d) of positive volume has b, c, d in
    // counterclockwise order about a towards its far side.
    if (count == 1) {
      triangle(on(0, 1), on(0, 2), on(0, 3), positive);
    } else if (count == 2) {
      const auto p = on(0, 2), q = on(0, 3), r = on(1, 3), s = on(1, 2);
      triangle(p, q, r, positive);
      triangle(p, r, s, positive);
    } else if (count == 3) {
      triangle(on(0, 3), on(1, 3), on(2, 3), positive);
    }
  }

  void triangle(std::int32_t a, std::int32_t b, std::int32_t c, bool positive) {
    if (positive)
      mesh_.triangles.push_back({a, b, c});
    else
      mesh_.triangles.push_back({a, c, b});
  }

  // The vertex on the edge between two corners, one of which contains the bits of the other.
  std::int32_t edge(const Node& at, const double* v, int a, int b) {
    const int low = a & b, high = a | b;
    const Node from = moved(at, low);
    std::int32_t& vertex =
        edge_vertex_[from[0] % 2]
                    [(static_cast<std::size_t>(from[1]) * n_[2] + from[2]) * 8 + (low ^ high)];
    if (vertex < 0) {
      if (mesh_.vertices.size() >= INT32_MAX)
        throw std::invalid_argument("The surface has more than 2^31 vertices; take fewer nodes.");
      vertex = static_cast<std::int32_t>(mesh_.vertices.size());
      const double s = (level_ - v[low]) / (v[high] - v[low]);
      const Node to = moved(at, high);
      Vec3 p;
      for (int axis = 0; axis < 3; ++axis)
        p[axis] = origin_[axis] + h_[axis] * (from[axis] + s * (to[axis] - from[axis]));
      mesh_.vertices.push_back(p);
    }
    return vertex;
  }

  const float* values_;
  const Node n_;
  const Vec3 h_, origin_;
  const double level_;
  // Of the edges that start in the two slices at hand: [(j·Z + k)·8 + direction].
  const std::size_t slice_;
  std::array<std::vector<std::int32_t>, 2> edge_vertex_;
  LevelSetMesh mesh_;
};

}  // namespace

LevelSetMesh level_set_mesh(const float* values, const std::array<int, 3>& nodes,
                            const Vec3& voxel_size, const Vec3& origin, double level) {
  return Marcher(values, nodes, voxel_size, origin, level).run();
}

}  // namespace gpis
