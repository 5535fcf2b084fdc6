// The parts of a planned scene, for the integrator (integrator/path_tracer.cpp).
#pragma once

#include "geometry/box_tree.h"
#include "geometry/triangle_scene.h"
#include "light/light_set.h"
#include "material/material.h"
#include "process/tree_surface.h"
#include "scene/scene.h"

namespace gpis {

struct Scene::Impl {
  // A leaf of a stochastic object's tree.
  struct Stochastic {
    ProcessSurface surface;
    const Material* material;
    ColorFieldPtr albedo;  // none: its material's colour is the same everywhere
    Affine to_object;
  };
  struct Body {
    int object;         // index into the description's objects
    std::size_t first;  // its leaves are stochastic[first], …
    TreeSurface surface;
  };

  std::vector<std::unique_ptr<Material>> materials;
  std::unique_ptr<TriangleScene> triangles;  // none: Embree is not even opened
  std::vector<std::vector<const Material*>>
      instance_materials;  // by instance of `triangles`, then material_index
  std::vector<Stochastic> stochastic;
  std::vector<Body> bodies;
  BoxTree body_boxes;        // their bounds
  bool transparent = false;  // rays travel inside some of the bodies
  LightSet lights;
  double radius = 1;  // of the scene's bounding sphere
};

}  // namespace gpis
