#include "scene/check.h"

#include <sstream>
#include <stdexcept>

namespace gpis {
namespace {

// Areas and solid angles of lights below this (squared) or above its inverse are no numbers.
constexpr double kSmallestLight = 1e-30;

template <class... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  std::ostringstream sentence;
  (sentence << ... << parts);
  throw std::invalid_argument(sentence.str());
}

std::string text(const Color& c) {
  std::ostringstream s;
  s << "(" << c.x << ", " << c.y << ", " << c.z << ")";
  return s.str();
}

void check_at_least(double value, double low, const std::string& path) {
  if (!(value >= low) || !std::isfinite(value))
    fail(path, " is ", value, "; give a finite number of at least ", low, ".");
}

void check_between(double value, double low, double high, const std::string& path) {
  if (!(value >= low && value <= high))
    fail(path, " is ", value, "; give a number from ", low, " to ", high, ".");
}

void check_color(const Color& c, double high, const std::string& path) {
  for (int k = 0; k < 3; ++k)
    if (!(c[k] >= 0 && c[k] <= high) || !std::isfinite(c[k]))
      fail(
          path, " is ", text(c), "; each entry must be finite, not negative",
          high < kInfinity ? " and at most 1 (a surface reflects no more than it receives)." : ".");
}

// Of a length that may also be left out (0).
void check_size(double value, const std::string& path) {
  if (value != 0) check_between(value, kSmallestLight, 1 / kSmallestLight, path);
}

double largest(const Vec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

// Greatest sum of a row's absolute entries.
double greatest_row(const Mat3& m) {
  double most = 0;
  for (const Vec3& row : m.row)
    most = std::max(most, std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
  return most;
}

void check_within_reach(const Affine& m, const std::string& path) {
  for (const Vec3& v : {m.linear.row[0], m.linear.row[1], m.linear.row[2], m.translation})
    if (!is_finite(v)) fail(path, " holds numbers that are not finite.");
  for (const Vec3& v : {m.linear.row[0], m.linear.row[1], m.linear.row[2], m.translation})
    if (!(largest(v) <= kFarthest))
      fail(path, " holds ", largest(v), "; give places and scales of at most ", kFarthest, ".");
}

void check_transform(const Affine& m, const std::string& path) {
  check_within_reach(m, path);
  double size = 1;
  for (const Vec3& row : m.linear.row) size *= length(row);
  if (!(std::abs(determinant(m.linear)) > 1e-12 * size))
    fail(path, " flattens space (its determinant is ", determinant(m.linear),
         "): the object has no size along some axis. Give it a scale other than zero.");
}

void check_settings(const SettingsDescription& s) {
  if (s.max_bounces && *s.max_bounces < 0)
    fail("settings.max_bounces is ", *s.max_bounces, "; give 0 or more, or None for no limit.");
  if (!(s.missed_root > 0 && s.missed_root < 1))
    fail("settings.missed_root is ", s.missed_root,
         "; give a probability between 0 and 1, such as 1e-3.");
  check_at_least(s.clamp, 0, "settings.clamp");
  check_between(s.filter_width, 1e-3, 100, "settings.filter.width");
}

void check_camera(const CameraDescription& c) {
  check_within_reach(c.matrix, "camera.matrix");
  Mat3 axes = transpose(c.matrix.linear);
  for (Vec3& axis : axes.row) {
    if (!(length(axis) > 0)) fail("camera.matrix has an axis of length zero.");
    axis = normalize(axis);
  }
  if (!(std::abs(determinant(axes)) > 1e-12))
    fail("camera.matrix flattens space; give three axes that do not lie in a plane.");
  check_between(c.shift_x, -kFarthest, kFarthest, "camera.shift[0]");
  check_between(c.shift_y, -kFarthest, kFarthest, "camera.shift[1]");
  if (c.type == CameraDescription::Type::perspective && !(c.fov_x > 0 && c.fov_x < kPi))
    fail("camera.fov_x is ", c.fov_x, "; give an angle between 0 and π radians.");
  if (c.type == CameraDescription::Type::orthographic && !(c.width > 0 && c.width <= kFarthest))
    fail("camera.width is ", c.width, "; give a positive width in metres, at most ", kFarthest,
         ".");
  check_between(c.clip_near, 0, kFarthest, "camera.clip[0]");
  if (!(c.clip_near < c.clip_far))
    fail("camera.clip is (", c.clip_near, ", ", c.clip_far,
         "); the near distance must be less than the far one.");
}

// Finite numbers whose product is not.
void check_light_sent(const Color& color, double by, const std::string& what) {
  if (!std::isfinite(3 * max_component(color) * by))
    fail(what, " make more light than a number holds (", max_component(color), " times ", by, ").");
}

void check_world(const WorldDescription& w) {
  check_color(w.color, kInfinity, "world.color");
  check_at_least(w.strength, 0, "world.strength");
  if (w.image.empty()) return check_light_sent(w.color, w.strength, "world.color and strength");
  if (w.image_width < 1 || w.image_height < 1 ||
      w.image.size() != 3ull * w.image_width * w.image_height)
    fail("world.image holds ", w.image.size(), " numbers, but its size is ", w.image_width, " x ",
         w.image_height, " x 3.");
  for (std::size_t i = 0; i < w.image.size(); ++i)
    if (!std::isfinite(w.image[i]))
      fail("world.image holds ", w.image[i], " at row ", i / 3 / w.image_width, ", column ",
           i / 3 % w.image_width, "; all its numbers must be finite.");
  const auto [least, most] = std::minmax_element(w.image.begin(), w.image.end());
  const double largest = std::max(-*least, *most);
  check_light_sent({largest, largest, largest}, w.strength, "world.image and strength");
  const Mat3 square = w.matrix * transpose(w.matrix);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (!(std::abs(square.row[i][j] - (i == j)) < 1e-4))
        fail(
            "world.matrix is not a rotation (M Mᵀ differs from the identity); give one without "
            "scale or shear.");
}

void check_light(const LightDescription& l, const EntryPath& path) {
  check_transform(l.matrix, path + ".matrix");
  check_color(l.color, kInfinity, path + ".color");
  check_at_least(l.power, 0, path + ".power");
  if (l.radiance) check_color(*l.radiance, kInfinity, path + ".radiance");
  check_light_sent(l.color, l.power, path + ": color and power");
  check_size(l.radius, path + ".radius");
  check_between(l.blend, 0, 1, path + ".blend");
  if (l.type == LightDescription::Type::area) {
    if (!(l.size_x > 0 && l.size_y > 0))
      fail(path + ".size", " is (", l.size_x, ", ", l.size_y,
           "); an area light needs a positive size.");
    check_size(l.size_x, path + ".size[0]");
    check_size(l.size_y, path + ".size[1]");
  }
  if (l.type == LightDescription::Type::sun) {
    check_size(l.angle, path + ".angle");
    check_between(l.angle, 0, kPi, path + ".angle");
  }
  if (l.type == LightDescription::Type::spot && !(l.angle > 0 && l.angle <= kPi))
    fail(path + ".angle", " is ", l.angle,
         "; a spot needs a cone of more than 0 and at most π radians.");
}

void check_material(const MaterialDescription& m, const EntryPath& path) {
  check_color(m.color, 1, path + ".color");
  check_between(m.roughness, 0, 1, path + ".roughness");
  check_between(m.metallic, 0, 1, path + ".metallic");
  check_between(m.ior, 1e-3, 1e3, path + ".ior");
  check_color(m.reflection, 1, path + ".reflection");
}

void check_mesh(const MeshDescription& m, const EntryPath& path) {
  if (m.vertices.size() % 3)
    fail(path + ".vertices", " holds ", m.vertices.size(), " numbers; give (N, 3).");
  if (m.triangles.size() % 3)
    fail(path + ".triangles", " holds ", m.triangles.size(), " indices; give (M, 3).");
  const std::size_t vertices = m.vertices.size() / 3, triangles = m.triangles.size() / 3;
  for (std::size_t i = 0; i < m.vertices.size(); ++i)
    if (!std::isfinite(m.vertices[i]))
      fail(path + (".vertices[" + std::to_string(i / 3) + "]"), " holds ", m.vertices[i],
           "; coordinates must be finite.");
  for (std::size_t i = 0; i < m.triangles.size(); ++i)
    if (m.triangles[i] >= vertices)
      fail(path + (".triangles[" + std::to_string(i / 3) + "]"), " names vertex ", m.triangles[i],
           ", but there are only ", vertices, ".");
  const std::size_t normals = 3 * (m.normals_per_corner ? 3 * triangles : vertices);
  if (!m.normals.empty() && m.normals.size() != normals)
    fail(path + ".normals", " holds ", m.normals.size(), " numbers; ",
         m.normals_per_corner ? "three per corner" : "three per vertex", " are ", normals, ".");
  for (std::size_t i = 0; i < m.normals.size(); ++i)
    if (!std::isfinite(m.normals[i]))
      fail(path + (".normals[" + std::to_string(i / 3) + "]"), " holds ", m.normals[i],
           "; normals must be finite.");
  if (!m.material_index.empty() && m.material_index.size() != triangles)
    fail(path + ".material_index", " has ", m.material_index.size(), " entries for ", triangles,
         " triangles.");
}

// A stochastic object so small against its place, or so flat, that double precision does not tell
// its points apart in its own space: rays would start far from the surface that they leave.
void check_resolved(const Affine& m, const std::string& path) {
  const double across = greatest_row(m.linear) + largest(m.translation);
  const double ratio = greatest_row(inverse(m.linear)) * across;
  if (!(ratio <= 1e12))
    fail(path, " makes the object ", ratio,
         " times smaller (along some axis) than its distance from the origin or its length; double "
         "precision does not resolve it. Give it more even scales, or a place nearer to the "
         "origin.");
}

// A ray inside of a composed body does not know which operand it is in.
void check_one_medium(const SceneDescription& d, const ObjectDescription& o,
                      const std::string& path) {
  const auto index = [](const MaterialDescription& m) {
    return m.type == MaterialDescription::Type::dielectric ? m.ior : 0;
  };
  const MaterialDescription& first = d.materials[o.materials[0]];
  for (const int m : o.materials) {
    const MaterialDescription& other = d.materials[m];
    if (index(other) == index(first)) continue;
    fail(
        path, " mixes '", first.name, "' and '", other.name,
        "'; the operands of one object are one medium: give all of them dielectrics of one ior, or "
        "none, and put what differs into an object of its own.");
  }
}

void check_object(const SceneDescription& d, const std::vector<double>& farthest_vertex,
                  const ObjectDescription& o, const EntryPath& path) {
  check_transform(o.matrix, path + ".matrix");
  if (o.type == ObjectDescription::Type::gpis) check_resolved(o.matrix, path + ".matrix");
  for (const int m : o.materials)
    if (m < 0 || m >= static_cast<int>(d.materials.size()))
      fail(path + ".materials", " names a material that is not in `materials`.");
  if (o.type == ObjectDescription::Type::gpis) {
    if (!o.process) fail(path + ".process", " is missing; a gpis object needs one.");
    const std::size_t leaves = o.process->leaves().size();
    if (o.materials.size() != 1 && o.materials.size() != leaves)
      fail(path + ".materials", " has ", o.materials.size(), " entries; a gpis object takes one",
           leaves > 1 ? ", or one for each of its " + std::to_string(leaves) + " operands." : ".");
    check_one_medium(d, o, path + ".materials");
    return;
  }
  if (o.mesh < 0 || o.mesh >= static_cast<int>(d.meshes.size()))
    fail(path + ".mesh", " names a mesh that is not in `meshes`.");
  const double reach =
      farthest_vertex[o.mesh] * greatest_row(o.matrix.linear) + largest(o.matrix.translation);
  if (!(reach <= kFarthest))
    fail(path + ".matrix", " takes vertices of the mesh as far as ", reach,
         " from the origin; keep within ", kFarthest, ".");
  if (o.materials.empty()) fail(path + ".materials", " is empty; name at least one material.");
  const auto& index = d.meshes[o.mesh].material_index;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] < 0 || index[i] >= static_cast<int>(o.materials.size()))
      fail(path + ".materials", " has ", o.materials.size(), " entries, but material_index[", i,
           "] of its mesh is ", index[i], ".");
}

}  // namespace

void check(const SceneDescription& d) {
  check_settings(d.settings);
  check_camera(d.camera);
  check_world(d.world);
  for (std::size_t i = 0; i < d.lights.size(); ++i)
    check_light(d.lights[i], EntryPath("lights", i, d.lights[i].name));
  for (std::size_t i = 0; i < d.materials.size(); ++i)
    check_material(d.materials[i], EntryPath("materials", d.materials[i].name));
  for (std::size_t i = 0; i < d.meshes.size(); ++i)
    check_mesh(d.meshes[i], EntryPath("meshes", d.meshes[i].name));
  std::vector<double> farthest_vertex;
  for (const MeshDescription& m : d.meshes) {
    double farthest = 0;
    for (const float v : m.vertices) farthest = std::max(farthest, std::abs(double{v}));
    farthest_vertex.push_back(farthest);
  }
  for (std::size_t i = 0; i < d.objects.size(); ++i)
    check_object(d, farthest_vertex, d.objects[i], EntryPath("objects", i, d.objects[i].name));
}

}  // namespace gpis
