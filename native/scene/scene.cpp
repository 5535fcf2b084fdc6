#include "scene/scene.h"

#include <sstream>
#include <stdexcept>

#include "scene/alone.h"
#include "scene/check.h"
#include "scene/scene_impl.h"

namespace gpis {
namespace {

std::unique_ptr<Material> make_material(const MaterialDescription& m) {
  using Type = MaterialDescription::Type;
  switch (m.type) {
    case Type::lambert:
      return make_lambert(m.color);
    case Type::mirror:
      return make_mirror(m.color, m.color);
    case Type::conductor:
      return make_conductor(m.color, m.roughness);
    case Type::principled:
      return make_principled(m.color, m.roughness, m.metallic);
    case Type::dielectric:
      return make_dielectric(m.color, m.reflection, m.ior, m.roughness);
  }
  throw std::invalid_argument("materials: unknown type.");
}

std::unique_ptr<Light> make_light(const LightDescription& l) {
  using Type = LightDescription::Type;
  const Vec3 position = l.matrix.translation, axis = normalize(l.matrix.vector({0, 0, -1}));
  const Color power = l.color * l.power;
  switch (l.type) {
    case Type::point:
      return make_point(position, power, l.radius);
    case Type::spot:
      return make_spot(position, axis, power, l.radius, l.angle, l.blend);
    case Type::sun:
      return make_sun(axis, power, l.angle);
    case Type::area: {
      const Vec3 u = l.matrix.vector({l.size_x, 0, 0}), v = l.matrix.vector({0, l.size_y, 0});
      const Color radiance = l.radiance ? *l.radiance : power / (kPi * area_of(u, v, l.ellipse));
      return make_area(position, u, v, axis, l.ellipse, radiance);
    }
  }
  throw std::invalid_argument("lights: unknown type.");
}

std::unique_ptr<Light> make_world(const WorldDescription& w) {
  if (w.image.empty()) return make_constant_environment(w.color * w.strength);
  return make_image_environment(w.image_width, w.image_height, w.image.data(), w.matrix,
                                w.strength);
}

void check_bounds(const Box3& bounds, const std::string& path) {
  for (int i = 0; i < 3; ++i)
    for (const double end : {std::abs(bounds.min[i]), std::abs(bounds.max[i])})
      if (end > kFarthest && end < kInfinity) {
        std::ostringstream sentence;
        sentence << path << " takes the bounds of the process as far as " << end
                 << " from the origin; keep within " << kFarthest << ".";
        throw std::invalid_argument(sentence.str());
      }
}

// Of the sphere about all finite bounds; 1 if there are none.
double bounding_radius(const Scene::Impl& scene) {
  Box3 all;
  const auto include = [&](const Box3& b) {
    if (b.empty() || !is_finite(b.min) || !is_finite(b.max)) return;
    all.include(b.min);
    all.include(b.max);
  };
  if (scene.triangles) include(scene.triangles->bounds());
  for (const auto& b : scene.bodies) include(b.surface.bounds());
  const double radius = all.empty() ? 0 : length(all.max - all.min) / 2;
  return radius > 0 ? radius : 1;
}

}  // namespace

Scene::Scene(SceneDescription description)
    : description_(std::move(description)), impl_(std::make_unique<Impl>()) {
  const SceneDescription& d = description_;
  check(d);
  for (const MaterialDescription& m : d.materials) impl_->materials.push_back(make_material(m));
  build_objects();
  find_alone(d, *impl_);
  if (impl_->triangles) impl_->triangles->commit();
  std::vector<Box3> boxes;
  for (const auto& body : impl_->bodies) boxes.push_back(body.surface.bounds());
  impl_->body_boxes = BoxTree(boxes);
  impl_->radius = bounding_radius(*impl_);
  for (const LightDescription& l : d.lights) impl_->lights.add(make_light(l), l.visible_to_camera);
  if (!d.world.black()) impl_->lights.add(make_world(d.world), true);
  impl_->lights.finish(impl_->radius, d.settings.light_sampling);
}

Scene::~Scene() = default;

void Scene::build_objects() {
  const SceneDescription& d = description_;
  std::vector<int> mesh_of(d.meshes.size(), -1);  // meshes that no object uses are left out
  int meshes = 0;
  for (std::size_t i = 0; i < d.objects.size(); ++i) {
    const ObjectDescription& o = d.objects[i];
    if (o.type == ObjectDescription::Type::gpis) {
      try {
        for (const auto& leaf : o.process->leaves())
          if (!leaf.process->kernel->differentiable())
            throw std::invalid_argument("The kernel " + leaf.process->kernel->describe() +
                                        " has no gradient, so no normals and no light: take "
                                        "Matern 3/2 for a rough surface.");
        impl_->bodies.push_back(
            {static_cast<int>(i), impl_->stochastic.size(),
             TreeSurface(o.process, o.matrix, o.memory, o.sampler, d.settings.missed_root)});
        if (impl_->materials[o.materials[0]]->relative_index() != 0) {
          impl_->bodies.back().surface.serve_inside();
          impl_->transparent = true;
        }
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(EntryPath("objects", i, o.name) + ".process" + ": " +
                                    error.what());
      }
      const TreeSurface& surface = impl_->bodies.back().surface;
      check_bounds(surface.bounds(), EntryPath("objects", i, o.name) + ".matrix");
      for (std::size_t k = 0; k < surface.leaves().size(); ++k) {
        const int material = o.materials[o.materials.size() == 1 ? 0 : surface.operand(k)];
        impl_->stochastic.push_back(
            {surface.leaves()[k], impl_->materials[material].get(), o.albedo, inverse(o.matrix)});
      }
      continue;
    }
    const MeshDescription& mesh = d.meshes[o.mesh];
    if (mesh.triangles.empty()) continue;
    if (!impl_->triangles) impl_->triangles = std::make_unique<TriangleScene>();
    if (mesh_of[o.mesh] < 0) {
      impl_->triangles->add_mesh({mesh.vertices, mesh.triangles, mesh.normals,
                                  mesh.normals_per_corner, mesh.material_index});
      mesh_of[o.mesh] = meshes++;
    }
    impl_->triangles->add_instance(mesh_of[o.mesh], o.matrix);
    std::vector<const Material*>& slots = impl_->instance_materials.emplace_back();
    for (const int m : o.materials) slots.push_back(impl_->materials[m].get());
  }
}

}  // namespace gpis
