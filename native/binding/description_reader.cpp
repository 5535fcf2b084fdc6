#include "binding/description_reader.h"

#include <map>
#include <optional>

#include "binding/reader.h"

namespace gpis {

namespace {

constexpr double kTiny = 1e-300;  // "positive" as the lower end of a range

// A named thing by the name it has in the description.
using Names = std::map<std::string, int>;

std::string listed(const Names& names) {
  std::string s;
  for (const auto& [name, index] : names) s += (s.empty() ? "'" : ", '") + name + "'";
  return s.empty() ? "none" : s;
}

int resolve(const std::string& name, const Names& names, const std::string& path, const char* kind) {
  const auto found = names.find(name);
  if (found == names.end())
    refuse(path, "there is no " + std::string(kind) + " '" + name + "' (the description has " + listed(names) + ")");
  return found->second;
}

SettingsDescription read_settings(const py::handle& value) {
  Reader r(value, "settings");
  SettingsDescription s;
  if (r.has("max_bounces") && !r.required("max_bounces").is_none()) {
    const auto bounces = to_integers(r.required("max_bounces"), r.path_of("max_bounces"), {});
    if (bounces[0] < 0 || bounces[0] > 1'000'000)
      refuse(r.path_of("max_bounces"), "takes None (unlimited) or 0 to 1000000, got " + std::to_string(bounces[0]));
    s.max_bounces = static_cast<int>(bounces[0]);
  }
  s.missed_root = r.number("missed_root", s.missed_root, 1e-12, 0.5, "a probability between 1e-12 and 0.5");
  if (r.has("filter")) {
    Reader filter(r.required("filter"), "settings.filter");
    s.filter = static_cast<SettingsDescription::Filter>(filter.choice("type", {"box", "blackman_harris"}));
    s.filter_width = filter.number("width", s.filter_width, 1e-3, 100, "a width in pixels between 0.001 and 100");
    filter.finish("a filter");
  }
  s.clamp = r.number("clamp", s.clamp, 0, kInfinity, "0 (off) or a positive radiance");
  s.light_sampling = r.flag("light_sampling", s.light_sampling);
  r.finish("settings");
  return s;
}

CameraDescription read_camera(const py::handle& value) {
  Reader r(value, "camera");
  CameraDescription c;
  c.type = static_cast<CameraDescription::Type>(r.choice("type", {"perspective", "orthographic", "equirectangular"}));
  c.matrix = to_affine(r.required("matrix"), "camera.matrix");
  if (c.type == CameraDescription::Type::perspective) {
    c.fov_x = to_number(r.required("fov_x"), "camera.fov_x");
    if (!(c.fov_x > 0 && c.fov_x < kPi))
      refuse("camera.fov_x", "takes an angle between 0 and π in radians, got " + shown(r.required("fov_x")));
  } else if (c.type == CameraDescription::Type::orthographic) {
    r.required("width");
    c.width = r.number("width", 0, kTiny, 1e30, "a positive width in metres");
  }
  if (c.type != CameraDescription::Type::equirectangular && r.has("shift")) {
    const DoubleArray shift = to_numbers(r.required("shift"), "camera.shift", {2});
    c.shift_x = shift.at(0);
    c.shift_y = shift.at(1);
  }
  if (r.has("clip")) {
    const auto clip = to_items(r.required("clip"), "camera.clip");
    if (clip.size() != 2) refuse("camera.clip", "takes two distances (near, far), got " + std::to_string(clip.size()));
    c.clip_near = to_number(clip[0], "camera.clip[0]");
    c.clip_far = to_number(clip[1], "camera.clip[1]");  // may be infinite
    if (!(c.clip_near >= 0 && c.clip_near < c.clip_far))
      refuse("camera.clip", "takes 0 <= near < far, got " + shown(clip[0]) + " and " + shown(clip[1]));
  }
  r.has("lens");
  r.unsupported("lens", "depth of field is not supported by this version; give None or leave the key out");
  static const char* const kNames[] = {"a perspective camera", "an orthographic camera", "an equirectangular camera"};
  r.finish(kNames[static_cast<int>(c.type)]);
  return c;
}

WorldDescription read_world(const py::handle& value) {
  Reader r(value, "world");
  WorldDescription w;
  const double strength = r.number("strength", 1, 0, 1e30, "a number that is not negative");
  if (r.has("image")) {
    if (r.has("color")) refuse("world", "takes either color or image, got both");
    const DoubleArray image = to_numbers(r.required("image"), "world.image", {-1, -1, 3});
    if (image.size() == 0) refuse("world.image", "has no pixel; give an (H, W, 3) image");
    w.image_height = static_cast<int>(image.shape(0));
    w.image_width = static_cast<int>(image.shape(1));
    w.image.assign(image.data(), image.data() + image.size());
    for (const float v : w.image)
      if (!(v >= 0) || v == static_cast<float>(kInfinity))
        refuse("world.image", "holds a value that is negative or too large for a 32-bit float; clamp the image first");
    if (r.has("matrix")) w.matrix = to_mat3(r.required("matrix"), "world.matrix");
    if (!(std::abs(determinant(w.matrix)) > 0)) refuse("world.matrix", "is singular; give a rotation");
    w.strength = strength;
    r.finish("a world with an image");
  } else {
    w.color = r.has("color") ? r.color("color") : Color{};
    w.color *= strength;
    r.has("image");
    r.finish("a world of one colour");
  }
  return w;
}

LightDescription read_light(const py::handle& value, const std::string& path) {
  Reader r(value, path);
  LightDescription l;
  l.type = static_cast<LightDescription::Type>(r.choice("type", {"point", "spot", "sun", "area"}));
  l.name = r.text("name", path);
  l.matrix = r.affine("matrix");
  if (r.has("color")) l.color = r.color("color");
  const bool area = l.type == LightDescription::Type::area;
  if (area && r.has("radiance")) {
    if (r.has("power")) refuse(path, "takes either power or radiance, got both");
    l.radiance = r.color("radiance");
  } else {
    r.required("power");
    l.power = r.number("power", 0, 0, 1e30, "a power that is not negative (W; of a sun the irradiance, W/m²)");
  }
  switch (l.type) {
    case LightDescription::Type::point: l.radius = r.number("radius", 0, 0, 1e30, "a radius that is not negative"); break;
    case LightDescription::Type::spot:
      l.radius = r.number("radius", 0, 0, 1e30, "a radius that is not negative");
      r.required("angle");
      l.angle = r.number("angle", 0, kTiny, kPi, "the full angle of the cone in radians, up to π");
      l.blend = r.number("blend", 0, 0, 1, "a fraction between 0 and 1");
      break;
    case LightDescription::Type::sun: l.angle = r.number("angle", 0, 0, kPi, "the angle of the sun's disk in radians, up to π"); break;
    case LightDescription::Type::area: {
      const DoubleArray size = to_numbers(r.required("size"), r.path_of("size"), {2});
      l.size_x = size.at(0);
      l.size_y = size.at(1);
      if (!(l.size_x > 0 && l.size_y > 0)) refuse(r.path_of("size"), "takes two positive lengths, got " + std::string(py::str(size)));
      l.ellipse = r.choice("shape", {"rectangle", "ellipse"}, 0) == 1;
      break;
    }
  }
  static const char* const kNames[] = {"a point light", "a spot light", "a sun light", "an area light"};
  r.finish(kNames[static_cast<int>(l.type)]);
  return l;
}

MaterialDescription read_material(const py::handle& value, const std::string& name) {
  const std::string path = "materials['" + name + "']";
  Reader r(value, path);
  const std::string type = to_text(r.required("type"), r.path_of("type"));
  if (type == "dielectric" || type == "mix")
    refuse(r.path_of("type"), "'" + type + "' is not supported by this version (takes lambert, mirror, conductor, principled)");
  MaterialDescription m;
  m.name = name;
  m.type = static_cast<MaterialDescription::Type>(r.choice("type", {"lambert", "mirror", "conductor", "principled"}));
  if (r.has("color")) {
    m.color = r.color("color");
    if (max_component(m.color) > 1)
      refuse(r.path_of("color"), "takes three numbers between 0 and 1 (a surface reflects at most what it receives), got " +
                                     std::string(py::str(to_numbers(r.required("color"), path, {3}))));
  }
  if (m.type == MaterialDescription::Type::conductor || m.type == MaterialDescription::Type::principled)
    m.roughness = r.number("roughness", 0.5, 0, 1, "a number between 0 and 1");
  if (m.type == MaterialDescription::Type::principled) m.metallic = r.number("metallic", 0, 0, 1, "a number between 0 and 1");
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
    if (index < 0 || index >= vertices.shape(0))
      refuse(r.path_of("triangles"), "names vertex " + std::to_string(index) + ", but there are " +
                                         std::to_string(vertices.shape(0)) + " vertices");
  m.triangles.assign(triangles.begin(), triangles.end());
  if (r.has("normals")) {
    const py::object given = r.required("normals");
    const bool per_corner = py::module_::import("numpy").attr("ndim")(given).equal(py::int_(3));
    const DoubleArray normals =
        to_numbers(given, r.path_of("normals"),
                   per_corner ? std::vector<int>{count, 3, 3} : std::vector<int>{static_cast<int>(vertices.shape(0)), 3});
    m.normals.assign(normals.data(), normals.data() + normals.size());
  }
  if (r.has("material_index")) {
    const auto index = to_integers(r.required("material_index"), r.path_of("material_index"), {count});
    for (const std::int64_t i : index)
      if (i < 0 || i > 32767) refuse(r.path_of("material_index"), "takes numbers from 0 to 32767, got " + std::to_string(i));
    m.material_index.assign(index.begin(), index.end());
  }
  r.has("uvs");
  r.unsupported("uvs", "textured meshes are not supported by this version; leave the key out");
  r.finish("a mesh");
  return m;
}

ObjectDescription read_object(const py::handle& value, const std::string& path, const SceneDescription& scene,
                              const Names& meshes, const Names& materials) {
  Reader r(value, path);
  ObjectDescription o;
  o.type = static_cast<ObjectDescription::Type>(r.choice("type", {"mesh", "gpis"}));
  o.name = r.text("name", path);
  o.matrix = r.affine("matrix");
  const auto names = to_items(r.required("materials"), r.path_of("materials"));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string item = r.path_of("materials") + "[" + std::to_string(i) + "]";
    o.materials.push_back(resolve(to_text(names[i], item), materials, item, "material"));
  }
  if (o.type == ObjectDescription::Type::mesh) {
    const std::string mesh = to_text(r.required("mesh"), r.path_of("mesh"));
    o.mesh = resolve(mesh, meshes, r.path_of("mesh"), "mesh");
    std::size_t needed = 1;
    for (const std::int32_t i : scene.meshes[o.mesh].material_index) needed = std::max(needed, std::size_t(i) + 1);
    if (o.materials.size() < needed)
      refuse(r.path_of("materials"), "mesh '" + mesh + "' needs " + std::to_string(needed) + ", got " +
                                         std::to_string(o.materials.size()));
    r.finish("a mesh object");
    return o;
  }
  const py::object process = r.required("process");
  if (!py::isinstance<GaussianProcess>(process))
    refuse(r.path_of("process"), "takes a GaussianProcess, got " + shown(process));
  o.process = py::cast<std::shared_ptr<GaussianProcess>>(process);
  if (o.materials.size() != 1)
    refuse(r.path_of("materials"), "a process takes one material, got " + std::to_string(o.materials.size()));
  if (r.has("memory")) o.memory = read_memory(r.required("memory"), r.path_of("memory"));
  o.sampler = static_cast<Sampler>(r.choice("sampler", {"auto", "convolution", "dense"}, 0));
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

Memory read_memory(const py::handle& value, const std::string& path) {
  const std::string text = to_text(value, path);
  if (text == "none") return Memory::none;
  if (text == "renewal") return Memory::renewal;
  if (text == "renewal+") return Memory::renewal_plus;
  refuse(path, "takes none, renewal, renewal+, got '" + text + "'");
}

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
  const Names materials = read_named(r, "materials", [&](const py::handle& value, const std::string& name) {
    scene.materials.push_back(read_material(value, name));
  });
  const Names meshes = read_named(r, "meshes", [&](const py::handle& value, const std::string& name) {
    scene.meshes.push_back(read_mesh(value, name));
  });
  if (r.has("objects")) {
    const auto objects = to_items(r.required("objects"), "objects");
    for (std::size_t i = 0; i < objects.size(); ++i)
      scene.objects.push_back(
          read_object(objects[i], "objects[" + std::to_string(i) + "]", scene, meshes, materials));
  }
  r.finish("a description");
  return scene;
}

}  // namespace gpis
