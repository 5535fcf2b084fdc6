#include "scene/alone.h"

#include <stdexcept>

#include "process/plan.h"
#include "scene/check.h"

namespace gpis {
namespace {

// Faces that touch count: a ray that ends on one ends inside the other's closed bounds.
bool meet(const Box3& a, const Box3& b) {
  for (int i = 0; i < 3; ++i)
    if (!(a.min[i] <= b.max[i] && b.min[i] <= a.max[i])) return false;
  return true;
}

// Triangle by triangle: the walls of a room do not touch what they surround.
bool meets_triangle(const Box3& box, const ObjectDescription& object, const MeshDescription& mesh) {
  for (std::size_t k = 0; k + 2 < mesh.triangles.size(); k += 3) {
    Box3 triangle;
    for (int corner = 0; corner < 3; ++corner) {
      const float* v = &mesh.vertices[std::size_t{3} * mesh.triangles[k + corner]];
      triangle.include(object.matrix.point({v[0], v[1], v[2]}));
    }
    if (meet(box, triangle)) return true;
  }
  return false;
}

// No ray ends on it.
bool certainly_absent(const Scene::Impl::Body& body) {
  if (!body.surface.tree().is_single()) return false;
  const PlannedLine& plan = body.surface.leaves()[0].planned();
  return plan.process->mean->range().min > plan.skip_threshold && !plan.process->conditions;
}

// The name of the first object whose rays may end inside of the body's bounds; null: none.
const std::string* company(const SceneDescription& d, const Scene::Impl& scene,
                           const Scene::Impl::Body& body) {
  const Box3& box = body.surface.bounds();
  for (const Scene::Impl::Body& other : scene.bodies)
    if (&other != &body && meet(box, other.surface.bounds()) && !certainly_absent(other))
      return &d.objects[other.object].name;
  for (const ObjectDescription& o : d.objects)
    if (o.type == ObjectDescription::Type::mesh && meets_triangle(box, o, d.meshes[o.mesh]))
      return &o.name;
  return nullptr;
}

}  // namespace

void find_alone(const SceneDescription& description, Scene::Impl& scene) {
  for (Scene::Impl::Body& body : scene.bodies) {
    if (!body.surface.gains_alone()) continue;
    const std::string* other = company(description, scene, body);
    if (!other) {
      body.surface.stands_alone();
      scene.stochastic[body.first].surface = body.surface.leaves()[0];
    } else if (body.surface.leaves()[0].must_stand_alone()) {
      const EntryPath path("objects", body.object, description.objects[body.object].name);
      throw std::invalid_argument((path + ".sampler") +
                                  ": first_passage serves an object of its own, and '" + *other +
                                  "' reaches into its bounds: take 'auto'.");
    } else {
      body.surface.has_company(*other);
    }
  }
}

}  // namespace gpis
