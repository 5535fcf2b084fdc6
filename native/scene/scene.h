// The planned scene: what the integrator traces. Built once from a description; immutable and
// shared while rendering.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scene/description.h"

namespace gpis {

class Scene {
 public:
  // Throws std::invalid_argument / FileNotFound with a sentence that names the path in the
  // description.
  explicit Scene(SceneDescription description);
  ~Scene();

  const SceneDescription& description() const { return description_; }
  // What was chosen and what is left out, as (path, sentence) rows: "objects[0].sampler of
  // 'bunny'", "convolution: …".
  std::vector<std::pair<std::string, std::string>> plan() const;

  struct Impl;  // meshes, lights, materials, stochastic surfaces: scene/scene_impl.h, for the
                // integrator
  const Impl& impl() const { return *impl_; }

 private:
  void build_objects();

  SceneDescription description_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace gpis
