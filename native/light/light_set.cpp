#include "light/light_set.h"

namespace gpis {

void LightSet::add(std::unique_ptr<Light> light, bool visible_to_camera) {
  entries_.push_back({std::move(light), visible_to_camera});
}

void LightSet::finish(double scene_radius, bool sampling) {
  std::vector<double> weights;
  for (const Entry& entry : entries_)
    weights.push_back(sampling ? std::max(0.0, entry.light->power(scene_radius)) : 0);
  double sum = 0;
  int shining = 0;
  for (const double w : weights) {
    sum += w;
    shining += w > 0;
  }
  sampled_ = shining > 0;
  for (double& w : weights)
    if (w > 0) w = 0.5 * w / sum + 0.5 / shining;
  choice_ = Piecewise1D(weights);
}

std::optional<LightSample> LightSet::sample(const Vec3& point, Rng& rng) const {
  const int i = choice_.sample(rng.uniform());
  std::optional<LightSample> sample = entries_[i].light->sample(point, rng);
  if (!sample) return sample;
  const double p = choice_.probability(i);
  if (sample->delta()) {
    sample->radiance *= 1 / p;
  } else {
    sample->pdf *= p;
  }
  return sample;
}

Color LightSet::met(const Ray& ray, double t_max, double scatter_pdf) const {
  Color sum;
  for (std::size_t i = 0; i < entries_.size(); ++i)
    if (const auto hit = entries_[i].light->intersect(ray, t_max))
      sum += hit->radiance * balance(scatter_pdf, hit->pdf * probability(i));
  return sum;
}

Color LightSet::met_by_camera(const Ray& ray, double t_max) const {
  Color sum;
  for (const Entry& entry : entries_)
    if (entry.visible_to_camera)
      if (const auto hit = entry.light->intersect(ray, t_max)) sum += hit->radiance;
  return sum;
}

}  // namespace gpis
