#include "field/mesh_bake.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <map>

#include "field/check.h"
#include "field/eikonal.h"
#include "field/triangle_tree.h"
#include "field/vdb_file.h"

namespace gpis {
namespace {

// An edge of the boundary of the mesh as a chain, with its multiplicity in the vectors' order.
struct OpenEdge {
  Vec3 a, b;
  double count;
};

struct Mesh {
  std::vector<Triangle> triangles;  // facing outwards on the whole, none without area
  std::vector<OpenEdge> open_edges;
  Box3 bounds;
};

Mesh make_mesh(const std::vector<Vec3>& vertices, const std::vector<std::array<int, 3>>& indices) {
  const auto less = [](const Vec3& a, const Vec3& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  };
  std::map<Vec3, int, decltype(less)> places(less);
  std::vector<int> welded;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (!is_finite(vertices[i]))
      refuse("vertices[", i, "] is ", vertices[i], "; it takes finite coordinates.");
    welded.push_back(places.emplace(vertices[i], static_cast<int>(i)).first->second);
  }
  Mesh mesh;
  std::map<std::pair<int, int>, int> edges;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    std::array<int, 3> corner;
    for (int c = 0; c < 3; ++c) {
      const int v = indices[i][c];
      if (v < 0 || static_cast<std::size_t>(v) >= vertices.size())
        refuse("triangles[", i, "] names vertex ", v, "; there are ", vertices.size(), ".");
      corner[c] = welded[v];
    }
    const Triangle t{vertices[corner[0]], vertices[corner[1]], vertices[corner[2]]};
    for (int c = 0; c < 3; ++c) {
      const int a = corner[c], b = corner[(c + 1) % 3];
      if (a < b) ++edges[{a, b}];
      if (a > b) --edges[{b, a}];
    }
    if (!(length(cross(t[1] - t[0], t[2] - t[0])) > 0)) continue;
    for (const Vec3& v : t) mesh.bounds.include(v);
    mesh.triangles.push_back(t);
  }
  if (mesh.triangles.empty())
    refuse("The mesh has ", indices.size(),
           " triangles and none of them has an area: there is no surface to bake.");
  for (const auto& [edge, count] : edges)
    if (count != 0)
      mesh.open_edges.push_back({vertices[edge.first], vertices[edge.second], double(count)});

  double volume = 0;
  const Vec3 middle = (mesh.bounds.min + mesh.bounds.max) / 2;
  for (const Triangle& t : mesh.triangles)
    volume += dot(t[0] - middle, cross(t[1] - middle, t[2] - middle));
  if (volume < 0) {  // inside out
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    for (OpenEdge& e : mesh.open_edges) e.count = -e.count;
  }
  return mesh;
}

// |∇w| off the mesh: Biot and Savart's law for the open edges, each a straight current.
double winding_slope(const std::vector<OpenEdge>& edges, const Vec3& p) {
  Vec3 sum;
  for (const OpenEdge& e : edges) {
    const Vec3 a = e.a - p, b = e.b - p;
    const double la = length(a), lb = length(b), product = la * lb;
    const double denominator = product * (product + dot(a, b));
    if (denominator > 0) sum += cross(a, b) * (e.count * (la + lb) / denominator);
  }
  return length(sum) / (4 * kPi);
}

// True if the surface passes through the middle of the triangle: w exceeds ½ behind it and not
// before it.
bool is_on_surface(const TriangleTree& tree, const Triangle& t) {
  const Vec3 c = (t[0] + t[1] + t[2]) / 3, n = cross(t[1] - t[0], t[2] - t[0]);
  const Vec3 step = n * (1e-3 / std::sqrt(length(n)));
  return tree.winding_number(c - step) > 0.5 && tree.winding_number(c + step) <= 0.5;
}

struct Bake {
  Index3 n;
  double h;
  Vec3 origin;
  std::function<bool(double)> progress;

  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(i) * n[1] + j) * n[2] + k;
  }
  Vec3 point(int i, int j, int k) const {
    return origin + Vec3{double(i), double(j), double(k)} * h;
  }
  // Rows (i, j, all k) in parallel, slice by slice; false if cancelled.
  template <class Row>
  bool rows(double from, double to, const Row& row) const {
    for (int i = 0; i < n[0]; ++i) {
      tbb::parallel_for(0, n[1], [&](int j) { row(i, j); });
      if (!progress(from + (to - from) * (i + 1) / n[0])) return false;
    }
    return true;
  }
  // Whether the grid edges at this node cross the surface.
  bool beside_surface(const std::vector<float>& f, int i, int j, int k) const {
    const bool inside = f[index(i, j, k)] < 0;
    const int at[3] = {i, j, k};
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        int other[3] = {i, j, k};
        other[axis] = at[axis] + step;
        if (other[axis] < 0 || other[axis] >= n[axis]) continue;
        if ((f[index(other[0], other[1], other[2])] < 0) != inside) return true;
      }
    return false;
  }
};

}  // namespace

std::optional<MeshBake> bake_mesh_distance(const std::vector<Vec3>& vertices,
                                           const std::vector<std::array<int, 3>>& triangles,
                                           const std::string& path, int resolution, double margin,
                                           const std::function<bool(double)>& progress) {
  if (resolution < 8 || resolution > 2048)
    refuse("resolution is ", resolution, "; it takes 8 to 2048 nodes along the longest side.");
  if (!(margin >= 0 && std::isfinite(margin)))
    refuse("margin is ", margin, "; it takes a length of 0 or more.");
  const Mesh mesh = make_mesh(vertices, triangles);

  // Nodes: the longest side fits, the others overhang by the same on both ends.
  const Vec3 size = mesh.bounds.max - mesh.bounds.min + Vec3{2, 2, 2} * margin;
  Bake bake{{}, max_component(size) / (resolution - 1), {}, progress};
  for (int axis = 0; axis < 3; ++axis) {
    bake.n[axis] = std::max(2, static_cast<int>(std::ceil(size[axis] / bake.h - 1e-6)) + 1);
    bake.origin[axis] =
        (mesh.bounds.min[axis] + mesh.bounds.max[axis] - (bake.n[axis] - 1) * bake.h) / 2;
  }
  const auto& n = bake.n;
  const TriangleTree tree(mesh.triangles);
  std::atomic<std::size_t> on_surface = 0;
  tbb::parallel_for(std::size_t{0}, mesh.triangles.size(),
                    [&](std::size_t i) { on_surface += is_on_surface(tree, mesh.triangles[i]); });
  if (on_surface == 0)
    refuse(
        "The mesh encloses nothing: seen from everywhere it covers less than half of all "
        "directions. Give it thickness or close it.");
  const MeshBake report{n, bake.h, bake.origin, mesh.open_edges.size(),
                        on_surface < mesh.triangles.size()};
  const bool simple = mesh.open_edges.empty() && !report.meets_itself;

  // Distance to the triangles. The neighbour's plus one voxel is a bound to start from.
  std::vector<float> f(static_cast<std::size_t>(n[0]) * n[1] * n[2]);
  const double far = 2 * length(size);
  if (!bake.rows(0, 0.5, [&](int i, int j) {
        double bound = far;
        for (int k = 0; k < n[2]; ++k) {
          const double d = tree.distance(bake.point(i, j, k), bound);
          f[bake.index(i, j, k)] = static_cast<float>(d);
          bound = d + 1.001 * bake.h;
        }
      }))
    return std::nullopt;

  // Sign. In a closed mesh it is that of the neighbour where no triangle is as near as that.
  std::atomic<bool> any_inside = false;
  std::vector<float> winding(simple ? 0 : f.size());
  if (!bake.rows(0.5, 0.9, [&](int i, int j) {
        bool inside = false;
        for (int k = 0; k < n[2]; ++k) {
          float& value = f[bake.index(i, j, k)];
          if (!simple || k == 0 || value <= 1.001 * bake.h) {
            const double w = tree.winding_number(bake.point(i, j, k));
            inside = w > 0.5;
            if (!simple) winding[bake.index(i, j, k)] = static_cast<float>(w);
          }
          if (inside) {
            value = -value;
            any_inside = true;
          }
        }
      }))
    return std::nullopt;
  if (!any_inside)
    refuse("No node of the grid lies inside the mesh: it is thinner than a voxel of ", bake.h,
           " everywhere. Raise the resolution (", resolution, ") or give the mesh thickness.");

  if (!simple) {
    std::vector<char> fixed(f.size());
    if (!bake.rows(0.9, 0.95, [&](int i, int j) {
          for (int k = 0; k < n[2]; ++k) {
            const std::size_t at = bake.index(i, j, k);
            // Outside a mesh without holes the nearest triangle is on the surface: that distance is
            // exact.
            fixed[at] = bake.beside_surface(f, i, j, k) || (mesh.open_edges.empty() && f[at] > 0);
          }
        }))
      return std::nullopt;
    if (!bake.rows(0.95, 0.98, [&](int i, int j) {
          for (int k = 0; k < n[2]; ++k) {
            const std::size_t at = bake.index(i, j, k);
            double d = std::abs(f[at]);
            if (fixed[at] && !mesh.open_edges.empty()) {
              const double slope = winding_slope(mesh.open_edges, bake.point(i, j, k));
              if (slope > 0) d = std::min(d, std::abs(winding[at] - 0.5) / slope);
            } else if (!fixed[at] && report.meets_itself) {
              d = far;  // parts of triangles that lie inside bound nothing
            }
            f[at] = std::copysign(static_cast<float>(d), f[at]);
          }
        }))
      return std::nullopt;
    solve_eikonal(f, fixed, n, bake.h);
  }

  write_vdb(path, {n, Vec3{1, 1, 1} * bake.h, bake.origin, {{"mean", 1, std::move(f)}}});
  progress(1);
  return report;
}

}  // namespace gpis
