// Bad descriptions get a sentence that names the place; the plan says what is left out, and the
// counters prove it.
#include <functional>
#include <stdexcept>

#include "scenes.h"

using namespace gpis;
using namespace gpis::test;

namespace {

SceneDescription good() {
  SceneDescription s;
  s.world.color = {1, 1, 1};
  s.materials = {lambert(0.5)};
  s.meshes = {plane_mesh()};
  add_mesh_object(s, 0, 0);
  s.objects[0].name = "floor";
  add_process(s, sphere_process(0.1, 0.05), 0, Memory::renewal_plus);
  s.lights = {light(LightDescription::Type::point, {0, 0, 2})};
  return s;
}

std::string row(const Scene& scene, const std::string& key) {
  for (const auto& [path, sentence] : scene.plan())
    if (path == key) return sentence;
  return "(no such row)";
}

}  // namespace

TEST(bad_scenes_get_a_sentence) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  using Break = std::function<void(SceneDescription&)>;
  const std::vector<std::pair<std::string, Break>> rows = {
      {"objects[0].matrix of 'floor' flattens space",
       [](auto& s) {
         s.objects[0].matrix.linear = {{Vec3{}, Vec3{}, Vec3{}}};
       }},
      {"objects[1].matrix flattens space", [](auto& s) { s.objects[1].matrix.linear.row[2] = {}; }},
      {"objects[0].materials of 'floor' names a material",
       [](auto& s) { s.objects[0].materials = {1}; }},
      {"objects[0].materials of 'floor' is empty", [](auto& s) { s.objects[0].materials = {}; }},
      {"objects[0].mesh of 'floor' names a mesh", [](auto& s) { s.objects[0].mesh = 3; }},
      {"objects[0].materials of 'floor' has 1 entries, but material_index[1]",
       [](auto& s) {
         s.meshes[0].material_index = {0, 2};
       }},
      {"objects[1].process is missing", [](auto& s) { s.objects[1].process = nullptr; }},
      {".vertices[1] holds nan", [=](auto& s) { s.meshes[0].vertices[4] = nan; }},
      {".triangles[1] names vertex 9", [](auto& s) { s.meshes[0].triangles[5] = 9; }},
      {".normals holds 3 numbers",
       [](auto& s) {
         s.meshes[0].normals = {0, 0, 1};
       }},
      {".material_index has 1 entries", [](auto& s) { s.meshes[0].material_index = {0}; }},
      {".roughness is -1", [](auto& s) { s.materials[0].roughness = -1; }},
      {".color is (2, 0, 0)",
       [](auto& s) {
         s.materials[0].color = {2, 0, 0};
       }},
      {"lights[0].power is nan", [=](auto& s) { s.lights[0].power = nan; }},
      {"lights[0].size is (0, 1)",
       [](auto& s) {
         s.lights[0].type = LightDescription::Type::area;
         s.lights[0].size_x = 0;
       }},
      {"lights[0].angle is 0; a spot",
       [](auto& s) { s.lights[0].type = LightDescription::Type::spot; }},
      {"world.image holds 5 numbers", [](auto& s) { s.world.image.resize(5); }},
      {"world.image holds inf at row 1, column 0",
       [](auto& s) {
         set_world_image(s, 2, 2, 1);
         s.world.image[6] = std::numeric_limits<float>::infinity();
       }},
      {"world.matrix is not a rotation",
       [](auto& s) {
         set_world_image(s, 2, 2, 1);
         s.world.matrix.row[0].x = 2;
       }},
      {"settings.missed_root is 0", [](auto& s) { s.settings.missed_root = 0; }},
      {"settings.max_bounces is -1", [](auto& s) { s.settings.max_bounces = -1; }},
  };
  Scene{good()};
  for (const auto& [sentence, damage] : rows) {
    context() = sentence;
    SceneDescription s = good();
    damage(s);
    std::string said = "(accepted)";
    try {
      Scene{s};
    } catch (const std::invalid_argument& error) {
      said = error.what();
    }
    if (said.find(sentence) == std::string::npos) CHECK(said, ==, sentence);
  }
}

TEST(what_a_scene_does_not_need_is_left_out) {
  const auto ray = [](Rng& rng) {
    return Ray{{0, 0, 3}, normalize(Vec3{0, 0, -3} + any_direction(rng))};
  };
  SceneDescription s = good();
  s.lights.clear();
  s.objects.erase(s.objects.begin());
  CHECK(row(Scene(s), "scene.embree").substr(0, 8), ==, "left out");
  CHECK(row(Scene(s), "scene.light_sampling").substr(0, 8), ==, "left out");
  CHECK(trace(s, ray, 100).counters.mesh_rays, ==, 0u);
  CHECK(trace(s, ray, 100).counters.shadow_rays, ==, 0u);

  s = good();
  CHECK(row(Scene(s), "scene.embree"), ==, "1 mesh objects");
  CHECK(row(Scene(s), "scene.light_sampling").substr(0, 2), ==, "on");
  CHECK(row(Scene(s), "objects[1].memory"), ==, "renewal+");
  CHECK(trace(s, ray, 100).counters.shadow_rays, >, 0u);

  // A mirror of a mesh is never lit by light sampling; a process out of the way costs nothing.
  s.materials[0].type = MaterialDescription::Type::mirror;
  s.objects[1].matrix.translation = {100, 0, 0};
  const Counters c = trace(s, ray, 100).counters;
  CHECK(c.mesh_rays, >, 0u);
  CHECK(c.shadow_rays, ==, 0u);
  CHECK(c.line_evaluations + c.line_skipped + c.mean_lookups, ==, 0u);
}
