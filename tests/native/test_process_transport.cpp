// Path tracing over stochastic surfaces: nothing is lost (oracle 13), and light sampling changes
// nothing (oracle 19).
#include "chi_squared.h"
#include "integrator/dielectric_scatter.h"
#include "integrator/scatter.h"
#include "scenes.h"

using namespace gpis;
using namespace gpis::test;

namespace {

const char* name_of(Memory m) {
  return m == Memory::none ? "none" : m == Memory::renewal ? "renewal" : "renewal+";
}
constexpr Memory kMemories[] = {Memory::none, Memory::renewal, Memory::renewal_plus};
using Type = MaterialDescription::Type;

// Parallel rays along -z over the disk of radius 1.3.
Ray over_the_sphere(Rng& rng) {
  const double r = 1.3 * std::sqrt(rng.uniform()), phi = 2 * kPi * rng.uniform();
  return {{r * std::cos(phi), r * std::sin(phi), 4}, {0, 0, -1}};
}

SceneDescription sphere_scene(double length_scale, double sigma, Memory memory,
                              const MaterialDescription& m) {
  SceneDescription s;
  s.materials = {m};
  add_process(s, sphere_process(length_scale, sigma), 0, memory);
  return s;
}

}  // namespace

TEST(process_furnace_is_one) {
  // Issue: sigma = l/2 and 2l, lossless materials, every memory, light sampling off and on.
  for (const double ratio : {0.5, 2.0})
    for (const Type type : {Type::lambert, Type::mirror, Type::dielectric})
      for (const Memory memory : kMemories)
        for (const bool sampling : {false, true}) {
          context() = std::string(name_of(memory)) +
                      (type == Type::mirror       ? ", mirror"
                       : type == Type::dielectric ? ", dielectric"
                                                  : ", lambert") +
                      ", sigma/l " + std::to_string(ratio) + (sampling ? ", light sampling" : "");
          SceneDescription s = sphere_scene(0.1, 0.1 * ratio, memory, material(type, 1));
          if (sampling) {
            set_white_suns(s);
          } else {
            s.world.color = {1, 1, 1};
          }
          const Render r = trace(s, over_the_sphere, 4000, 11);
          CHECK(std::abs(r.radiance.z(1)), <, 4.0);
          if (!sampling) CHECK(r.radiance.error(), <, 1e-9);
          CHECK(r.counters.path_length_limit, ==, 0u);
          CHECK(r.counters.line_step_limit, ==, 0u);
          CHECK(r.counters.bounds_exits, ==, 0u);
          CHECK((r.counters.shadow_rays > 0), ==, sampling);
          CHECK((r.counters.inside_rays > 0), ==, (type == Type::dielectric));
        }
}

TEST(mirror_scatter_follows_its_density) {
  const Vec3 d = normalize({0.2, -0.3, -1});
  const Frame f(d);
  const auto mirror = make_mirror({1, 1, 1}, {1, 1, 1});
  for (const double spread : {0.2, 1.0, 3.0}) {
    context() = "spread " + std::to_string(spread);
    GradientLaw law;
    law.mean = f.n * -0.8 + f.s * 0.3 + f.t * 0.1;
    law.b1 = (f.s * 0.9 + f.t * 0.2) * spread;
    law.b2 = f.t * (0.5 * spread);
    const MirrorScatter scatter(*mirror, d, law);
    const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
      const ScatterSample s = scatter.sample(law.draw(rng));
      CHECK(std::abs(s.pdf - scatter.pdf(s.direction)), <=, 1e-12 * s.pdf);
      return s.direction;
    };
    const ChiSquared result = chi_squared(
        sample, [&](const Vec3& w) { return scatter.pdf(w); }, 100'000, 9);
    CHECK(result.p_value, >, 3e-4);
    CHECK(std::abs(result.total - 1), <, 0.01);
    Rng rng(1, 0);
    for (int n = 0; n < 100; ++n) {
      const Vec3 g = law.draw(rng);
      const Vec3 back = *scatter.gradient_for(scatter.sample(g).direction);
      CHECK(length(back - g), <, 1e-9 * length(g));
    }
  }
}

TEST(dielectric_scatter_follows_its_density) {
  const Vec3 d = normalize({0.2, -0.3, -1});
  const Frame f(d);
  const auto glass = make_dielectric({1, 1, 1}, {1, 1, 1}, 1.5, 0);
  for (const bool inside : {false, true})
    for (const double spread : {0.2, 1.0})
      for (const bool through : {false, true}) {
        context() = std::string(inside ? "inside" : "outside") + ", spread " +
                    std::to_string(spread) + (through ? ", refracted" : ", reflected");
        GradientLaw law;
        law.mean = f.n * (inside ? 0.8 : -0.8) + f.s * 0.3 + f.t * 0.1;
        law.b1 = (f.s * 0.9 + f.t * 0.2) * spread;
        law.b2 = f.t * (0.5 * spread);
        const DielectricScatter scatter(inside ? glass->from_inside() : *glass, d, law, kNoTint);
        const auto way = through ? scatter.refraction() : scatter.reflection();
        const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
          const Vec3 gradient = law.draw(rng);
          const ScatterSample s = scatter.sample(gradient, rng.uniform());
          if (s.transmitted != through) return std::nullopt;
          CHECK(std::abs(s.pdf - way.pdf(s.direction)), <=, 1e-6 * s.pdf);
          CHECK(std::abs(s.weight.x - 1), <, 1e-12);
          CHECK(length(*way.gradient_for(s.direction) - gradient), <, 1e-6 * length(gradient));
          return s.direction;
        };
        const ChiSquared result = chi_squared(
            sample, [&](const Vec3& w) { return way.pdf(w); }, 100'000, 9);
        CHECK(result.p_value, >, 1e-4);
      }
}

TEST(specular_processes_show_lights_alike_by_both_strategies) {
  for (const Type type : {Type::mirror, Type::dielectric})
    for (const Memory memory : kMemories) {
      context() = std::string(name_of(memory)) + (type == Type::mirror ? ", mirror" : ", glass");
      SceneDescription s = sphere_scene(0.3, 0.1, memory, material(type, 0.9));
      s.lights = {light(LightDescription::Type::point, {2, 1, 3}),
                  light(LightDescription::Type::sun, {})};
      s.lights[0].radius = 1;
      s.lights[1].angle = 1.0;
      s.lights[1].power = 3;
      s.lights[1].matrix = placed({}, 1, {-2, 1, 1});
      const Render on = trace(s, over_the_sphere, 40'000, 1);
      s.settings.light_sampling = false;
      const Render off = trace(s, over_the_sphere, 120'000, 2);
      CHECK(std::abs(on.radiance.z(off.radiance)), <, 4.0);
      CHECK(on.radiance.error(), <, 0.025 * on.radiance.mean());
    }
}

TEST(specular_processes_show_a_sun_of_no_size) {
  // The limit of small disks: a direction is reached by light sampling alone.
  for (const Type type : {Type::mirror, Type::dielectric})
    for (const Memory memory : kMemories) {
      context() = std::string(name_of(memory)) + (type == Type::mirror ? ", mirror" : ", glass");
      SceneDescription s = sphere_scene(0.3, 0.1, memory, material(type, 0.9));
      s.lights = {light(LightDescription::Type::sun, {})};
      s.lights[0].matrix = placed({}, 1, {-2, 1, 1});
      const Render point = trace(s, over_the_sphere, 40'000, 3);
      s.lights[0].angle = 0.05;
      const Render disk = trace(s, over_the_sphere, 40'000, 4);
      s.settings.light_sampling = false;
      s.lights[0].angle = 0.2;
      const Render found = trace(s, over_the_sphere, 200'000, 5);
      CHECK(point.radiance.mean(), >, 0.0);
      CHECK(std::abs(point.radiance.z(disk.radiance)), <, 4.0);
      CHECK(std::abs(point.radiance.z(found.radiance)), <, 4.0);
    }
}

TEST(rough_materials_on_a_process_are_lit_alike_by_both_strategies) {
  for (const Type type : {Type::lambert, Type::conductor, Type::principled, Type::dielectric}) {
    context() = std::to_string(static_cast<int>(type));
    SceneDescription s = sphere_scene(0.3, 0.1, Memory::renewal_plus, material(type, 0.8, 0.5));
    s.lights = {light(LightDescription::Type::sun, {})};
    s.lights[0].angle = 1.5;
    s.lights[0].power = 3;
    s.lights[0].matrix = placed({}, 1, {-2, 1, 1});
    const Render on = trace(s, over_the_sphere, 40'000, 1);
    s.settings.light_sampling = false;
    const Render off = trace(s, over_the_sphere, 80'000, 2);
    CHECK(std::abs(on.radiance.z(off.radiance)), <, 4.0);
    CHECK(on.radiance.error(), <, 0.025 * on.radiance.mean());
  }
}

TEST(overlapping_surfaces_keep_the_furnace) {
  // Three processes through each other and a mesh through all of them (definitions B1, B5).
  for (const Memory memory : kMemories)
    for (const bool sampling : {false, true}) {
      context() = std::string(name_of(memory)) + (sampling ? ", light sampling" : "");
      SceneDescription s;
      s.materials = {lambert(1), material(Type::mirror, 1)};
      if (sampling) {
        set_white_suns(s);
      } else {
        s.world.color = {1, 1, 1};
      }
      s.meshes = {plane_mesh()};
      add_mesh_object(s, 0, 0, placed({0, 0, 0.9}, 2));
      add_process(s, sphere_process(0.2, 0.1), 0, memory);
      add_process(s, sphere_process(0.1, 0.15), 1, memory, placed({0.1, 0, 0.05}, 0.95, {1, 2, 3}));
      add_process(s, sphere_process(0.3, 0.05), 0, Memory::renewal, placed({0.5, 0.5, 0.5}));
      const Render r = trace(s, over_the_sphere, 10'000, 6);
      CHECK(std::abs(r.radiance.z(1)), <, 4.0);
      if (!sampling) CHECK(r.radiance.error(), <, 1e-7);
      CHECK(r.counters.states_inside, <, r.counters.path_vertices / 1000);
      CHECK(r.counters.path_length_limit, ==, 0u);
    }
}

TEST(glass_bodies_keep_the_furnace) {
  // Glass through glass, a matt process, a mirror mesh inside and a glass mesh across; one body is
  // cut by its bounds, and rays leave it there.
  for (const Memory memory : kMemories)
    for (const bool sampling : {false, true}) {
      context() = std::string(name_of(memory)) + (sampling ? ", light sampling" : "");
      SceneDescription s;
      s.materials = {lambert(1), material(Type::mirror, 1), material(Type::dielectric, 1),
                     material(Type::dielectric, 1)};
      s.materials[3].ior = 1.2;
      if (sampling) {
        set_white_suns(s);
      } else {
        s.world.color = {1, 1, 1};
      }
      s.meshes = {plane_mesh(), sphere_mesh(8, true)};
      add_mesh_object(s, 0, 1, placed({0, 0, 0.2}, 0.3, {1, 2, 3}));
      add_mesh_object(s, 1, 2, placed({0.4, 0, 0.6}, 0.5));
      add_process(s, sphere_process(0.2, 0.1), 2, memory);
      add_process(s, sphere_process(0.1, 0.15), 3, memory, placed({0.6, 0, 0.05}, 0.95, {1, 2, 3}));
      add_process(s, sphere_process(0.3, 0.05), 0, Memory::renewal, placed({0.9, 0.9, -0.5}, 0.7));
      auto cut = std::make_shared<GaussianProcess>(*sphere_process(0.2, 0.1));
      cut->bounds = Box3{{-2, -2, -2}, {0.3, 2, 2}};
      add_process(s, cut, 2, memory, placed({-0.5, 0, 0}));
      const Render r = trace(s, over_the_sphere, 6'000, 6);
      CHECK(std::abs(r.radiance.z(1)), <, 4.0);
      if (!sampling) CHECK(r.radiance.error(), <, 1e-7);
      CHECK(r.counters.states_inside, <, r.counters.path_vertices / 1000);
      CHECK(r.counters.bounds_exits, >, 1000u);
      CHECK(r.counters.path_length_limit, ==, 0u);
    }
}

TEST(certain_glass_process_is_the_mesh_it_describes) {
  // sigma = 0: a ball of glass as a process and as triangles, under a sky with an edge.
  SceneDescription s;
  s.materials = {material(Type::dielectric, 0.9)};
  set_world_image(s, 16, 8, 0);
  for (int k = 0; k < 16 * 3; ++k)
    for (int row = 0; row < 4; ++row) s.world.image[16 * 3 * row + k] = k % 3 == 0 ? 1 : 0;
  s.meshes = {sphere_mesh(128, true)};
  add_mesh_object(s, 0, 0);
  const Render mesh = trace(s, over_the_sphere, 100'000, 1);
  s.objects.clear();
  add_process(s, sphere_process(0.1, 0), 0, Memory::renewal_plus);
  const Render process = trace(s, over_the_sphere, 100'000, 1);
  CHECK(mesh.radiance.mean(), >, 0.1);
  CHECK(std::abs(mesh.radiance.mean() - process.radiance.mean()), <,
        4 * std::hypot(mesh.radiance.error(), process.radiance.error()));
}

TEST(memory_of_an_overlapped_process_is_kept) {
  // A mirror mesh inside a black process sends the ray back the way it came, .2 length scales.
  // Value and slope at the mirror fix the process that near (definitions B1): with Renewal+ a ray
  // that got in gets out, and T(.2) arrives. Without memory the way back is a fresh start from
  // outside, and T(.2)² arrives; T(.2) = 1 - .2/pi (Rice) to first order.
  SceneDescription s;
  s.materials = {material(Type::mirror, 1), lambert(0)};
  s.world.color = {1, 1, 1};
  s.meshes = {plane_mesh()};
  add_mesh_object(s, 0, 0);
  const auto process = std::make_shared<GaussianProcess>(GaussianProcess{
      std::make_shared<ConstantField>(0), std::make_shared<ConstantField>(1),
      std::make_shared<SquaredExponential>(2), nullptr, Box3{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.4}}});
  const auto ray = [](Rng&) { return Ray{{0, 0, 1}, {0, 0, -1}}; };
  const auto arriving = [&](Memory memory) {
    s.objects.resize(1);
    add_process(s, process, 1, memory);
    return trace(s, ray, 40'000, 7).radiance;
  };
  const double once = arriving(Memory::renewal_plus).mean(),
               forgotten = arriving(Memory::none).mean();
  const double partly = arriving(Memory::renewal).mean();
  const double survival = 1 - 0.2 / kPi;
  CHECK(std::abs(forgotten - survival * survival), <, 0.007);
  // What value and slope leave open, .028 standard deviations after .2 length scales, stops .7%.
  CHECK(std::abs(once - 0.993 * survival), <, 0.006);
  CHECK(partly, >, forgotten + 0.005);
  CHECK(partly, <, once);
}

TEST(certain_process_is_the_mesh_it_describes) {
  // sigma = 0 (oracle 17): the sphere as a process and as triangles under one sun.
  SceneDescription s;
  s.materials = {lambert(0.7)};
  s.lights = {light(LightDescription::Type::sun, {})};
  s.lights[0].matrix = placed({}, 1, {-1, 1, 1});
  s.lights[0].power = 3;
  s.meshes = {sphere_mesh(96, true)};
  add_mesh_object(s, 0, 0);
  const Render mesh = trace(s, over_the_sphere, 40'000, 1);
  s.objects.clear();
  add_process(s, sphere_process(0.1, 0), 0, Memory::renewal_plus);
  for (const Memory memory : kMemories) {
    context() = name_of(memory);
    s.objects[0].memory = memory;
    const Render process = trace(s, over_the_sphere, 40'000, 2);
    CHECK(std::abs(mesh.radiance.z(process.radiance)), <, 4.0);
  }
}

TEST(shadow_rays_never_change_the_path) {
  SceneDescription s = sphere_scene(0.1, 0.1, Memory::renewal_plus, material(Type::mirror, 0.9));
  s.lights = {light(LightDescription::Type::point, {0, 0, 3})};
  const Counters on = trace(s, over_the_sphere, 2000).counters;
  s.settings.light_sampling = false;
  const Counters off = trace(s, over_the_sphere, 2000).counters;
  CHECK(on.shadow_rays, >, 1000u);
  CHECK(off.shadow_rays, ==, 0u);
  CHECK(on.path_vertices, ==, off.path_vertices);
}
