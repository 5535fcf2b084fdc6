// Path tracing with next-event estimation and multiple importance sampling, over meshes and
// stochastic surfaces.
#pragma once

#include <atomic>
#include <memory>

#include "core/block_points.h"
#include "core/counters.h"
#include "core/rng.h"
#include "core/vec.h"

namespace gpis {

class Scene;

// Which of the sample's points places it in its pixel.
inline constexpr int kPixelDecision = 0;

// One camera sample: radiance and first-hit features. Unset features stay zero, depth infinite.
// Depth is the distance along the camera ray to its first hit; the camera's `clip` reaches the
// tracer as the ray's origin (near) and t_max (far).
struct PathSample {
  Color radiance;
  double alpha = 1;
  double depth = kInfinity;
  Vec3 normal;
  Color albedo;
};

// Per-thread working memory (lines, remembered states): made once per thread, reused by every path.
class PathTracer {
 public:
  // Paths end soon after *stop becomes true; what they gathered is then to be dropped.
  explicit PathTracer(const Scene& scene, const std::atomic<bool>* stop = nullptr);
  ~PathTracer();
  // `points`: those of the sample; the tracer leaves the set kPixelDecision to the camera.
  PathSample trace(const Ray& camera_ray, double t_max, const BlockPoints& points, Rng& rng,
                   Counters& counters);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace gpis
