#include "integrator/path_tracer.h"

#include "integrator/dielectric_scatter.h"
#include "integrator/path_memory.h"
#include "integrator/reach.h"
#include "integrator/scatter.h"
#include "integrator/vertex.h"
#include "process/hit_gradient.h"
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

// One a leaf of a body.
using States = std::span<std::optional<State>>;

}  // namespace

struct PathTracer::Impl {
  Impl(const Scene& s, const std::atomic<bool>* stop_when)
      : scene(s.impl()),
        stop(stop_when),
        max_bounces(s.description().settings.max_bounces.value_or(kPathLengthLimit)),
        path(scene),
        lines(scene.stochastic.size()) {
    std::size_t most = 0;
    for (const auto& body : scene.bodies) most = std::max(most, body.surface.leaves().size());
    starts.resize(most);
    shadow_lines.resize(most);
    for (Line& line : lines) line.stop_when(stop);
    for (Line& line : shadow_lines) line.stop_when(stop);
  }

  PathSample trace(const Ray& camera_ray, double t_max);
  TreeHit first_hit(int b, bool from_inside, std::span<Line> drawn, const Ray& ray, double t_max,
                    States remembered, std::span<RealisationMemory> kept, Rng& random);
  // That hold the sample paths of a body along the ray in hand, which has entered it.
  std::span<Line> lines_of(int b) {
    return std::span(lines).subspan(scene.bodies[b].first, scene.bodies[b].surface.leaves().size());
  }
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
  bool visible(const Ray& ray, double distance, const Vertex& v, bool transmitted);
  template <class Scatter, class Remember>
  Color sample_lights(const Vertex& v, const Scatter& scatter, const Remember& remember);
  std::optional<ScatterSample> scatter_at(const Ray& ray, const Vertex& v, Color& direct,
                                          Vec3& normal);

  const Scene::Impl& scene;
  const std::atomic<bool>* const stop;
  const int max_bounces;
  PathMemory path;
  // The sample paths along the ray in hand, one a leaf of the scene: a line keeps what it has drawn
  // of whole realisations, and would keep it of every body that it serves.
  std::vector<Line> lines;
  std::vector<Line> shadow_lines;
  std::vector<Start> starts;
  TreeSurface::March march;
  std::vector<BoxTree::Entry> queue;
  // Bodies that the ray in hand, being inside, has left by bounds, and where.
  std::vector<std::pair<int, double>> left;
  // Of the body that was hit, for shadow rays that leave it, and of whatever body they meet.
  std::vector<std::optional<State>> shadow_states;
  std::vector<RealisationMemory> shadow_realisations;
  const BlockPoints* points = nullptr;
  int bounce = 0;
  Rng* rng = nullptr;
  // A stream of its own: light sampling never changes the path. Begun where a light is sampled.
  std::optional<Rng> light_rng;
  std::uint64_t light_seed = 0;
  Counters* counters = nullptr;
};

PathTracer::PathTracer(const Scene& scene, const std::atomic<bool>* stop)
    : impl_(std::make_unique<Impl>(scene, stop)) {}
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
  path.begin_path(*rng);

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
    for (const int b : path.entered()) {
      const TreeSurface& surface = scene.bodies[b].surface;
      if (surface.memory() != Memory::segments) continue;
      for (std::size_t k = 0; k < surface.leaves().size(); ++k)
        if (const std::optional<State>& state = path.states(b)[k])
          surface.leaves()[k].keep_end(v.position, *state, path.segments(b)[k]);
    }
    ray = {v.start(next->transmitted), next->direction};
    if (next->transmitted && v.body >= 0) path.cross(v.body);
    scatter_pdf = next->pdf;
  }
  return result;
}

TreeHit PathTracer::Impl::first_hit(int b, bool from_inside, std::span<Line> drawn, const Ray& ray,
                                    double t_max, States remembered,
                                    std::span<RealisationMemory> kept, Rng& random) {
  const TreeSurface& surface = scene.bodies[b].surface;
  const std::size_t count = surface.leaves().size();
  if (from_inside) ++counters->inside_rays;
  for (std::size_t k = 0; k < count; ++k) {
    const State* state = remembered[k] ? &*remembered[k] : nullptr;
    starts[k] = surface.leaves()[k].start_from(state, from_inside, &kept[k], &path.segments(b)[k]);
  }
  return surface.first_hit(march, drawn, ray, t_max, {starts.data(), count}, random, *counters);
}

// The first surface along the ray: meshes bound the march through each process; the first of the
// first hits wins (union of independent processes, definitions B5). The nearest body comes first,
// so that those behind a hit are not entered.
bool PathTracer::Impl::closest(const Ray& ray, double t_max, Vertex& v) {
  MeshHit mesh;
  const auto [start, end] = within_reach(ray, t_max);
  if (start > 0 || end < 0) return false;
  double nearest = end;
  const bool hit_mesh =
      scene.triangles && scene.triangles->intersect(ray, nearest, mesh, *counters);
  if (hit_mesh) nearest = mesh.t;
  path.begin_ray();
  left.clear();
  scene.body_boxes.visit(ray, nearest, queue, [&](int b) {
    path.enter(b);
    const TreeHit hit = first_hit(b, path.inside(b), lines_of(b), ray, nearest, path.states(b),
                                  path.realisations(b), *rng);
    if (hit.left < kInfinity) left.push_back({b, hit.left});
    if (hit.t < nearest) {
      nearest = hit.t;
      v.surface = static_cast<int>(scene.bodies[b].first) + hit.leaf;
      v.body = b;
    }
    return nearest;
  });
  if (scene.transparent) leave_bounds(ray, nearest);
  if (v.surface >= 0) {
    v.t = nearest;
    v.position = v.departure = v.beyond = ray.at(nearest);
    v.inside = path.inside(v.body);
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
  for (const auto& [b, at] : left) {
    if (!(at < t)) continue;
    path.cross(b);
    ++counters->bounds_exits;
  }
  for (const int b : path.begun()) {
    if (!path.inside(b) || !scene.bodies[b].surface.leaves_bounds(ray, t)) continue;
    path.cross(b);
    ++counters->bounds_exits;
  }
}

// Keeps the state of every leaf that was sampled at the vertex, save the one that was hit
// (definitions B1); all else is forgotten.
void PathTracer::Impl::remember_others(const Vertex& v) {
  path.forget();
  for (const int b : path.entered()) {
    const TreeSurface& body = scene.bodies[b].surface;
    const ProcessTree& tree = body.tree();
    const std::span<Line> drawn = lines_of(b);
    const States states = path.states(b);
    const int hit = v.body == b ? v.surface - static_cast<int>(scene.bodies[b].first) : -1;
    for (std::size_t k = 0; k < states.size(); ++k) {
      states[k].reset();
      const ProcessSurface& surface = body.leaves()[k];
      if (static_cast<int>(k) == hit || surface.memory() == Memory::none) continue;
      if (surface.sampled_at(drawn[k], v.t))
        states[k] = surface.state(surface.value(drawn[k], v.t, *rng), {});
    }
    const int sign = tree.sign(tree.root(), [&](int k) {
      return !states[k] ? 0 : states[k]->value * tree.leaves()[k].sign > 0 ? 1 : -1;
    });
    const bool wrong = hit < 0 && (path.inside(b) ? sign > 0 : sign < 0);
    if (wrong) ++counters->states_inside;
    for (std::size_t k = 0; k < states.size(); ++k) {
      if (wrong) states[k].reset();
      counters->states_remembered += states[k].has_value();
      const ProcessSurface& surface = body.leaves()[k];
      if (states[k] && surface.memory() != Memory::renewal)
        states[k] =
            surface.state(states[k]->value, draw(surface.gradient_law(drawn[k], v.t, *rng)));
    }
  }
}

// What was drawn of every process on the way, memory `segments`.
void PathTracer::Impl::keep_segments(const Vertex& v) {
  for (const int b : path.entered()) {
    const TreeSurface& body = scene.bodies[b].surface;
    if (body.memory() != Memory::segments) continue;
    for (std::size_t k = 0; k < body.leaves().size(); ++k)
      body.leaves()[k].keep_segment(lines_of(b)[k], v.t, path.segments(b)[k]);
  }
}

// 0 or 1, a fresh sample of every process under what is remembered, of the body that was hit under
// shadow_states. `transmitted`: the ray starts through the surface of that body.
bool PathTracer::Impl::visible(const Ray& ray, double distance, const Vertex& v, bool transmitted) {
  ++counters->shadow_rays;
  if (scene.triangles && scene.triangles->occluded(ray, distance, *counters)) return false;
  bool free = true;
  scene.body_boxes.visit(ray, distance, queue, [&](int b) {
    path.meet(b);
    const auto seen = path.realisations(b);
    shadow_realisations.assign(seen.begin(), seen.end());
    const bool from_inside = path.inside(b) != (transmitted && b == v.body);
    const States states = b == v.body ? States(shadow_states) : path.states(b);
    const std::span<Line> drawn = std::span(shadow_lines).first(states.size());
    const TreeHit hit =
        first_hit(b, from_inside, drawn, ray, distance, states, shadow_realisations, *light_rng);
    free = !(hit.t < distance);
    return free ? distance : -1;
  });
  return free;
}

// Next-event estimation. `remember(direction, states)` puts the state of the surface that was hit
// into the copy of its body's memory that the shadow ray starts with.
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
    if (v.body >= 0) {
      const States states = path.states(v.body);
      shadow_states.assign(states.begin(), states.end());
      remember(light->direction, shadow_states);
    }
    const bool transmitted = scatter.transmitted(light->direction);
    if (!visible({v.start(transmitted), light->direction}, light->distance, v, transmitted))
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
    if (!scatter.specular()) direct = sample_lights(v, scatter, [](const Vec3&, States) {});
    return scatter.sample(point(kDirectionDecision, *rng));
  }
  const Scene::Impl::Body& body = scene.bodies[v.body];
  const TreeHit hit{v.t, v.surface - static_cast<int>(body.first)};
  const HitGradient found(body.surface, lines_of(v.body), hit, path.states(v.body), *rng,
                          *counters);
  const GradientLaw& law = found.law();
  Vec3 gradient = law.mean;
  if (!law.certain()) {
    const auto [xi1, xi2] = square_to_normals(point(kGradientDecision, *rng));
    gradient += law.b1 * xi1 + law.b2 * xi2;
    counters->line_normals += 2;
  }
  found.remember(gradient, path.states(v.body));
  ++counters->states_remembered;
  normal = normalize(gradient) * (v.inside ? -1 : 1);
  if (v.material->specular() && !law.degenerate) {  // normals have a density to light them by
    const auto lit = [&](const auto& way) {
      return sample_lights(v, way, [&](const Vec3& w, States states) {
        found.remember(*way.gradient_for(w), states);
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
  if (!scatter.specular()) direct = sample_lights(v, scatter, [](const Vec3&, States) {});
  return scatter.sample(point(kDirectionDecision, *rng));
}

}  // namespace gpis
