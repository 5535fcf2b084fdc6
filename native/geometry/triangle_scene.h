// Triangle meshes and their instances, traced by Embree in single precision.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/counters.h"
#include "core/vec.h"

namespace gpis {

// A view of arrays that outlive the TriangleScene.
struct TriangleMesh {
  std::span<const float> vertices;           // (N, 3)
  std::span<const std::uint32_t> triangles;  // (M, 3)
  std::span<const float> normals;            // (N, 3), or (M, 3, 3) per corner, or empty: flat
  bool normals_per_corner = false;
  std::span<const std::int32_t> material_index;  // (M) or empty: 0
};

struct MeshHit {
  double t = kInfinity;
  Vec3 position;          // from the barycentric coordinates: nearer to the triangle than ray.at(t)
  Vec3 geometric_normal;  // unit, either side
  Vec3 shading_normal;    // unit, on the side of the geometric normal
  double offset = 0;  // along the geometric normal, to a point from which a ray does not meet the
                      // same surface again
  int instance = -1;
  int material_index = 0;
};

class TriangleScene {
 public:
  TriangleScene();
  ~TriangleScene();
  // Meshes and instances are numbered from 0 in the order of adding. A mesh with one instance costs
  // no transform of rays.
  void add_mesh(const TriangleMesh& mesh);
  void add_instance(int mesh, const Affine& to_world);
  // Builds the hierarchy; after it, the scene is immutable and shared by threads. Throws
  // std::runtime_error if Embree fails.
  void commit();

  Box3 bounds() const;
  bool intersect(const Ray& ray, double t_max, MeshHit& hit, Counters& counters) const;
  bool occluded(const Ray& ray, double t_max, Counters& counters) const;

 private:
  // Whether the ray comes near any triangle: others are not handed to Embree.
  bool reached(const Ray& ray, double t_max) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace gpis
