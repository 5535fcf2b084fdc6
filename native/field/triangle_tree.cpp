#include "field/triangle_tree.h"

#include <algorithm>

namespace gpis {
namespace {

constexpr int kLeaf = 4;    // triangles of a leaf
constexpr int kStack = 64;  // a tree of halves is no deeper
// Radii from which the expansion is used: errors of up to 2e-3.
constexpr double kFar = 2.5;

Vec3 centroid(const Triangle& t) {
  return (t[0] + t[1] + t[2]) / 3;
}
Vec3 area_normal(const Triangle& t) {
  return cross(t[1] - t[0], t[2] - t[0]) / 2;
}

// Nearest point by the region of the triangle p projects to (Ericson 2004, "Real-time collision
// detection", 5.1.5).
double squared_distance(const Triangle& t, const Vec3& p) {
  const auto square = [&](const Vec3& q) { return dot(p - q, p - q); };
  const Vec3 ab = t[1] - t[0], ac = t[2] - t[0], ap = p - t[0];
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return square(t[0]);
  const Vec3 bp = p - t[1];
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return square(t[1]);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return square(t[0] + ab * (d1 / (d1 - d3)));
  const Vec3 cp = p - t[2];
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return square(t[2]);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return square(t[0] + ac * (d2 / (d2 - d6)));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return square(t[1] + (t[2] - t[1]) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
  const Vec3 n = cross(ab, ac);
  const double height = dot(n, ap);
  return height * height / dot(n, n);
}

double squared_distance(const Box3& box, const Vec3& p) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    const double d = std::max({box.min[i] - p[i], 0.0, p[i] - box.max[i]});
    sum += d * d;
  }
  return sum;
}

// Solid angle seen from p (van Oosterom, Strackee 1983).
double solid_angle(const Triangle& t, const Vec3& p) {
  const Vec3 a = t[0] - p, b = t[1] - p, c = t[2] - p;
  const double la = length(a), lb = length(b), lc = length(c);
  return 2 * std::atan2(dot(a, cross(b, c)),
                        la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

// Coefficients of x³, y³, z³, x²y, x²z, y²x, y²z, z²x, z²y, xyz.
double cubic_form(const std::array<double, 10>& c, const Vec3& r) {
  return r.x * r.x * (c[0] * r.x + c[3] * r.y + c[4] * r.z) +
         r.y * r.y * (c[1] * r.y + c[5] * r.x + c[6] * r.z) +
         r.z * r.z * (c[2] * r.z + c[7] * r.x + c[8] * r.y) + c[9] * r.x * r.y * r.z;
}

// The second moment of a triangle's area is (a/12)(Σ v vᵀ + (Σ v)(Σ v)ᵀ), v its vertices.
void add_octupole(const Triangle& t, const Vec3& center, Vec3& trace, std::array<double, 10>& c) {
  const Vec3 n = area_normal(t) / 12;
  const std::array<Vec3, 4> arms{t[0] - center, t[1] - center, t[2] - center,
                                 centroid(t) * 3 - center * 3};
  for (const Vec3& v : arms) {
    trace += n * dot(v, v) + v * (2 * dot(v, n));
    c[0] += v.x * v.x * n.x;
    c[1] += v.y * v.y * n.y;
    c[2] += v.z * v.z * n.z;
    c[3] += v.x * v.x * n.y + 2 * v.x * v.y * n.x;
    c[4] += v.x * v.x * n.z + 2 * v.x * v.z * n.x;
    c[5] += v.y * v.y * n.x + 2 * v.x * v.y * n.y;
    c[6] += v.y * v.y * n.z + 2 * v.y * v.z * n.y;
    c[7] += v.z * v.z * n.x + 2 * v.x * v.z * n.z;
    c[8] += v.z * v.z * n.y + 2 * v.y * v.z * n.z;
    c[9] += 2 * (v.x * v.y * n.z + v.x * v.z * n.y + v.y * v.z * n.x);
  }
}

}  // namespace

TriangleTree::TriangleTree(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
  nodes_.reserve(triangles_.size());
  build(0, static_cast<int>(triangles_.size()));
}

void TriangleTree::build(int first, int count) {
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Node node{};
  node.box = {};
  node.first = first;
  node.count = count;
  Box3 centers;
  double area = 0;
  for (int i = first; i < first + count; ++i) {
    const Triangle& t = triangles_[i];
    for (const Vec3& v : t) node.box.include(v);
    centers.include(centroid(t));
    const double a = length(area_normal(t));
    area += a;
    node.center += centroid(t) * a;
  }
  node.center = node.center / area;
  node.quadrupole = {{Vec3{}, Vec3{}, Vec3{}}};
  for (int i = first; i < first + count; ++i) {
    const Triangle& t = triangles_[i];
    const Vec3 n = area_normal(t), arm = centroid(t) - node.center;
    node.dipole += n;
    for (int r = 0; r < 3; ++r) node.quadrupole.row[r] += n * arm[r];
    add_octupole(t, node.center, node.octupole_trace, node.octupole);
    for (const Vec3& v : t) node.radius = std::max(node.radius, length(v - node.center));
  }
  if (count > kLeaf) {
    const Vec3 extent = centers.max - centers.min;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                     : extent.y >= extent.z                       ? 1
                                                                  : 2;
    const int half = count / 2;
    std::nth_element(triangles_.begin() + first, triangles_.begin() + first + half,
                     triangles_.begin() + first + count,
                     [axis](const Triangle& a, const Triangle& b) {
                       return centroid(a)[axis] < centroid(b)[axis];
                     });
    build(first, half);
    node.right = static_cast<int>(nodes_.size());
    build(first + half, count - half);
  }
  nodes_[index] = node;
}

double TriangleTree::distance(const Vec3& p, double limit) const {
  struct Entry {
    int node;
    double square;
  } stack[kStack];
  int top = 0;
  double best = limit * limit;
  stack[top++] = {0, squared_distance(nodes_[0].box, p)};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.square >= best) continue;
    const Node& node = nodes_[entry.node];
    if (node.right == 0) {
      for (int i = node.first; i < node.first + node.count; ++i)
        best = std::min(best, squared_distance(triangles_[i], p));
      continue;
    }
    Entry near{entry.node + 1, squared_distance(nodes_[entry.node + 1].box, p)};
    Entry far{node.right, squared_distance(nodes_[node.right].box, p)};
    if (far.square < near.square) std::swap(near, far);
    stack[top++] = far;
    stack[top++] = near;
  }
  return best < limit * limit ? std::sqrt(best) : limit;
}

double TriangleTree::winding_number(const Vec3& p) const {
  int stack[kStack];
  int top = 0;
  stack[top++] = 0;
  double angle = 0;
  while (top > 0) {
    const int index = stack[--top];
    const Node& node = nodes_[index];
    const Vec3 r = node.center - p;
    const double square = dot(r, r);
    if (square > kFar * kFar * node.radius * node.radius) {
      const double inverse = 1 / std::sqrt(square);
      const Vec3 u = r * inverse;
      const Mat3& q = node.quadrupole;
      // Derivatives of r/|r|³ of order 0, 1 and 2, contracted with the moments.
      const double first = q.row[0].x + q.row[1].y + q.row[2].z - 3 * dot(u, q * u);
      const double second = 15 * cubic_form(node.octupole, u) - 3 * dot(node.octupole_trace, u);
      angle += inverse * inverse * (dot(node.dipole, u) + inverse * (first + inverse * second / 2));
    } else if (node.right == 0) {
      for (int i = node.first; i < node.first + node.count; ++i)
        angle += solid_angle(triangles_[i], p);
    } else {
      stack[top++] = node.right;
      stack[top++] = index + 1;
    }
  }
  return angle / (4 * kPi);
}

}  // namespace gpis
