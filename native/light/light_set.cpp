#include "light/light_set.h"

#include <algorithm>

namespace gpis {

void LightSet::add(std::unique_ptr<Light> light, bool visible_to_camera) {
  entries_.push_back({std::move(light), visible_to_camera});
}

void LightSet::finish(double scene_radius, bool sampling) {
  std::vector<double> power;
  std::vector<std::size_t> shining;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const double bright = sampling ? std::max(0.0, entries_[i].light->power(scene_radius)) : 0;
    power.push_back(std::min(bright, 1e300));  // sums stay finite
    if (power[i] > 0) shining.push_back(i);
  }
  std::stable_sort(shining.begin(), shining.end(),
                   [&](std::size_t i, std::size_t j) { return power[i] > power[j]; });
  const std::size_t alone = shining.size() <= kMostGroups ? shining.size() : kMostGroups - 1;

  groups_.clear();
  probabilities_.assign(entries_.size(), 0);
  const auto add_group = [&](std::size_t first, std::size_t last) {
    double sum = 0;
    for (std::size_t n = first; n < last; ++n) sum += power[shining[n]];
    for (std::size_t n = first; n < last; ++n)
      probabilities_[shining[n]] =
          0.5 * power[shining[n]] / sum + 0.5 / static_cast<double>(last - first);
    std::vector<double> weights(entries_.size());
    for (std::size_t n = first; n < last; ++n) weights[shining[n]] = probabilities_[shining[n]];
    groups_.emplace_back(weights);
  };
  for (std::size_t n = 0; n < alone; ++n) add_group(n, n + 1);
  if (alone < shining.size()) add_group(alone, shining.size());
}

std::optional<LightSample> LightSet::sample(int group, const Vec3& point, SquarePoint at) const {
  const int i = groups_[group].sample(at.u);
  std::optional<LightSample> sample = entries_[i].light->sample(point, at);
  if (!sample) return sample;
  const double p = probabilities_[i];
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
