#include <pybind11/numpy.h>

#include "binding/bindings.h"
#include "binding/description_reader.h"
#include "binding/reader.h"
#include "scene/camera.h"
#include "scene/scene.h"

namespace gpis {

namespace {

const char* const kSceneDoc =
    R"(A scene, planned for rendering: immutable, used by any number of renders at once.

Scene(description) takes a plain dict; numbers may be nested lists or numpy arrays. World units are metres, colours linear RGB
in (3,), matrices (4, 4) map to world. Keys with a default may be left out; any other key is refused.

version: 1
settings (all optional): max_bounces None (unlimited) | int; missed_root 1e-3, probability of a missed first hit per ray;
    filter {"type": "box" | "blackman_harris", "width": 1.0} (pixels, whole width); clamp 0 (off) | the brightest radiance a
    sample may have (biased); light_sampling True (False: light is found by scattering only)
camera: type "perspective" | "orthographic" | "equirectangular"; matrix, camera to world, looks along -z with y up, its scale is
    ignored; fov_x (perspective), the horizontal angle in radians; width (orthographic), metres from left to right;
    shift (0, 0), in units of the image's larger side; clip (0, inf), distances along the viewing axis
world: color (0, 0, 0) | image (H, W, 3) equirectangular, row 0 at the bottom, with matrix (3, 3) from image to world;
    strength 1
lights: a list of dicts: type "point" | "spot" | "sun" | "area"; name; matrix (shines along -z); color (1, 1, 1);
    power in W, of a sun its irradiance in W/m² | radiance (3,) of an area light; radius 0 (point, spot);
    angle, of a sun's disk (0) or of a spot's whole cone, in radians; blend 0 (spot); size (2,), shape "rectangle" | "ellipse" (area);
    visible_to_camera False (reflections show lights in any case)
materials: {name: dict}: type "lambert" | "mirror" | "conductor" | "principled" | "dielectric"; color (.8, .8, .8), at most 1;
    roughness .5 (conductor, principled); metallic 0 (principled). A dielectric has ior 1.5, its index of refraction in air;
    roughness 0; color (1, 1, 1), which tints what passes, and reflection (1, 1, 1), which tints what is reflected. The inside of a
    mesh is where its corners run clockwise; bodies that overlap refract as if the others were not there
meshes: {name: dict}: vertices (N, 3); triangles (M, 3) integers; normals (N, 3) per vertex or (M, 3, 3) per corner, none: flat;
    material_index (M,), places in the object's list of materials
objects: a list of dicts: type "mesh" with mesh, its name | "gpis" with process, a GaussianProcess or a CSG tree, memory "renewal+" |
    "renewal" | "none" | "global-1" … "global-64" | "global", sampler "auto" | "convolution" | "markov" |
    "spectral" | "nystrom" | "dense" | "realisation" | "first_passage"; name; matrix (identity);
    materials, names: for a gpis object one, or one for each operand of its tree

Raises ValueError with the path of the value (objects[2].materials), what it holds and what it takes; FileNotFoundError where a
file that the scene needs is missing.)";

py::dict plan_dict(const Scene& scene) {
  py::dict plan;
  for (const auto& [path, sentence] : scene.plan()) {
    const py::str key(path);
    plan[key] = plan.contains(key) ? py::str(py::cast<std::string>(plan[key]) + "; " + sentence)
                                   : py::str(sentence);
  }
  return plan;
}

py::tuple camera_rays(const Scene& scene, int width, int height, const py::object& points) {
  if (width < 1 || height < 1)
    refuse("camera_rays", "takes a positive width and height, got " + std::to_string(width) +
                              " x " + std::to_string(height));
  const DoubleArray xy = to_numbers(points, "points", {-1, 2});
  const Camera camera(scene.description().camera, width, height);
  const py::ssize_t n = xy.shape(0);
  py::array_t<double> origins({n, py::ssize_t{3}}), directions({n, py::ssize_t{3}}), t_max(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    const CameraRay ray = camera.ray(xy.at(i, 0), xy.at(i, 1));
    for (int c = 0; c < 3; ++c) {
      origins.mutable_at(i, c) = ray.ray.origin[c];
      directions.mutable_at(i, c) = ray.ray.direction[c];
    }
    t_max.mutable_at(i) = ray.t_max;
  }
  return py::make_tuple(origins, directions, t_max);
}

}  // namespace

void bind_scene(py::module_& m) {
  py::class_<Scene, std::shared_ptr<Scene>>(m, "Scene", kSceneDoc)
      .def(py::init([](const py::object& description) {
             SceneDescription read = read_description(description);
             py::gil_scoped_release
                 release;  // building acceleration structures takes time and no Python
             return std::make_shared<Scene>(std::move(read));
           }),
           py::arg("description"))
      .def("plan", &plan_dict,
           "What was chosen for this scene and what is left out, as a dict from path (objects[0] "
           "…) to a sentence.")
      .def("camera_rays", &camera_rays, py::arg("width"), py::arg("height"), py::arg("points"),
           "The camera's rays for an image of width x height pixels through points (N, 2), in "
           "pixels from the image's lower left\n"
           "corner. Returns origins (N, 3), on the near clip distance, unit directions (N, 3), and "
           "the distance (N,) to the far one.");
}

}  // namespace gpis
