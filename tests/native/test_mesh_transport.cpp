// Path tracing over meshes against closed forms.
#include "check.h"
#include "scenes.h"

using namespace gpis;
using namespace gpis::test;

namespace {

SceneDescription bowl_and_spheres(bool smooth) {
  SceneDescription s;
  s.world.color = {1, 1, 1};
  s.materials = {lambert(1), material(MaterialDescription::Type::mirror, 1)};
  s.meshes = {plane_mesh(), sphere_mesh(8, smooth)};
  add_mesh_object(s, 0, 0, placed({0, 0, -1}, 3));
  add_mesh_object(s, 0, 0, placed({3, 0, 0}, 3, {1, 0, 0.1}));
  add_mesh_object(s, 1, 0, placed({0, 0, 0}));
  add_mesh_object(s, 1, 1, placed({1.5, 1, 0.2}, 0.7));
  return s;
}

}  // namespace

TEST(mesh_furnace_is_exactly_one) {
  for (const bool smooth : {false, true})
    for (const bool image : {false, true}) {
      context() = std::string(smooth ? "smooth" : "flat") + (image ? ", light sampling" : "");
      SceneDescription s = bowl_and_spheres(smooth);
      if (image) set_white_suns(s);
      const Render r = trace(
          s,
          [](Rng& rng) {
            return Ray{{-4, -3, 3}, normalize(Vec3{4, 3, -3.5} + any_direction(rng) * 2)};
          },
          20'000);
      CHECK(std::abs(r.radiance.z(1)), <, 4.0);
      if (!image) CHECK(std::abs(r.radiance.mean() - 1) + r.radiance.error(), <, 1e-7);
      CHECK(r.counters.path_length_limit, ==, 0u);
      CHECK(r.counters.path_vertices, >, r.counters.camera_paths);
      CHECK((r.counters.shadow_rays > 0), ==, image);
    }
}

TEST(closed_boxes_do_not_leak) {
  // World 1 outside of a dark grey closed body: no ray may get out, wherever the body is and
  // however it is placed.
  for (const double scale : {1e-3, 1.0, 1e3})
    for (const double far : {0.0, 10.0, 100.0})
      for (const bool instanced : {false, true}) {
        context() = "scale " + std::to_string(scale) + ", at " + std::to_string(far) + " sizes" +
                    (instanced ? ", instanced" : "");
        const Vec3 at = Vec3{0.3, -1, 0.7} * (far * scale);
        SceneDescription s;
        s.world.color = {1, 1, 1};
        s.materials = {lambert(0.9)};
        s.meshes = {cube_mesh(), sphere_mesh(16, true)};
        for (const int mesh : {0, 1}) {
          s.objects.clear();
          add_mesh_object(s, mesh, 0, placed(at, scale, {1, 2, 3}));
          if (instanced) add_mesh_object(s, mesh, 0, placed(at + Vec3{9, 9, 9} * scale, scale));
          const Render r = trace(
              s,
              [&](Rng& rng) {
                return Ray{at, any_direction(rng)};
              },
              3000);
          CHECK(r.radiance.sum, ==, 0.0);
          CHECK(r.counters.path_vertices, >, 9 * r.counters.camera_paths);
        }
      }
}

TEST(lights_light_a_plane_as_in_closed_form) {
  using Type = LightDescription::Type;
  struct Row {
    const char* name;
    LightDescription light;
    double irradiance;
  };
  std::vector<Row> rows;
  const double at_two = 100 / (4 * kPi * 4);
  rows.push_back({"point", light(Type::point, {0, 0, 2}), at_two});
  rows.push_back({"sphere", light(Type::point, {0, 0, 2}), at_two});
  rows.back().light.radius = 0.7;
  rows.push_back({"sun", light(Type::sun, {}), 100});
  rows.push_back({"sun disk", light(Type::sun, {}), 100});
  rows.back().light.angle = 1;
  rows.push_back({"disk", light(Type::area, {0, 0, 2}), 100 / (kPi * kPi / 4) * kPi * 0.25 / 4.25});
  rows.back().light.ellipse = true;
  rows.push_back({"spot", light(Type::spot, {0, 0, 2}), at_two});
  rows.back().light.angle = 1;
  for (const Row& row : rows)
    for (const bool sampling : {true, false}) {
      const bool delta =
          row.light.radius == 0 && row.light.angle == 0 && row.light.type != Type::area;
      if (!sampling && (delta || row.light.type == Type::spot)) continue;
      context() = std::string(row.name) + (sampling ? "" : ", by BRDF sampling alone");
      SceneDescription s;
      s.materials = {lambert(0.5)};
      s.meshes = {plane_mesh()};
      add_mesh_object(s, 0, 0);
      s.lights = {row.light};
      s.settings.light_sampling = sampling;
      const Render r = trace(
          s,
          [](Rng&) {
            return Ray{{0.5, 0, 0.5}, normalize({-1, 0, -1})};
          },
          100'000);
      const double expected = 0.5 * row.irradiance / kPi;
      // The point that is lit stands off the plane by the self-intersection offset.
      CHECK(std::abs(r.radiance.mean() - expected), <, 4 * r.radiance.error() + 5e-5 * expected);
      CHECK(r.radiance.error(), <, 0.02 * r.radiance.mean());
    }
}

TEST(integrating_sphere_reaches_its_closed_form) {
  // Inside a closed sphere of reflectance p a lamp in the middle gives the exitance E0 p / (1 - p),
  // E0 = power/(4 pi r²).
  for (const double albedo : {0.5, 0.9}) {
    context() = "albedo " + std::to_string(albedo);
    SceneDescription s;
    s.materials = {lambert(albedo)};
    s.meshes = {sphere_mesh(48, false)};
    add_mesh_object(s, 0, 0, placed({}, 2));
    s.lights = {light(LightDescription::Type::point, {})};
    const Render r = trace(
        s,
        [](Rng& rng) {
          return Ray{{0.1, 0, 0}, any_direction(rng)};
        },
        20'000);
    const double expected = 100 / (4 * kPi * 4) * albedo / (1 - albedo) / kPi;
    // The facets are nearer than the sphere: up to 0.3% more.
    CHECK(std::abs(r.radiance.mean() / expected - 1), <, 0.005 + 4 * r.radiance.error() / expected);
    CHECK(r.counters.path_length_limit, ==, 0u);
  }
}

TEST(light_sampling_changes_nothing_in_expectation) {
  // A glossy and a matt sphere on a plane under an uneven sky, a lamp and a wide sun.
  SceneDescription s = bowl_and_spheres(true);
  s.materials = {lambert(0.6), material(MaterialDescription::Type::conductor, 0.9, 0.5)};
  set_world_image(s, 8, 4, 0.2);
  for (int k = 0; k < 3; ++k) s.world.image[3 * (8 * 3 + 2) + k] = 20;
  s.lights = {light(LightDescription::Type::point, {-1, -1, 3}),
              light(LightDescription::Type::sun, {})};
  s.lights[0].radius = 0.8;
  s.lights[1].angle = 1.5;
  s.lights[1].power = 2;
  s.lights[1].matrix = placed({}, 1, {-1, -2, 2});
  const auto ray = [](Rng& rng) {
    return Ray{{-4, -3, 3}, normalize(Vec3{4, 3, -3.5} + any_direction(rng) * 1.5)};
  };
  const Render on = trace(s, ray, 100'000, 1);
  s.settings.light_sampling = false;
  const Render off = trace(s, ray, 300'000, 2);
  CHECK(std::abs(on.radiance.z(off.radiance)), <, 4.0);
  CHECK(on.radiance.error(), <, 0.02 * on.radiance.mean());
  CHECK(off.counters.shadow_rays, ==, 0u);
}

TEST(bounces_are_counted_from_direct_light) {
  // Two facing white planes under a sun: no bounce shows direct light only.
  SceneDescription s;
  s.materials = {lambert(0.5)};
  s.meshes = {plane_mesh()};
  add_mesh_object(s, 0, 0);
  s.lights = {light(LightDescription::Type::sun, {})};
  s.settings.max_bounces = 0;
  const auto ray = [](Rng&) { return Ray{{0, 0, 1}, {0, 0, -1}}; };
  const Render direct = trace(s, ray, 100);
  CHECK(std::abs(direct.radiance.mean() - 50 / kPi), <, 1e-9);
  CHECK(direct.counters.path_vertices, ==, 100u);
}

TEST(first_hit_features_are_those_of_the_surface) {
  SceneDescription s;
  s.materials = {lambert(0.5)};
  s.meshes = {plane_mesh()};
  add_mesh_object(s, 0, 0, placed({0, 0, 1}));
  const Scene scene(s);
  PathTracer tracer(scene);
  Counters counters;
  Rng rng(1, 0);
  const PathSample hit =
      tracer.trace({{0, 0, 3}, {0, 0, -1}}, kInfinity, any_points(rng), rng, counters);
  CHECK(std::abs(hit.depth - 2), <, 1e-6);
  CHECK(hit.normal.z, ==, 1.0);
  CHECK(hit.albedo.x, ==, 0.5);
  CHECK(tracer.trace({{0, 0, 3}, {0, 0, -1}}, 1.5, any_points(rng), rng, counters).depth, ==,
        kInfinity);  // beyond the camera's far end
}

TEST(triangles_find_their_material_and_normals) {
  // Two triangles of one mesh, two materials each of two objects, one of them mirrored and
  // stretched.
  SceneDescription s;
  s.materials = {lambert(0.1), lambert(0.2), lambert(0.3), lambert(0.4)};
  s.meshes = {plane_mesh()};
  s.meshes[0].material_index = {0, 1};
  s.meshes[0].normals_per_corner = true;
  for (int corner = 0; corner < 6; ++corner)
    for (const float c : {corner < 3 ? 0.6f : 0.f, 0.f, corner < 3 ? 0.8f : 1.f})
      s.meshes[0].normals.push_back(c);
  add_mesh_object(s, 0, 0);
  s.objects[0].materials = {0, 1};
  add_mesh_object(s, 0, 0, {{{Vec3{-2, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}}, {10, 0, 0}});
  s.objects[1].materials = {2, 3};
  const Scene scene(s);
  PathTracer tracer(scene);
  Counters counters;
  const auto seen = [&](double x, double y) {
    Rng rng(1, 0);
    return tracer.trace({{x, y, 5}, {0, 0, -1}}, kInfinity, any_points(rng), rng, counters);
  };
  CHECK(seen(0.5, -0.5).albedo.x, ==, 0.1);
  CHECK(seen(-0.5, 0.5).albedo.x, ==, 0.2);
  CHECK(seen(9, -0.5).albedo.x, ==, 0.3);
  CHECK(seen(11, 0.5).albedo.x, ==, 0.4);
  CHECK(length(seen(0.5, -0.5).normal - Vec3{0.6, 0, 0.8}), <, 1e-6);
  CHECK(length(seen(-0.5, 0.5).normal - Vec3{0, 0, 1}), <, 1e-6);
  CHECK(length(seen(9, -0.5).normal - normalize({-0.3, 0, 0.8})), <, 1e-6);
}

TEST(camera_sees_lights_only_if_asked) {
  SceneDescription s;
  s.materials = {material(MaterialDescription::Type::mirror, 1)};
  s.meshes = {plane_mesh()};
  add_mesh_object(s, 0, 0);
  s.lights = {light(LightDescription::Type::point, {0, 0, 2})};
  s.lights[0].radius = 0.5;
  const auto at_light = [](Rng&) { return Ray{{0, 0, 1}, {0, 0, 1}}; };
  const auto at_mirror = [](Rng&) { return Ray{{0, 0, 1}, {0, 0, -1}}; };
  const double radiance = 100 / (4 * kPi * kPi * 0.25);
  CHECK(trace(s, at_light, 2).radiance.mean(), ==, 0.0);
  CHECK(std::abs(trace(s, at_mirror, 2).radiance.mean() / radiance - 1), <, 1e-9);
  s.lights[0].visible_to_camera = true;
  CHECK(std::abs(trace(s, at_light, 2).radiance.mean() / radiance - 1), <, 1e-9);
}

TEST(paths_that_cannot_end_are_counted) {
  SceneDescription s;
  s.materials = {lambert(1)};
  s.meshes = {cube_mesh()};
  add_mesh_object(s, 0, 0);
  const Render r = trace(
      s,
      [](Rng& rng) {
        return Ray{{}, any_direction(rng)};
      },
      2);
  CHECK(r.counters.path_length_limit, ==, 2u);
}

TEST(glass_slab_passes_what_its_closed_form_says) {
  // All orders of reflection between two faces: T = (1-F)/(1+F); upper half of the world black,
  // lower half white. Straight through, at 45 degrees, and totally reflected inside of a prism.
  SceneDescription s;
  s.materials = {material(MaterialDescription::Type::dielectric, 1)};
  set_world_image(s, 8, 64, 0);
  for (int k = 0; k < 8 * 32 * 3; ++k) s.world.image[k] = 1;
  s.meshes = {cube_mesh()};
  Affine flat = placed({}, 1);
  flat.linear.row[0] = flat.linear.row[0] * 500;
  flat.linear.row[1] = flat.linear.row[1] * 500;
  add_mesh_object(s, 0, 0, flat);
  for (const double cos : {1.0, std::sqrt(0.5), 0.3}) {
    context() = "cos " + std::to_string(cos);
    const double ior = s.materials[0].ior, sin = std::sqrt(1 - cos * cos);
    const double beyond = std::sqrt(1 - sin * sin / (ior * ior));
    const double across = (cos - ior * beyond) / (cos + ior * beyond),
                 along = (ior * cos - beyond) / (ior * cos + beyond);
    const double fresnel = (across * across + along * along) / 2;
    const Render r = trace(
        s,
        [&](Rng&) {
          return Ray{{0, 0, 5}, {sin, 0, -cos}};
        },
        100'000);
    CHECK(std::abs(r.radiance.z((1 - fresnel) / (1 + fresnel))), <, 4.0);
  }
}

TEST(rough_glass_is_lit_alike_by_both_strategies) {
  SceneDescription s;
  s.materials = {material(MaterialDescription::Type::dielectric, 0.9, 0.4)};
  s.lights = {light(LightDescription::Type::point, {1, 0, -3}),
              light(LightDescription::Type::point, {-1, 1, 3})};
  s.lights[0].radius = s.lights[1].radius = 1;
  s.meshes = {sphere_mesh(12, true)};
  add_mesh_object(s, 0, 0);
  const auto ray = [](Rng& rng) {
    return Ray{{0, 0, 4}, normalize(Vec3{0, 0, -4} + any_direction(rng) * 0.8)};
  };
  const Render on = trace(s, ray, 60'000, 1);
  s.settings.light_sampling = false;
  const Render off = trace(s, ray, 120'000, 2);
  CHECK(std::abs(on.radiance.z(off.radiance)), <, 4.0);
  CHECK(on.radiance.error(), <, 0.025 * on.radiance.mean());
}
