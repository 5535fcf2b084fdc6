// All lights of a scene: which are sampled together, and what a ray meets of them.
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
  // After the last add. Every point samples one light of each group: choosing between a sun and a
  // sky at random is more noise than both together. The strongest lights are groups of their own
  // (power; of distant lights what enters the scene's bounding sphere), all others are one group,
  // where half of the samples are chosen by power and half evenly, so that a weak lamp beside an
  // object is not lost. Without `sampling` no light is ever sampled.
  void finish(double scene_radius, bool sampling);

  static constexpr int kMostGroups = 4;
  // 0: nothing to sample, and no shadow ray is ever needed.
  int groups() const { return static_cast<int>(groups_.size()); }
  // The probability of the choice is in pdf (delta lights: in radiance).
  std::optional<LightSample> sample(int group, const Vec3& point, SquarePoint at) const;
  // Radiance that reaches the ray's origin from lights before t_max, weighted against light
  // sampling: `scatter_pdf` is the density with which the scattering chose this direction.
  Color met(const Ray& ray, double t_max, double scatter_pdf) const;
  Color met_by_camera(const Ray& ray, double t_max) const;
  // With which light i is the one that its group samples.
  double probability(std::size_t i) const { return probabilities_[i]; }

 private:
  struct Entry {
    std::unique_ptr<Light> light;
    bool visible_to_camera;
  };
  std::vector<Entry> entries_;
  std::vector<Piecewise1D> groups_;  // over all entries, zero for those of other groups
  std::vector<double> probabilities_;
};

}  // namespace gpis
