#include "binding/description_reader.h"

#include <algorithm>
#include <climits>
#include <cstdint>
#include <map>

#include "binding/arguments.h"
#include "binding/color_field_argument.h"
#include "binding/reader.h"

namespace gpis {

namespace {

// A named thing by the name it has in the description.
using Names = std::map<std::string, int>;

std::string listed(const Names& names) {
  std::string s;
  for (const auto& [name, index] : names) s += (s.empty() ? "'" : ", '") + name + "'";
  return s.empty() ? "none" : s;
}

int resolve(const std::string& name, const Names& names, const std::string& path,
            const char* kind) {
  const auto found = names.find(name);
  if (found == names.end())
    refuse(path, "there is no " + std::string(kind) + " '" + name + "' (the description has " +
                     listed(names) + ")");
  return found->second;
}

SettingsDescription read_settings(const py::handle& value) {
  Reader r(value, "settings");
  SettingsDescription s;
  if (r.has("max_bounces") && !r.required("max_bounces").is_none()) {
    const auto bounces = to_integers(r.required("max_bounces"), r.path_of("max_bounces"), {});
    s.max_bounces = static_cast<int>(std::clamp<std::int64_t>(bounces[0], -1, INT_MAX));
  }
  s.missed_root = r.number("missed_root", s.missed_root);
  if (r.has("filter")) {
    Reader filter(r.required("filter"), "settings.filter");
    s.filter =
        static_cast<SettingsDescription::Filter>(filter.choice("type", {"box", "blackman_harris"}));
    s.filter_width = filter.number("width", s.filter_width);
    filter.finish("a filter");
  }
  s.clamp = r.number("clamp", s.clamp);
  s.light_sampling = r.flag("light_sampling", s.light_sampling);
  r.finish("settings");
  return s;
}

CameraDescription read_camera(const py::handle& value) {
  Reader r(value, "camera");
  CameraDescription c;
  c.type = static_cast<CameraDescription::Type>(
      r.choice("type", {"perspective", "orthographic", "equirectangular"}));
  c.matrix = to_affine(r.required("matrix"), "camera.matrix");
  if (c.type == CameraDescription::Type::perspective) {
    c.fov_x = r.number("fov_x");
  } else if (c.type == CameraDescription::Type::orthographic) {
    c.width = r.number("width");
  }
  if (c.type != CameraDescription::Type::equirectangular && r.has("shift")) {
    const DoubleArray shift = to_numbers(r.required("shift"), "camera.shift", {2});
    c.shift_x = shift.at(0);
    c.shift_y = shift.at(1);
  }
  if (r.has("clip")) {
    const auto clip = to_items(r.required("clip"), "camera.clip");
    if (clip.size() != 2)
      refuse("camera.clip", "takes two distances (near, far), got " + std::to_string(clip.size()));
    c.clip_near = to_number(clip[0], "camera.clip[0]");
    c.clip_far = to_number(clip[1], "camera.clip[1]");  // may be infinite
  }
  r.has("lens");
  r.unsupported("lens",
                "depth of field is not supported by this version; give None or leave the key out");
  static const char* const kNames[] = {"a perspective camera", "an orthographic camera",
                                       "an equirectangular camera"};
  r.finish(kNames[static_cast<int>(c.type)]);
  return c;
}

WorldDescription read_world(const py::handle& value) {
  Reader r(value, "world");
  WorldDescription w;
  w.strength = r.number("strength", 1);
  if (r.has("image")) {
    if (r.has("color")) refuse("world", "takes either color or image, got both");
    const DoubleArray image = to_numbers(r.required("image"), "world.image", {-1, -1, 3});
    if (image.size() == 0) refuse("world.image", "has no pixel; give an (H, W, 3) image");
    w.image_height = static_cast<int>(image.shape(0));
    w.image_width = static_cast<int>(image.shape(1));
    w.image.assign(image.data(), image.data() + image.size());
    if (r.has("matrix")) w.matrix = to_mat3(r.required("matrix"), "world.matrix");
    r.finish("a world with an image");
  } else {
    w.color = r.has("color") ? r.color("color") : Color{};
    r.has("image");
    r.finish("a world of one colour");
  }
  return w;
}

LightDescription read_light(const py::handle& value, const std::string& path) {
  Reader r(value, path);
  LightDescription l;
  l.type = static_cast<LightDescription::Type>(r.choice("type", {"point", "spot", "sun", "area"}));
  l.name = r.text("name", "");
  l.matrix = r.affine("matrix");
  if (r.has("color")) l.color = r.color("color");
  const bool area = l.type == LightDescription::Type::area;
  if (area && r.has("radiance")) {
    if (r.has("power")) refuse(path, "takes either power or radiance, got both");
    l.radiance = r.color("radiance");
  } else {
    l.power = r.number("power");
  }
  l.visible_to_camera = r.flag("visible_to_camera", l.visible_to_camera);
  switch (l.type) {
    case LightDescription::Type::point:
      l.radius = r.number("radius", 0);
      break;
    case LightDescription::Type::spot:
      l.radius = r.number("radius", 0);
      l.angle = r.number("angle");
      l.blend = r.number("blend", 0);
      break;
    case LightDescription::Type::sun:
      l.angle = r.number("angle", 0);
      break;
    case LightDescription::Type::area: {
      const DoubleArray size = to_numbers(r.required("size"), r.path_of("size"), {2});
      l.size_x = size.at(0);
      l.size_y = size.at(1);
      l.ellipse = r.choice("shape", {"rectangle", "ellipse"}, 0) == 1;
      break;
    }
  }
  static const char* const kNames[] = {"a point light", "a spot light", "a sun light",
                                       "an area light"};
  r.finish(kNames[static_cast<int>(l.type)]);
  return l;
}

MaterialDescription read_material(const py::handle& value, const std::string& name) {
  const std::string path = "materials['" + name + "']";
  Reader r(value, path);
  const std::string type = to_text(r.required("type"), r.path_of("type"));
  if (type == "mix")
    refuse(r.path_of("type"),
           "'mix' is not supported by this version (takes lambert, mirror, conductor, principled, "
           "dielectric)");
  MaterialDescription m;
  m.name = name;
  m.type = static_cast<MaterialDescription::Type>(
      r.choice("type", {"lambert", "mirror", "conductor", "principled", "dielectric"}));
  const bool dielectric = m.type == MaterialDescription::Type::dielectric;
  if (dielectric) m.color = {1, 1, 1};
  if (r.has("color")) m.color = r.color("color");
  if (m.type == MaterialDescription::Type::conductor ||
      m.type == MaterialDescription::Type::principled)
    m.roughness = r.number("roughness", 0.5);
  if (m.type == MaterialDescription::Type::principled) m.metallic = r.number("metallic", 0);
  if (dielectric) {
    m.ior = r.number("ior", m.ior);
    m.roughness = r.number("roughness", 0);
    if (r.has("reflection")) m.reflection = r.color("reflection");
  }
  r.finish("a " + type + " material");
  return m;
}

MeshDescription read_mesh(const py::handle& value, const std::string& name) {
  const std::string path = "meshes['" + name + "']";
  Reader r(value, path);
  MeshDescription m;
  m.name = name;
  const DoubleArray vertices = to_numbers(r.required("vertices"), r.path_of("vertices"), {-1, 3});
  m.vertices.assign(vertices.data(), vertices.data() + vertices.size());
  const auto triangles = to_integers(r.required("triangles"), r.path_of("triangles"), {-1, 3});
  const auto count = static_cast<int>(triangles.size() / 3);
  for (const std::int64_t index : triangles)
    if (index < 0 || index > UINT32_MAX)
      refuse(r.path_of("triangles"),
             "names vertex " + std::to_string(index) + "; vertices are counted from 0");
  m.triangles.assign(triangles.begin(), triangles.end());
  if (r.has("normals")) {
    const py::object given = r.required("normals");
    m.normals_per_corner = py::module_::import("numpy").attr("ndim")(given).equal(py::int_(3));
    const DoubleArray normals =
        to_numbers(given, r.path_of("normals"),
                   m.normals_per_corner ? std::vector<int>{count, 3, 3}
                                        : std::vector<int>{static_cast<int>(vertices.shape(0)), 3});
    m.normals.assign(normals.data(), normals.data() + normals.size());
  }
  if (r.has("material_index")) {
    const auto index =
        to_integers(r.required("material_index"), r.path_of("material_index"), {count});
    for (const std::int64_t i : index)
      m.material_index.push_back(
          static_cast<std::int32_t>(std::clamp<std::int64_t>(i, -1, INT_MAX)));
  }
  r.has("uvs");
  r.unsupported("uvs", "textured meshes are not supported by this version; leave the key out");
  r.finish("a mesh");
  return m;
}

ObjectDescription read_object(const py::handle& value, const std::string& path, const Names& meshes,
                              const Names& materials) {
  Reader r(value, path);
  ObjectDescription o;
  o.type = static_cast<ObjectDescription::Type>(r.choice("type", {"mesh", "gpis"}));
  o.name = r.text("name", "");
  o.matrix = r.affine("matrix");
  const auto names = to_items(r.required("materials"), r.path_of("materials"));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string item = r.path_of("materials") + "[" + std::to_string(i) + "]";
    o.materials.push_back(resolve(to_text(names[i], item), materials, item, "material"));
  }
  if (o.type == ObjectDescription::Type::mesh) {
    o.mesh =
        resolve(to_text(r.required("mesh"), r.path_of("mesh")), meshes, r.path_of("mesh"), "mesh");
    r.finish("a mesh object");
    return o;
  }
  const py::object process = r.required("process");
  if (!py::isinstance<GaussianProcess>(process) && !py::isinstance<ProcessTree>(process))
    refuse(r.path_of("process"),
           "takes a GaussianProcess or a CSG tree of them, got " + shown(process));
  o.process = tree_argument(process, r.path_of("process"));
  o.memory = memory_argument(r.text("memory", "renewal+"), r.path_of("memory"));
  o.sampler = static_cast<Sampler>(r.choice("sampler",
                                            {"auto", "convolution", "markov", "spectral", "nystrom",
                                             "dense", "realisation", "first_passage"},
                                            0));
  if (r.has("albedo")) o.albedo = color_field_argument(r.required("albedo"), r.path_of("albedo"));
  r.finish("a gpis object");
  return o;
}

// Calls read(value, name) for every item of a dict of named things, in the dict's order.
template <class Read>
Names read_named(Reader& r, const char* key, Read read) {
  Names names;
  if (!r.has(key)) return names;
  const Reader items(r.required(key), key);
  for (const auto& [name, value] : items.dict()) {
    const std::string text = to_text(name, std::string(key) + ": a name");
    names[text] = static_cast<int>(names.size());
    read(value, text);
  }
  return names;
}

}  // namespace

SceneDescription read_description(const py::handle& dict) {
  Reader r(dict, "");
  SceneDescription scene;
  const auto version = to_integers(r.required("version"), "version", {});
  if (version[0] != 1) refuse("version", "takes 1, got " + std::to_string(version[0]));
  if (r.has("settings")) scene.settings = read_settings(r.required("settings"));
  scene.camera = read_camera(r.required("camera"));
  if (r.has("world")) scene.world = read_world(r.required("world"));
  if (r.has("lights")) {
    const auto lights = to_items(r.required("lights"), "lights");
    for (std::size_t i = 0; i < lights.size(); ++i)
      scene.lights.push_back(read_light(lights[i], "lights[" + std::to_string(i) + "]"));
  }
  const Names materials =
      read_named(r, "materials", [&](const py::handle& value, const std::string& name) {
        scene.materials.push_back(read_material(value, name));
      });
  const Names meshes =
      read_named(r, "meshes", [&](const py::handle& value, const std::string& name) {
        scene.meshes.push_back(read_mesh(value, name));
      });
  if (r.has("objects")) {
    const auto objects = to_items(r.required("objects"), "objects");
    for (std::size_t i = 0; i < objects.size(); ++i)
      scene.objects.push_back(
          read_object(objects[i], "objects[" + std::to_string(i) + "]", meshes, materials));
  }
  r.finish("a description");
  return scene;
}

}  // namespace gpis
