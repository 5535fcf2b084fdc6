// What a planned scene does and what it leaves out, in words: Scene::plan().
#include <algorithm>

#include "scene/check.h"
#include "scene/scene_impl.h"

namespace gpis {
namespace {

using Rows = std::vector<std::pair<std::string, std::string>>;

// Below what roughness a material is a mirror, and which model it has; empty where its type says
// all.
std::string model_of(const MaterialDescription& m) {
  using Type = MaterialDescription::Type;
  const bool smooth = m.roughness < kSmoothRoughness;
  switch (m.type) {
    case Type::conductor:
      return smooth ? "mirror: roughness below .01" : "single-scatter GGX, alpha = roughness²";
    case Type::principled:
      if (smooth && m.metallic == 1) return "mirror (Schlick): metallic 1, roughness below .01";
      return std::string(
                 "Lambert under a dielectric coat (index 1.5) mixed with a metal, single-scatter "
                 "GGX") +
             (smooth ? ", roughness raised to .01" : "");
    case Type::dielectric:
      return smooth ? "smooth dielectric: exact Fresnel"
                    : "dielectric: single-scatter GGX, alpha = roughness²";
    case Type::lambert:
    case Type::mirror:
      break;
  }
  return "";
}

}  // namespace

Rows Scene::plan() const {
  const SceneDescription& d = description_;
  const auto& leaves = impl_->stochastic;
  const auto count = [](const auto& list, const auto& has) {
    return static_cast<std::size_t>(std::count_if(list.begin(), list.end(), has));
  };
  Rows rows;
  // An entry that something in the scene needs, by how many, or that is left out.
  const auto needed = [&](const char* name, std::size_t n, const char* entered, const char* why) {
    rows.emplace_back(std::string("scene.") + name,
                      n ? std::to_string(n) + " " + entered : std::string("left out: ") + why);
  };

  needed("embree", impl_->instance_materials.size(), "mesh objects", "no meshes");
  needed("processes", leaves.size(), "stochastic surfaces", "no stochastic surfaces");
  rows.emplace_back(
      "scene.light_sampling",
      impl_->lights.groups() > 0
          ? "on: " + std::to_string(impl_->lights.groups()) +
                " shadow rays at every surface that is not a deterministic mirror or glass"
      : d.settings.light_sampling
          ? "left out: nothing to sample (an even world is met by following the BRDF)"
          : "off by settings.light_sampling");
  const std::size_t transparent = count(impl_->bodies, [&](const auto& body) {
    return leaves[body.first].material->relative_index() != 0;
  });
  rows.emplace_back("scene.inside", transparent
                                        ? "rays travel inside of " + std::to_string(transparent) +
                                              " dielectric bodies, each a medium in air"
                                        : "left out: no body is a dielectric");
  rows.emplace_back("scene.world", d.world.black()         ? "left out: black"
                                   : d.world.image.empty() ? "constant colour"
                                   : impl_->lights.probability(d.lights.size()) > 0
                                       ? "image; what is brighter than its mean is sampled"
                                       : "image, too even to be sampled");
  needed("textures", count(d.objects, [](const auto& o) { return o.albedo != nullptr; }),
         "objects look an albedo up where a ray meets them", "no object has a painted albedo");
  rows.emplace_back("scene.motion",
                    "left out: this renderer has no motion blur, a picture is one moment");
  const auto with = [&](const auto& has) {
    return count(leaves, [&](const auto& leaf) { return has(*leaf.surface.planned().process); });
  };
  needed("time", with([](const GaussianProcess& p) { return p.time.has_value(); }),
         "surfaces change with time: their realisations are drawn for its moment",
         "no process changes with time");
  needed("tensors", with([](const GaussianProcess& p) { return p.anisotropy != nullptr; }),
         "surfaces look up length scales A(x)", "all length scales are the same everywhere");
  needed("sigma_lookups", with([](const GaussianProcess& p) {
           const Range sigma = p.sigma->range();
           return sigma.min != sigma.max;
         }),
         "surfaces look up their deviation", "every deviation is constant");
  needed("conditions", with([](const GaussianProcess& p) { return p.conditions != nullptr; }),
         "surfaces have condition points", "no condition points");
  needed("csg", count(impl_->bodies, [](const auto& b) { return !b.surface.tree().is_single(); }),
         "objects are composed of several surfaces", "every object is one surface");
  rows.emplace_back("scene.bounces", d.settings.max_bounces
                                         ? "at most " + std::to_string(*d.settings.max_bounces) +
                                               "; the last keeps no memory"
                                         : "unlimited, Russian roulette below throughput 1");

  for (std::size_t i = 0; i < d.lights.size(); ++i)
    rows.emplace_back("lights[" + std::to_string(i) + "].probability",
                      std::to_string(impl_->lights.probability(i)));
  for (std::size_t i = 0; i < d.materials.size(); ++i) {
    const std::string model = model_of(d.materials[i]);
    if (!model.empty()) rows.emplace_back("materials[" + std::to_string(i) + "].model", model);
  }
  auto body = impl_->bodies.begin();
  for (std::size_t i = 0; i < d.objects.size(); ++i) {
    const ObjectDescription& o = d.objects[i];
    const EntryPath path("objects", i, o.name);
    if (o.type == ObjectDescription::Type::mesh) {
      const std::size_t triangles = d.meshes[o.mesh].triangles.size() / 3;
      rows.emplace_back(path + ".mesh", triangles ? std::to_string(triangles) + " triangles"
                                                  : "left out: no triangles");
    }
    std::string materials;
    for (const int m : o.materials)
      materials += (materials.empty() ? "" : ", ") + d.materials[m].name;
    rows.emplace_back(path + ".materials", materials);
    if (o.albedo)
      rows.emplace_back(path + ".albedo", "a field: looked up where a ray meets the surface");
    if (o.type == ObjectDescription::Type::gpis) {
      for (const auto& [key, value] : body->surface.plan())
        rows.emplace_back(path + ("." + key), value);
      ++body;
    }
  }
  return rows;
}

}  // namespace gpis
