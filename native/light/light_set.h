// All lights of a scene: choice of one to sample, and what a ray meets of them.
#pragma once

#include "light/light.h"
#include "light/piecewise.h"

namespace gpis {

// Balance heuristic (Veach 1997): the weight of a strategy of density `own` when the other one has
// density `other`. An infinite density is a strategy without alternative (delta distributions,
// camera rays).
inline double balance(double own, double other) {
  return own == kInfinity ? 1 : own / (own + other);
}

class LightSet {
 public:
  void add(std::unique_ptr<Light> light, bool visible_to_camera);
  // After the last add. Half of the samples are chosen by power (distant lights: what enters the
  // scene's bounding sphere), half evenly, so that a weak lamp beside an object is not lost behind
  // the sky. Without `sampling` no light is ever sampled.
  void finish(double scene_radius, bool sampling);

  // False: nothing to sample, and no shadow ray is ever needed.
  bool sampled() const { return sampled_; }
  // The probability of the choice is in pdf (delta lights: in radiance).
  std::optional<LightSample> sample(const Vec3& point, Rng& rng) const;
  // Radiance that reaches the ray's origin from lights before t_max, weighted against light
  // sampling: `scatter_pdf` is the density with which the scattering chose this direction.
  Color met(const Ray& ray, double t_max, double scatter_pdf) const;
  Color met_by_camera(const Ray& ray, double t_max) const;
  double probability(std::size_t i) const { return choice_.probability(static_cast<int>(i)); }

 private:
  struct Entry {
    std::unique_ptr<Light> light;
    bool visible_to_camera;
  };
  std::vector<Entry> entries_;
  Piecewise1D choice_;
  bool sampled_ = false;
};

}  // namespace gpis
