// The parts of a planned scene, for the integrator (integrator/path_tracer.cpp).
#pragma once

#include "geometry/triangle_scene.h"
#include "light/light_set.h"
#include "material/material.h"
#include "process/surface.h"
#include "scene/scene.h"

namespace gpis {

struct Scene::Impl {
  struct Stochastic {
    int object;  // index into the description's objects
    ProcessSurface surface;
    const Material* material;
  };

  std::vector<std::unique_ptr<Material>> materials;
  std::unique_ptr<TriangleScene> triangles;  // none: Embree is not even opened
  std::vector<std::vector<const Material*>>
      instance_materials;  // by instance of `triangles`, then material_index
  std::vector<Stochastic> stochastic;
  LightSet lights;
  double radius = 1;  // of the scene's bounding sphere
};

}  // namespace gpis
