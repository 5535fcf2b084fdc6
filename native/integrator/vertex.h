// Where a path stands: on a mesh or on a stochastic surface.
#pragma once

#include "core/vec.h"
#include "material/material.h"

namespace gpis {

struct Vertex {
  double t = kInfinity;
  Vec3 position;          // of the surface
  Vec3 departure;         // where rays start that stay on this side
  Vec3 beyond;            // and those that go through
  Vec3 geometric_normal;  // facing the ray
  Vec3 shading_normal;
  const Material* material = nullptr;
  Color tint = kNoTint;  // the painted albedo there
  int surface = -1;      // which stochastic surface, -1 for a mesh
  int body = -1;         // and of which object
  bool inside = false;   // the ray came inside of it

  const Vec3& start(bool transmitted) const { return transmitted ? beyond : departure; }
};

}  // namespace gpis
