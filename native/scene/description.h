// The scene description: plain structs, filled by the binding from the dict of api.md (or by a
// native test), turned into a planned Scene (scene/scene.h). World units are metres, colours linear
// RGB, matrices map to world.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "field/color_field.h"
#include "process/tree.h"

namespace gpis {

// Coordinates of a scene end here: those of single precision, which Embree takes, end at 1.8e18,
// and a ray from beyond would end the program.
inline constexpr double kFarthest = 1e15;

struct SettingsDescription {
  std::optional<int> max_bounces;  // indirect bounces: 0 = direct light only; none = unlimited
  double missed_root = 1e-3;       // probability of a missed root per ray
  enum class Filter { box, blackman_harris } filter = Filter::box;
  double filter_width = 1;
  double clamp = 0;            // 0 = off
  bool light_sampling = true;  // next-event estimation; an even world is never sampled
};

struct CameraDescription {
  enum class Type { perspective, orthographic, equirectangular } type = Type::perspective;
  Affine matrix;  // camera to world; looks along -z, y up
  double fov_x = 0.8;
  double width = 1;                 // orthographic: metres across the frame
  double shift_x = 0, shift_y = 0;  // in units of the frame's larger side, as in Blender
  double clip_near = 0, clip_far = kInfinity;
};

struct WorldDescription {
  Color color;  // used where there is no image
  int image_width = 0, image_height = 0;
  // (H, W, 3), row 0 at the bottom; empty = constant colour. Equirectangular as in Blender: the
  // direction (x, y, z) of image space is at u = 1/2 - atan2(y, x)/2pi, v = 1/2 + atan2(z, hypot(x,
  // y))/pi; the middle of the image is +x, the top +z.
  std::vector<float> image;
  Mat3 matrix;  // image space -> world, a rotation (a reflection is allowed)
  double strength = 1;

  bool black() const { return strength == 0 || (image.empty() && max_component(color) == 0); }
};

struct LightDescription {
  enum class Type { point, spot, sun, area } type = Type::point;
  std::string name;
  Affine matrix;  // shines along -z
  Color color{1, 1, 1};
  double power = 1;  // W in all directions; sun: irradiance on a plane that faces it, W/m²
  std::optional<Color> radiance;  // area: instead of power
  double size_x = 1, size_y = 1;
  bool ellipse = false;
  double radius =
      0;  // point, spot: of a sphere of constant radiance (Blender: soft falloff off); 0 = a point
  double angle = 0;  // sun: full angle of its disk; spot: full cone angle
  double blend = 0;  // spot: soft edge, 0..1
  bool visible_to_camera =
      false;  // as Blender's default for lights; reflections show lights in any case
};

struct MaterialDescription {
  enum class Type { lambert, mirror, conductor, principled, dielectric } type = Type::lambert;
  std::string name;
  Color color{0.8, 0.8, 0.8};
  double roughness = 0;  // Beckmann/GGX alpha = roughness² as in Blender
  double metallic = 0;
  double ior = 1.5;           // dielectric: index of refraction, that of the surroundings is 1
  Color reflection{1, 1, 1};  // dielectric: tint of what is reflected; color is of what passes
};

struct MeshDescription {
  std::string name;
  std::vector<float> vertices;           // (N, 3)
  std::vector<std::uint32_t> triangles;  // (M, 3)
  std::vector<float> normals;            // (N, 3) per vertex, (M, 3, 3) per corner, or empty = flat
  bool normals_per_corner = false;
  std::vector<std::int32_t> material_index;  // (M) or empty = 0
};

struct ObjectDescription {
  enum class Type { mesh, gpis } type = Type::mesh;
  std::string name;
  int mesh = -1;  // index into meshes
  Affine matrix;
  std::vector<int> materials;  // indices into materials
  TreePtr process;
  Memory memory = Memory::renewal_plus;
  Sampler sampler = Sampler::automatic;
  ColorFieldPtr albedo;  // gpis: multiplies the colours of its materials; object space
};

struct SceneDescription {
  SettingsDescription settings;
  CameraDescription camera;
  WorldDescription world;
  std::vector<LightDescription> lights;
  std::vector<MaterialDescription> materials;
  std::vector<MeshDescription> meshes;
  std::vector<ObjectDescription> objects;
};

}  // namespace gpis
