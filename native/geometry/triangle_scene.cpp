#include "geometry/triangle_scene.h"

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "geometry/embree_api.h"

namespace gpis {
namespace {

struct DeviceDeleter {
  void operator()(RTCDevice d) const { embree().rtcReleaseDevice(d); }
};
struct SceneDeleter {
  void operator()(RTCScene s) const { embree().rtcReleaseScene(s); }
};
using Device = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceDeleter>;
using EmbreeScene = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneDeleter>;

struct Instance {
  int mesh;
  Affine to_world;
  Mat3 normal_to_world;  // inverse transpose
  double scale;          // largest stretch of a coordinate (maximum row sum)
};

Vec3 vertex(const TriangleMesh& mesh, std::uint32_t i) {
  return {mesh.vertices[3 * i], mesh.vertices[3 * i + 1], mesh.vertices[3 * i + 2]};
}

double largest(const Vec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

RTCRay to_embree(const Ray& ray, double t_max) {
  RTCRay r{};
  r.org_x = static_cast<float>(ray.origin.x);
  r.org_y = static_cast<float>(ray.origin.y);
  r.org_z = static_cast<float>(ray.origin.z);
  r.dir_x = static_cast<float>(ray.direction.x);
  r.dir_y = static_cast<float>(ray.direction.y);
  r.dir_z = static_cast<float>(ray.direction.z);
  r.tnear = 0;
  r.tfar = static_cast<float>(t_max);
  r.mask = ~0u;
  return r;
}

}  // namespace

struct TriangleScene::Impl {
  Device device{embree().rtcNewDevice(nullptr)};
  Box3 reach;  // of all triangles, and a little more: Embree's own test is in single precision
  EmbreeScene top;
  std::vector<EmbreeScene> shared;  // of meshes that have several instances
  std::vector<TriangleMesh> meshes;
  std::vector<Instance> instances;

  void check(const char* what) const {
    const RTCError error = embree().rtcGetDeviceError(device.get());
    if (error == RTC_ERROR_NONE) return;
    throw std::runtime_error(std::string("Embree could not ") + what + " (error " +
                             std::to_string(static_cast<int>(error)) +
                             (error == RTC_ERROR_OUT_OF_MEMORY ? ", out of memory)." : ")."));
  }

  EmbreeScene new_scene() const {
    EmbreeScene scene(embree().rtcNewScene(device.get()));
    // Robust: rays do not slip through between the triangles of a closed mesh.
    embree().rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
    return scene;
  }

  void attach(RTCScene scene, RTCGeometry geometry, unsigned id) const {
    embree().rtcCommitGeometry(geometry);
    embree().rtcAttachGeometryByID(scene, geometry, id);
    embree().rtcReleaseGeometry(geometry);
    check("take a mesh");
  }

  // The triangles of a mesh under a transform, baked.
  void attach_triangles(RTCScene scene, const TriangleMesh& mesh, const Affine& transform,
                        unsigned id) const {
    RTCGeometry geometry = embree().rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t vertices = mesh.vertices.size() / 3;
    auto* position = static_cast<float*>(embree().rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices));
    auto* index = static_cast<std::uint32_t*>(
        embree().rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                         3 * sizeof(std::uint32_t), mesh.triangles.size() / 3));
    check("allocate a mesh");
    for (std::size_t i = 0; i < vertices; ++i) {
      const Vec3 p = transform.point(vertex(mesh, static_cast<std::uint32_t>(i)));
      for (int k = 0; k < 3; ++k) position[3 * i + k] = static_cast<float>(p[k]);
    }
    std::copy(mesh.triangles.begin(), mesh.triangles.end(), index);
    attach(scene, geometry, id);
  }

  void attach_instance(RTCScene scene, RTCScene of, const Affine& transform, unsigned id) const {
    RTCGeometry geometry = embree().rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    embree().rtcSetGeometryInstancedScene(geometry, of);
    float matrix[12];
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 3; ++row)
        matrix[3 * column + row] = static_cast<float>(column < 3 ? transform.linear.row[row][column]
                                                                 : transform.translation[row]);
    embree().rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix);
    attach(scene, geometry, id);
  }
};

TriangleScene::TriangleScene() : impl_(std::make_unique<Impl>()) {
  impl_->check("make a device");
}
TriangleScene::~TriangleScene() = default;

void TriangleScene::add_mesh(const TriangleMesh& mesh) {
  impl_->meshes.push_back(mesh);
}

void TriangleScene::add_instance(int mesh, const Affine& to_world) {
  const Mat3& m = to_world.linear;
  double scale = 0;
  for (const Vec3& row : m.row)
    scale = std::max(scale, std::abs(row.x) + std::abs(row.y) + std::abs(row.z));
  impl_->instances.push_back({mesh, to_world, transpose(inverse(m)), scale});
}

void TriangleScene::commit() {
  Impl& impl = *impl_;
  std::vector<int> uses(impl.meshes.size());
  for (const Instance& instance : impl.instances) ++uses[instance.mesh];
  impl.shared.resize(impl.meshes.size());
  for (std::size_t i = 0; i < impl.meshes.size(); ++i) {
    if (uses[i] < 2) continue;
    impl.shared[i] = impl.new_scene();
    impl.attach_triangles(impl.shared[i].get(), impl.meshes[i], {}, 0);
    embree().rtcCommitScene(impl.shared[i].get());
  }
  impl.top = impl.new_scene();
  for (std::size_t i = 0; i < impl.instances.size(); ++i) {
    const Instance& instance = impl.instances[i];
    const auto id = static_cast<unsigned>(i);
    if (impl.shared[instance.mesh]) {
      impl.attach_instance(impl.top.get(), impl.shared[instance.mesh].get(), instance.to_world, id);
    } else {
      impl.attach_triangles(impl.top.get(), impl.meshes[instance.mesh], instance.to_world, id);
    }
  }
  embree().rtcCommitScene(impl.top.get());
  impl.check("build the hierarchy of the meshes");
  const Box3 box = bounds();
  const double more = 1e-5 * std::max(largest(box.min), largest(box.max));
  impl.reach = {box.min - Vec3{more, more, more}, box.max + Vec3{more, more, more}};
}

Box3 TriangleScene::bounds() const {
  RTCBounds b{};
  embree().rtcGetSceneBounds(impl_->top.get(), &b);
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

bool TriangleScene::reached(const Ray& ray, double t_max) const {
  const auto [begin, end] = clip(impl_->reach, ray.origin, ray.direction, 0, t_max);
  return begin <= end;
}

bool TriangleScene::intersect(const Ray& ray, double t_max, MeshHit& hit,
                              Counters& counters) const {
  if (!reached(ray, t_max)) return false;
  ++counters.mesh_rays;
  RTCRayHit r{};
  r.ray = to_embree(ray, t_max);
  r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree().intersect1(impl_->top.get(), &r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;

  hit.instance =
      static_cast<int>(r.hit.instID[0] == RTC_INVALID_GEOMETRY_ID ? r.hit.geomID : r.hit.instID[0]);
  const Instance& instance = impl_->instances[hit.instance];
  const TriangleMesh& mesh = impl_->meshes[instance.mesh];
  const std::uint32_t* corner = &mesh.triangles[3 * std::size_t{r.hit.primID}];
  const double u = r.hit.u, v = r.hit.v, w = 1 - u - v;
  const Vec3 a = vertex(mesh, corner[0]), b = vertex(mesh, corner[1]), c = vertex(mesh, corner[2]);
  const Vec3 local = a * w + b * u + c * v;

  hit.t = r.ray.tfar;
  hit.position = instance.to_world.point(local);
  const Vec3 across = instance.normal_to_world * cross(b - a, c - a);
  // A sliver may be hit in single precision after its transform and have no area here.
  hit.geometric_normal = length(across) > 0 ? normalize(across) : -ray.direction;
  hit.shading_normal = hit.geometric_normal;
  if (!mesh.normals.empty()) {
    Vec3 n;
    for (int k = 0; k < 3; ++k) {
      const std::size_t i = mesh.normals_per_corner ? 3 * std::size_t{r.hit.primID} + k : corner[k];
      n += Vec3{mesh.normals[3 * i], mesh.normals[3 * i + 1], mesh.normals[3 * i + 2]} * (k == 0 ? w
                                                                                          : k == 1
                                                                                              ? u
                                                                                              : v);
    }
    n = instance.normal_to_world * n;
    const double size = length(n);
    // Normals that cancel say nothing: the flat one stays.
    if (size > 0) {
      n = n / size;
      hit.shading_normal = dot(n, hit.geometric_normal) < 0 ? -n : n;
    }
  }
  hit.material_index = mesh.material_index.empty() ? 0 : mesh.material_index[r.hit.primID];
  // Rounding in single precision grows with the coordinates that entered the computation, in world
  // and in object space (the argument and the factor of Wächter & Binder 2019, "A fast and robust
  // method for avoiding self-intersection": 256 ulp).
  const double magnitude =
      std::max({largest(hit.position), largest(instance.to_world.translation),
                instance.scale * std::max({largest(a), largest(b), largest(c)})});
  hit.offset = 256 * 0x1p-24 * magnitude;
  return true;
}

bool TriangleScene::occluded(const Ray& ray, double t_max, Counters& counters) const {
  if (!reached(ray, t_max)) return false;
  ++counters.mesh_rays;
  RTCRay r = to_embree(ray, t_max);
  embree().occluded1(impl_->top.get(), &r);
  return r.tfar < 0;
}

}  // namespace gpis
