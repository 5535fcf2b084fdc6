// Micro-BRDFs: how light scatters at a point whose normal is known. Directions are unit vectors in
// the local frame of that normal (0, 0, 1); `wo` points back along the ray and has wo.z > 0; light
// that passes through goes on to wi.z < 0. Adding a material: one file, one line in the table of
// scene/scene.cpp.
//
// Paths carry basic radiance L/n², n the index of refraction where they are: refraction changes L
// by the ratio of n² and L/n² not at all (Veach 1997, §5.2), so lossless interfaces have weight 1
// and a white furnace is exactly 1. Lights and cameras inside of glass are taken as in air, as in
// Cycles.
#pragma once

#include <memory>
#include <optional>

#include "core/vec.h"
#include "core/warp.h"

namespace gpis {

struct MaterialSample {
  Vec3 wi;
  Color weight;    // eval / pdf
  double pdf = 0;  // per solid angle; meaningless if specular
  bool specular = false;
};

// What a surface's painted albedo multiplies a material's colour with.
inline constexpr Color kNoTint{1, 1, 1};

class Material {
 public:
  virtual ~Material() = default;
  // BRDF · |cos θ_i|; zero below opaque surfaces, and for specular parts.
  virtual Color eval(const Vec3& wo, const Vec3& wi, const Color& tint = kNoTint) const = 0;
  virtual double pdf(const Vec3& wo, const Vec3& wi, const Color& tint = kNoTint) const = 0;
  // Nothing where the light is absorbed (the loss of single scattering on rough metals).
  virtual std::optional<MaterialSample> sample(const Vec3& wo, SquarePoint at,
                                               const Color& tint = kNoTint) const = 0;
  // What the albedo pass shows.
  virtual Color albedo() const = 0;
  // True if all light is reflected and refracted in one direction each: eval and pdf are zero, and
  // this much goes there at angle of incidence θ.
  virtual bool specular() const { return false; }
  virtual Color specular_reflectance(double /*cos θ*/, const Color& /*tint*/ = kNoTint) const {
    return {};
  }
  virtual Color specular_transmittance(double /*cos θ*/, const Color& /*tint*/ = kNoTint) const {
    return {};
  }
  // The index of refraction beyond the surface over that before it; 0: no light passes.
  virtual double relative_index() const { return 0; }
  // The same surface as rays inside of the body meet it.
  virtual const Material& from_inside() const { return *this; }
};

std::unique_ptr<Material> make_lambert(const Color& color);
// Reflects `color` at normal incidence and `edge` at grazing angles (Schlick between).
std::unique_ptr<Material> make_mirror(const Color& color, const Color& edge);
// Single scattering at a GGX surface with the same reflectance `color` at all angles, as Blender's
// Glossy node ("GGX").
std::unique_ptr<Material> make_conductor(const Color& color, double roughness);
// A subset of Blender's Principled node: metallic mixes a GGX metal (Schlick, normal reflectance =
// color) with a Lambertian base under a dielectric GGX coat of index 1.5. No transmission,
// subsurface, clearcoat, sheen or multiple scattering.
std::unique_ptr<Material> make_principled(const Color& color, double roughness, double metallic);
// The surface of a body of index of refraction `ior` in air: exact Fresnel reflectance, what passes
// is tinted by `color`, what is reflected by `reflection`. Rough: single scattering at a GGX
// surface (Walter et al. 2007), as Blender's Glass node ("GGX").
std::unique_ptr<Material> make_dielectric(const Color& color, const Color& reflection, double ior,
                                          double roughness);

// Rougher than this is a microfacet surface, smoother is a mirror: GGX α = roughness² would be
// below 1e-4.
inline constexpr double kSmoothRoughness = 0.01;

}  // namespace gpis
