#include "integrator/path_tracer.h"

#include "integrator/dielectric_scatter.h"
#include "integrator/reach.h"
#include "integrator/scatter.h"
#include "integrator/vertex.h"
#include "process/hit_gradient.h"
#include "process/realisation_memory.h"
#include "process/segment_memory.h"
#include "scene/scene_impl.h"

namespace gpis {
namespace {

// Ends a path that can neither escape nor fade (white walls all around): counted.
constexpr int kPathLengthLimit = 100'000;
// Russian roulette starts here; before, nearly every path still matters.
constexpr int kRouletteStart = 3;

// The decisions of one vertex that low-discrepancy points make, in their order.
constexpr int kGradientDecision = 0, kDirectionDecision = 1, kLightDecision = 2;
constexpr int kVertexDecisions = kLightDecision + LightSet::kMostGroups;

// What a path knows of each stochastic surface at the point it leaves; nothing: a fresh start
// outside of it.
using PathMemory = std::vector<std::optional<State>>;

}  // namespace

struct PathTracer::Impl {
  explicit Impl(const Scene& s)
      : scene(s.impl()),
        max_bounces(s.description().settings.max_bounces.value_or(kPathLengthLimit)),
        lines(scene.stochastic.size()),
        met(scene.stochastic.size()),
        starts(scene.stochastic.size()),
        memory(scene.stochastic.size()),
        shadow_memory(scene.stochastic.size()),
        realisations(scene.stochastic.size()),
        segments(scene.stochastic.size()),
        inside(scene.bodies.size()) {
    for (const auto& body : scene.bodies)
      if (body.surface.leaves().size() > shadow_lines.size())
        shadow_lines.resize(body.surface.leaves().size());
  }

  PathSample trace(const Ray& camera_ray, double t_max);
  TreeHit first_hit(const Scene::Impl::Body& body, bool from_inside, Line* body_lines,
                    const Ray& ray, double t_max, const PathMemory& remembered,
                    std::vector<RealisationMemory>& kept, Rng& random);
  bool closest(const Ray& ray, double t_max, Vertex& v);
  void leave_bounds(const Ray& ray, double t);
  void remember_others(const Vertex& v);
  void keep_segments(const Vertex& v);
  Vec3 draw(const GradientLaw& law) {
    if (!law.certain()) counters->line_normals += 2;
    return law.draw(*rng);
  }
  // The sample's point for a decision of the vertex in hand.
  SquarePoint point(int decision, Rng& source) const {
    return points->point(kPixelDecision + 1 + bounce * kVertexDecisions + decision, source);
  }
  bool visible(const Ray& ray, double distance, int crossed);
  template <class Scatter, class Remember>
  Color sample_lights(const Vertex& v, const Scatter& scatter, const Remember& remember);
  std::optional<ScatterSample> scatter_at(const Ray& ray, const Vertex& v, Color& direct,
                                          Vec3& normal);

  const Scene::Impl& scene;
  const int max_bounces;
  // The sample path of each stochastic surface along the ray; `met` tells which were drawn for it.
  std::vector<Line> lines;
  std::vector<char> met;
  std::vector<Line> shadow_lines;
  std::vector<Start> starts;
  TreeSurface::March march;
  PathMemory memory, shadow_memory;
  // That the path sees, of memory `global`; a shadow ray sees a copy.
  std::vector<RealisationMemory> realisations, shadow_realisations;
  // What it has met, of memory `segments`; shadow rays read it alone.
  std::vector<SegmentMemory> segments;
  // Of each stochastic body, whether the ray in hand travels inside of it. Every body is a medium
  // in air: where two overlap, each refracts as if the other were not there (no priorities). The
  // sides of meshes are told by the order of their corners.
  std::vector<char> inside;
  const BlockPoints* points = nullptr;
  int bounce = 0;
  Rng* rng = nullptr;
  // A stream of its own: light sampling never changes the path. Begun where a light is sampled.
  std::optional<Rng> light_rng;
  std::uint64_t light_seed = 0;
  Counters* counters = nullptr;
};

PathTracer::PathTracer(const Scene& scene, const std::atomic<bool>* stop)
    : impl_(std::make_unique<Impl>(scene)) {
  for (Line& line : impl_->lines) line.stop_when(stop);
  for (Line& line : impl_->shadow_lines) line.stop_when(stop);
}
PathTracer::~PathTracer() = default;

PathSample PathTracer::trace(const Ray& camera_ray, double t_max, const BlockPoints& points,
                             Rng& rng, Counters& counters) {
  impl_->points = &points;
  impl_->rng = &rng;
  impl_->light_seed = rng();
  impl_->light_rng.reset();
  impl_->counters = &counters;
  return impl_->trace(camera_ray, t_max);
}

PathSample PathTracer::Impl::trace(const Ray& camera_ray, double t_max) {
  ++counters->camera_paths;
  PathSample result;
  Ray ray = camera_ray;
  Color throughput{1, 1, 1};
  double scatter_pdf = kInfinity;
  for (std::size_t i = 0; i < memory.size(); ++i) {
    memory[i].reset();
    if (scene.stochastic[i].surface.memory() == Memory::global) realisations[i] = {(*rng)(), {}};
    segments[i].segments.clear();
  }
  std::fill(inside.begin(), inside.end(), 0);

  for (bounce = 0;; ++bounce) {
    Vertex v;
    const bool hit = closest(ray, bounce == 0 ? t_max : kInfinity, v);

    // Light that the ray meets on its way.
    result.radiance += throughput * (bounce == 0 ? scene.lights.met_by_camera(ray, v.t)
                                                 : scene.lights.met(ray, v.t, scatter_pdf));
    if (!hit || bounce > max_bounces) break;
    if (bounce == kPathLengthLimit) {
      ++counters->path_length_limit;
      break;
    }
    ++counters->path_vertices;

    // Scatter, and light the vertex from sampled lights.
    remember_others(v);
    keep_segments(v);
    Color direct;
    Vec3 normal;
    const std::optional<ScatterSample> next = scatter_at(ray, v, direct, normal);
    result.radiance += throughput * direct;
    if (bounce == 0) {
      result.depth = v.t;
      result.normal = normal;
      result.albedo = v.material->albedo() * v.tint;
    }
    if (!next) break;
    if (!is_finite(next->direction)) {
      // A gradient without direction: the film leaves the sample out and says so.
      result.radiance = {std::nan(""), std::nan(""), std::nan("")};
      break;
    }
    throughput = throughput * next->weight;

    // Russian roulette, only on what has been lost: a lossless path is never ended.
    const double brightest = max_component(throughput);
    if (!(brightest > 0)) break;
    if (bounce >= kRouletteStart && brightest < 1) {
      if (rng->uniform() >= brightest) break;
      throughput *= 1 / brightest;
    }
    // The segment that ends here ends in what is known of every process here.
    for (std::size_t i = 0; i < memory.size(); ++i)
      if (memory[i] && met[i] && scene.stochastic[i].surface.memory() == Memory::segments)
        scene.stochastic[i].surface.keep_end(v.position, *memory[i], segments[i]);
    ray = {v.start(next->transmitted), next->direction};
    if (next->transmitted && v.body >= 0) inside[v.body] = !inside[v.body];
    scatter_pdf = next->pdf;
  }
  return result;
}

TreeHit PathTracer::Impl::first_hit(const Scene::Impl::Body& body, bool from_inside,
                                    Line* body_lines, const Ray& ray, double t_max,
                                    const PathMemory& remembered,
                                    std::vector<RealisationMemory>& kept, Rng& random) {
  const std::size_t count = body.surface.leaves().size();
  if (from_inside) ++counters->inside_rays;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = body.first + k;
    const State* state = remembered[i] ? &*remembered[i] : nullptr;
    starts[k] = body.surface.leaves()[k].start_from(state, from_inside, &kept[i], &segments[i]);
  }
  return body.surface.first_hit(march, {body_lines, count}, ray, t_max, {starts.data(), count},
                                random, *counters);
}

// The first surface along the ray: meshes bound the march through each process; the first of the
// first hits wins (union of independent processes, definitions B5).
bool PathTracer::Impl::closest(const Ray& ray, double t_max, Vertex& v) {
  MeshHit mesh;
  const auto [start, end] = within_reach(ray, t_max);
  if (start > 0 || end < 0) return false;
  double nearest = end;
  const bool hit_mesh =
      scene.triangles && scene.triangles->intersect(ray, nearest, mesh, *counters);
  if (hit_mesh) nearest = mesh.t;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Scene::Impl::Body& body = scene.bodies[b];
    const auto [enter, leave] = clip(body.surface.bounds(), ray.origin, ray.direction, 0, nearest);
    for (std::size_t k = 0; k < body.surface.leaves().size(); ++k)
      met[body.first + k] = enter <= leave;
    if (enter > leave) continue;
    const TreeHit hit =
        first_hit(body, inside[b], &lines[body.first], ray, nearest, memory, realisations, *rng);
    if (!(hit.t < nearest)) continue;
    nearest = hit.t;
    v.surface = static_cast<int>(body.first) + hit.leaf;
    v.body = static_cast<int>(b);
  }
  if (scene.transparent) leave_bounds(ray, nearest);
  if (v.surface >= 0) {
    v.t = nearest;
    v.position = v.departure = v.beyond = ray.at(nearest);
    v.inside = inside[v.body];
    v.material = scene.stochastic[v.surface].material;
    if (v.inside) v.material = &v.material->from_inside();
    if (const auto& albedo = scene.stochastic[v.surface].albedo) {
      ++counters->albedo_lookups;
      v.tint = albedo->value(scene.stochastic[v.surface].to_object.point(v.position));
    }
    return true;
  }
  if (!hit_mesh) return false;
  const double side = dot(mesh.geometric_normal, ray.direction) < 0 ? 1 : -1;
  v.t = mesh.t;
  v.position = mesh.position;
  v.geometric_normal = mesh.geometric_normal * side;
  v.shading_normal = mesh.shading_normal * side;
  v.departure = mesh.position + v.geometric_normal * mesh.offset;
  v.beyond = mesh.position - v.geometric_normal * mesh.offset;
  v.material = scene.instance_materials[mesh.instance][mesh.material_index];
  if (side < 0) v.material = &v.material->from_inside();
  return true;
}

// The ray is inside no more of bodies whose bounds it leaves before t: where there is no surface,
// no index changes (definitions B4).
void PathTracer::Impl::leave_bounds(const Ray& ray, double t) {
  for (std::size_t b = 0; b < inside.size(); ++b) {
    if (!inside[b]) continue;
    const auto [enter, leave] =
        clip(scene.bodies[b].surface.bounds(), ray.origin, ray.direction, 0, t);
    if (enter <= leave && leave >= t) continue;
    inside[b] = false;
    ++counters->bounds_exits;
  }
}

// Keeps the state of every leaf that was sampled at the vertex, save the one that was hit
// (definitions B1); all else is forgotten.
void PathTracer::Impl::remember_others(const Vertex& v) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Scene::Impl::Body& body = scene.bodies[b];
    const ProcessTree& tree = body.surface.tree();
    bool hit = false;
    for (std::size_t k = 0; k < tree.leaves().size(); ++k) {
      const std::size_t i = body.first + k;
      memory[i].reset();
      const ProcessSurface& surface = scene.stochastic[i].surface;
      if (static_cast<int>(i) == v.surface) hit = true;
      if (!met[i] || static_cast<int>(i) == v.surface || surface.memory() == Memory::none) continue;
      if (surface.sampled_at(lines[i], v.t))
        memory[i] = surface.state(surface.value(lines[i], v.t, *rng), {});
    }
    const int sign = tree.sign(tree.root(), [&](int k) {
      const std::optional<State>& state = memory[body.first + k];
      return !state ? 0 : state->value * tree.leaves()[k].sign > 0 ? 1 : -1;
    });
    const bool wrong = !hit && (inside[b] ? sign > 0 : sign < 0);
    if (wrong) ++counters->states_inside;
    for (std::size_t k = 0; k < tree.leaves().size(); ++k) {
      const std::size_t i = body.first + k;
      if (wrong) memory[i].reset();
      counters->states_remembered += memory[i].has_value();
      const ProcessSurface& surface = scene.stochastic[i].surface;
      if (memory[i] && surface.memory() != Memory::renewal)
        memory[i] =
            surface.state(memory[i]->value, draw(surface.gradient_law(lines[i], v.t, *rng)));
    }
  }
}

// What was drawn of every process on the way, memory `segments`.
void PathTracer::Impl::keep_segments(const Vertex& v) {
  for (std::size_t i = 0; i < memory.size(); ++i) {
    const ProcessSurface& surface = scene.stochastic[i].surface;
    if (met[i] && surface.memory() == Memory::segments)
      surface.keep_segment(lines[i], v.t, segments[i]);
  }
}

// 0 or 1, a fresh sample of every process under shadow_memory. `crossed`: the body that the ray
// starts through the surface of, or -1.
bool PathTracer::Impl::visible(const Ray& ray, double distance, int crossed) {
  ++counters->shadow_rays;
  if (scene.triangles && scene.triangles->occluded(ray, distance, *counters)) return false;
  shadow_realisations = realisations;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Scene::Impl::Body& body = scene.bodies[b];
    const auto [enter, leave] = clip(body.surface.bounds(), ray.origin, ray.direction, 0, distance);
    if (enter > leave) continue;
    const bool from_inside = inside[b] != (static_cast<int>(b) == crossed);
    if (first_hit(body, from_inside, shadow_lines.data(), ray, distance, shadow_memory,
                  shadow_realisations, *light_rng)
            .t < distance)
      return false;
  }
  return true;
}

// Next-event estimation. `remember(direction, memory)` puts the state of the surface that was hit
// into the copy of the memory that the shadow ray starts with.
template <class Scatter, class Remember>
Color PathTracer::Impl::sample_lights(const Vertex& v, const Scatter& scatter,
                                      const Remember& remember) {
  Color sum;
  if (!light_rng) light_rng.emplace(light_seed, 0);
  for (int group = 0; group < scene.lights.groups(); ++group) {
    const SquarePoint at = point(kLightDecision + group, *light_rng);
    const std::optional<LightSample> light = scene.lights.sample(group, v.departure, at);
    if (!light) continue;
    const Color f = scatter.eval(light->direction);
    if (!(max_component(f) > 0)) continue;
    shadow_memory = memory;
    remember(light->direction, shadow_memory);
    const bool transmitted = scatter.transmitted(light->direction);
    if (!visible({v.start(transmitted), light->direction}, light->distance,
                 transmitted ? v.body : -1))
      continue;
    const double weight =
        light->delta() ? 1 : balance(light->pdf, scatter.pdf(light->direction)) / light->pdf;
    sum += f * light->radiance * weight;
  }
  return sum;
}

// Light from sampled lights, and the direction in which the path goes on (nothing: absorbed). On a
// stochastic surface this draws its gradient and remembers it.
std::optional<ScatterSample> PathTracer::Impl::scatter_at(const Ray& ray, const Vertex& v,
                                                          Color& direct, Vec3& normal) {
  if (v.surface < 0) {
    const SurfaceScatter scatter(*v.material, ray.direction, v.geometric_normal, v.shading_normal,
                                 v.tint);
    normal = v.shading_normal;
    if (!scatter.specular()) direct = sample_lights(v, scatter, [](const Vec3&, PathMemory&) {});
    return scatter.sample(point(kDirectionDecision, *rng));
  }
  const Scene::Impl::Body& body = scene.bodies[v.body];
  const auto here = [&](auto& of) { return std::span(of).subspan(body.first); };
  const TreeHit hit{v.t, v.surface - static_cast<int>(body.first)};
  const HitGradient found(body.surface, here(lines), hit, here(memory), *rng, *counters);
  const GradientLaw& law = found.law();
  Vec3 gradient = law.mean;
  if (!law.certain()) {
    const auto [xi1, xi2] = square_to_normals(point(kGradientDecision, *rng));
    gradient += law.b1 * xi1 + law.b2 * xi2;
    counters->line_normals += 2;
  }
  found.remember(gradient, here(memory));
  ++counters->states_remembered;
  normal = normalize(gradient) * (v.inside ? -1 : 1);
  if (v.material->specular() && !law.degenerate) {  // normals have a density to light them by
    const auto lit = [&](const auto& way) {
      return sample_lights(v, way, [&](const Vec3& w, PathMemory& m) {
        found.remember(*way.gradient_for(w), here(m));
      });
    };
    if (v.material->relative_index() == 0) {
      const MirrorScatter scatter(*v.material, ray.direction, law, v.tint);
      direct = lit(scatter);
      return scatter.sample(gradient);
    }
    if (DielectricScatter::serves(*v.material)) {
      const DielectricScatter scatter(*v.material, ray.direction, law, v.tint);
      direct = lit(scatter.reflection()) + lit(scatter.refraction());
      return scatter.sample(gradient, point(kDirectionDecision, *rng).u);
    }
  }
  const SurfaceScatter scatter(*v.material, ray.direction, normal, normal, v.tint);
  if (!scatter.specular()) direct = sample_lights(v, scatter, [](const Vec3&, PathMemory&) {});
  return scatter.sample(point(kDirectionDecision, *rng));
}

}  // namespace gpis
