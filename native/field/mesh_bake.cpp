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

// The grid of one bake. Its steps return false where `progress` cancelled.
class Bake {
 public:
  // The longest side fits, the others overhang by the same on both ends.
  Bake(const Mesh& mesh, int resolution, double margin, std::function<bool(double)> progress)
      : mesh_(mesh), tree_(mesh.triangles), progress_(std::move(progress)) {
    const Vec3 size = mesh.bounds.max - mesh.bounds.min + Vec3{2, 2, 2} * margin;
    h_ = max_component(size) / (resolution - 1);
    for (int i = 0; i < 3; ++i) {
      n_[i] = std::max(2, static_cast<int>(std::ceil(size[i] / h_ - 1e-6)) + 1);
      origin_[i] = (mesh.bounds.min[i] + mesh.bounds.max[i] - (n_[i] - 1) * h_) / 2;
    }
    far_ = 2 * length(size);
    f_.resize(static_cast<std::size_t>(n_[0]) * n_[1] * n_[2]);

    std::atomic<std::size_t> on_surface = 0;
    tbb::parallel_for(std::size_t{0}, mesh.triangles.size(), [&](std::size_t i) {
      on_surface += is_on_surface(tree_, mesh.triangles[i]);
    });
    if (on_surface == 0)
      refuse(
          "The mesh encloses nothing: seen from everywhere it covers less than half of all "
          "directions. Give it thickness or close it.");
    meets_itself_ = on_surface < mesh.triangles.size();
  }

  MeshBake report() const { return {n_, h_, origin_, mesh_.open_edges.size(), meets_itself_}; }
  bool simple() const { return mesh_.open_edges.empty() && !meets_itself_; }

  // |f| is the distance to the triangles. The neighbour's plus one voxel is a bound to start from.
  bool measure() {
    return rows(0, 0.5, [this](int i, int j) {
      double bound = far_;
      for (int k = 0; k < n_[2]; ++k) {
        const double d = tree_.distance(point(i, j, k), bound);
        f_[index(i, j, k)] = static_cast<float>(d);
        bound = d + 1.001 * h_;
      }
    });
  }

  // f is negative inside. In a closed mesh a node is where its neighbour is, if no triangle is as
  // near as that.
  bool sign() {
    std::atomic<bool> any_inside = false;
    if (!simple()) winding_.resize(f_.size());
    const bool done = rows(0.5, 0.9, [&](int i, int j) {
      bool inside = false;
      for (int k = 0; k < n_[2]; ++k) {
        const std::size_t at = index(i, j, k);
        if (!simple() || k == 0 || f_[at] <= 1.001 * h_) {
          const double w = tree_.winding_number(point(i, j, k));
          inside = w > 0.5;
          if (!simple()) winding_[at] = static_cast<float>(w);
        }
        if (inside) {
          f_[at] = -f_[at];
          any_inside = true;
        }
      }
    });
    if (done && !any_inside)
      refuse("No node of the grid lies inside the mesh: it is thinner than a voxel of ", h_,
             " everywhere. Raise the resolution or give the mesh thickness.");
    return done;
  }

  // |f| is the distance to the surface, where that is more or less than the triangles.
  bool close() {
    std::vector<char> fixed(f_.size());
    const bool done =
        rows(0.9, 0.95,
             [&](int i, int j) {
               for (int k = 0; k < n_[2]; ++k) {
                 const std::size_t at = index(i, j, k);
                 // Outside a mesh without holes the nearest triangle is on the surface: that
                 // distance is exact.
                 fixed[at] = beside_surface(i, j, k) || (mesh_.open_edges.empty() && f_[at] > 0);
               }
             }) &&
        rows(0.95, 0.98, [&](int i, int j) {
          for (int k = 0; k < n_[2]; ++k) {
            const std::size_t at = index(i, j, k);
            double d = std::abs(f_[at]);
            if (fixed[at] && !mesh_.open_edges.empty()) {
              const double slope = winding_slope(mesh_.open_edges, point(i, j, k));
              if (slope > 0) d = std::min(d, std::abs(winding_[at] - 0.5) / slope);
            } else if (!fixed[at] && meets_itself_) {
              d = far_;  // parts of triangles that lie inside bound nothing
            }
            f_[at] = std::copysign(static_cast<float>(d), f_[at]);
          }
        });
    if (done) solve_eikonal(f_, fixed, n_, h_);
    return done;
  }

  std::vector<float> take() { return std::move(f_); }

 private:
  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(i) * n_[1] + j) * n_[2] + k;
  }
  Vec3 point(int i, int j, int k) const {
    return origin_ + Vec3{double(i), double(j), double(k)} * h_;
  }
  // Rows (i, j, all k) in parallel, slice by slice.
  template <class Row>
  bool rows(double from, double to, const Row& row) const {
    for (int i = 0; i < n_[0]; ++i) {
      tbb::parallel_for(0, n_[1], [&](int j) { row(i, j); });
      if (!progress_(from + (to - from) * (i + 1) / n_[0])) return false;
    }
    return true;
  }
  // Whether a grid edge at this node crosses the surface.
  bool beside_surface(int i, int j, int k) const {
    const bool inside = f_[index(i, j, k)] < 0;
    const Index3 at{i, j, k};
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        Index3 other = at;
        other[axis] += step;
        if (other[axis] < 0 || other[axis] >= n_[axis]) continue;
        if ((f_[index(other[0], other[1], other[2])] < 0) != inside) return true;
      }
    return false;
  }

  const Mesh& mesh_;
  TriangleTree tree_;
  std::function<bool(double)> progress_;
  Index3 n_;
  double h_, far_;
  Vec3 origin_;
  bool meets_itself_;
  std::vector<float> f_, winding_;
};

}  // namespace

std::optional<MeshBake> bake_mesh_distance(const std::vector<Vec3>& vertices,
                                           const std::vector<std::array<int, 3>>& triangles,
                                           const std::string& path, int resolution, double margin,
                                           double narrow_band,
                                           const std::function<bool(double)>& progress) {
  if (resolution < 8 || resolution > 2048)
    refuse("resolution is ", resolution, "; it takes 8 to 2048 nodes along the longest side.");
  if (!(margin >= 0 && std::isfinite(margin)))
    refuse("margin is ", margin, "; it takes a length of 0 or more.");
  if (!(narrow_band >= 0 && std::isfinite(narrow_band)))
    refuse("narrow_band is ", narrow_band, "; it takes a length, or 0 for the whole box.");
  const Mesh mesh = make_mesh(vertices, triangles);
  Bake bake(mesh, resolution, margin, progress);
  // The slope at the surface is that of the cell which holds it, and brushes look one node further.
  const double voxel = bake.report().voxel_size;
  if (narrow_band > 0 && narrow_band < 3 * voxel)
    refuse("narrow_band is ", narrow_band, "; with voxels of ", voxel,
           " it takes at least three of them, ", 3 * voxel, ", or 0 for the whole box.");
  if (!bake.measure() || !bake.sign()) return std::nullopt;
  if (!bake.simple() && !bake.close()) return std::nullopt;
  const MeshBake report = bake.report();
  std::vector<float> distance = bake.take();
  if (narrow_band > 0)
    for (float& d : distance) d = std::clamp(d, -float(narrow_band), float(narrow_band));
  write_vdb(path, {report.resolution,
                   Vec3{1, 1, 1} * report.voxel_size,
                   report.origin,
                   {{"mean", 1, std::move(distance)}}});
  progress(1);
  return report;
}

}  // namespace gpis
