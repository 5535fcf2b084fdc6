// Small scenes for the transport tests.
#pragma once

#include "check.h"
#include "core/rng.h"
#include "field/constant_field.h"
#include "field/sphere_field.h"
#include "integrator/path_tracer.h"
#include "kernel/stationary_kernel.h"
#include "scene/scene.h"

namespace gpis::test {

inline MaterialDescription material(MaterialDescription::Type type, double color,
                                    double roughness = 0) {
  MaterialDescription m;
  m.type = type;
  m.color = {color, color, color};
  m.roughness = roughness;
  return m;
}
inline MaterialDescription lambert(double color) {
  return material(MaterialDescription::Type::lambert, color);
}

inline Affine placed(const Vec3& at, double scale = 1, const Vec3& turned = {0, 0, 1}) {
  const Frame f(normalize(turned));
  return {transpose(Mat3{{f.s * scale, f.t * scale, f.n * scale}}), at};
}

// [-1, 1]² at z = 0, as `n`² squares.
inline MeshDescription plane_mesh(int n = 1) {
  MeshDescription m;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      for (const double c : {-1 + 2.0 * i / n, -1 + 2.0 * j / n, 0.0})
        m.vertices.push_back(static_cast<float>(c));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<std::uint32_t>(j * (n + 1) + i), b = a + 1, c = a + n + 1,
                 d = c + 1;
      for (const auto v : {a, b, d, a, d, c}) m.triangles.push_back(v);
    }
  return m;
}

// Unit sphere; `smooth` gives vertex normals.
inline MeshDescription sphere_mesh(int rows, bool smooth) {
  MeshDescription m;
  const int columns = 2 * rows;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const double theta = kPi * j / rows, phi = 2 * kPi * i / columns;
      for (const double c :
           {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)})
        m.vertices.push_back(static_cast<float>(c));
    }
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const auto a = static_cast<std::uint32_t>(j * columns + i),
                 b = static_cast<std::uint32_t>(j * columns + (i + 1) % columns);
      for (const std::uint32_t v : {a, a + columns, b + columns, a, b + columns, b})
        m.triangles.push_back(v);
    }
  if (smooth) m.normals = m.vertices;
  return m;
}

inline MeshDescription cube_mesh() {
  MeshDescription m;
  for (int k = 0; k < 8; ++k)
    for (int axis = 0; axis < 3; ++axis) m.vertices.push_back(k >> axis & 1 ? 1.f : -1.f);
  m.triangles = {0, 3, 1, 0, 2, 3, 4, 7, 6, 4, 5, 7, 0, 5, 4, 0, 1, 5,
                 2, 7, 3, 2, 6, 7, 0, 6, 2, 0, 4, 6, 1, 7, 5, 1, 3, 7};
  return m;
}

inline void add_mesh_object(SceneDescription& scene, int mesh, int material,
                            const Affine& matrix = {}) {
  ObjectDescription o;
  o.mesh = mesh;
  o.materials = {material};
  o.matrix = matrix;
  scene.objects.push_back(o);
}

inline void set_world_image(SceneDescription& scene, int width, int height, double value) {
  scene.world.image_width = width;
  scene.world.image_height = height;
  scene.world.image.assign(3ull * width * height, static_cast<float>(value));
}

// Radiance 1 from everywhere, as two suns of half of the sky each: sampled as lights, unlike an
// even sky.
inline void set_white_suns(SceneDescription& scene) {
  scene.world.color = {};
  for (const double side : {1.0, -1.0}) {
    LightDescription sun;
    sun.type = LightDescription::Type::sun;
    sun.matrix.linear.row[1].y = sun.matrix.linear.row[2].z = side;
    sun.power = sun.angle = kPi;
    sun.visible_to_camera = true;
    scene.lights.push_back(sun);
  }
}

// A sphere of radius 1 as a distance mean.
inline std::shared_ptr<GaussianProcess> sphere_process(double length_scale, double sigma,
                                                       const Vec3& center = {}) {
  const double reach = 1 + 6 * sigma;
  const Vec3 r{reach, reach, reach};
  return std::make_shared<GaussianProcess>(GaussianProcess{
      std::make_shared<SphereField>(center, 1), std::make_shared<ConstantField>(sigma),
      std::make_shared<SquaredExponential>(length_scale), nullptr, Box3{center - r, center + r}});
}

inline void add_process(SceneDescription& scene, std::shared_ptr<const GaussianProcess> process,
                        int material, Memory memory, const Affine& matrix = {}) {
  ObjectDescription o;
  o.type = ObjectDescription::Type::gpis;
  o.process = ProcessTree::single(std::move(process));
  o.materials = {material};
  o.memory = memory;
  o.matrix = matrix;
  scene.objects.push_back(o);
}

// Those of one sample alone: independent of all others.
inline BlockPoints any_points(Rng& rng) {
  return {rng(), 0};
}

struct Render {
  Mean radiance;
  Counters counters;
};

// Red of many paths along rays made by `ray(rng)`.
template <class MakeRay>
Render trace(const SceneDescription& description, const MakeRay& ray, int paths,
             std::uint64_t seed = 1) {
  const Scene scene(description);
  PathTracer tracer(scene);
  Render result;
  for (int i = 0; i < paths; ++i) {
    Rng rng(seed, i);
    const Ray r = ray(rng);
    result.radiance.add(
        tracer.trace(r, kInfinity, any_points(rng), rng, result.counters).radiance.x);
  }
  return result;
}

inline Vec3 any_direction(Rng& rng) {
  for (;;) {
    const Vec3 v{rng.normal(), rng.normal(), rng.normal()};
    if (length(v) > 1e-3) return normalize(v);
  }
}

inline LightDescription light(LightDescription::Type type, const Vec3& at) {
  LightDescription l;
  l.type = type;
  l.matrix = placed(at);
  l.power = 100;
  return l;
}

}  // namespace gpis::test
