// Every micro-BRDF: its sampler against its density, sample against eval, reciprocity, energy.
#include "check.h"
#include "chi_squared.h"
#include "core/warp.h"
#include "material/dielectric.h"

using namespace gpis;
using namespace gpis::test;

namespace {

struct Named {
  std::string name;
  std::shared_ptr<const Material> material;
};

// Both faces of each.
std::vector<Named> rough_dielectrics(const Color& color) {
  std::vector<Named> list;
  for (const double r : {0.3, 0.6}) {
    const std::shared_ptr<const Material> glass = make_dielectric(color, color, 1.5, r);
    list.push_back({"dielectric " + std::to_string(r), glass});
    list.push_back({"dielectric from inside " + std::to_string(r), {glass, &glass->from_inside()}});
  }
  return list;
}

std::vector<Named> all(const Color& color) {
  std::vector<Named> list;
  list.push_back({"lambert", make_lambert(color)});
  for (const double r : {0.3, 0.6, 1.0}) {
    list.push_back({"conductor " + std::to_string(r), make_conductor(color, r)});
    list.push_back({"principled " + std::to_string(r), make_principled(color, r, 0)});
    list.push_back({"principled half metal " + std::to_string(r), make_principled(color, r, 0.5)});
    list.push_back({"principled metal " + std::to_string(r), make_principled(color, r, 1)});
  }
  for (Named& m : rough_dielectrics(color)) list.push_back(std::move(m));
  return list;
}

std::vector<Vec3> directions() {
  std::vector<Vec3> list;
  for (const double cos : {0.97, 0.6, 0.15}) {
    const double sin = std::sqrt(1 - cos * cos);
    list.push_back({sin * std::cos(0.7), sin * std::sin(0.7), cos});
  }
  return list;
}

}  // namespace

TEST(material_samplers_follow_their_density) {
  const auto list = all({0.9, 0.5, 0.2});
  // Family-wise significance 1e-3 over 51 tests.
  for (const Named& m : list)
    for (const Vec3& wo : directions()) {
      context() = m.name + " at cos " + std::to_string(wo.z);
      const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
        const auto s = m.material->sample(wo, square_point(rng));
        if (!s) return std::nullopt;
        return s->wi;
      };
      const ChiSquared result = chi_squared(
          sample, [&](const Vec3& wi) { return m.material->pdf(wo, wi); }, 100'000, 3);
      CHECK(result.p_value, >, 2e-5);
      CHECK(result.total, <, 1.01);
    }
}

TEST(material_samples_carry_eval_over_pdf) {
  for (const Named& m : all({0.9, 0.5, 0.2}))
    for (const Vec3& wo : directions()) {
      context() = m.name;
      Rng rng(1, 2);
      for (int n = 0; n < 1000; ++n) {
        const auto s = m.material->sample(wo, square_point(rng));
        if (!s) continue;
        CHECK(std::abs(s->pdf - m.material->pdf(wo, s->wi)), <=, 1e-9 * s->pdf);
        const Color f = m.material->eval(wo, s->wi);
        for (int k = 0; k < 3; ++k) CHECK(std::abs(f[k] - s->weight[k] * s->pdf), <=, 1e-9 * f[k]);
      }
    }
}

TEST(materials_are_reciprocal) {
  Rng rng(5, 0);
  for (const Named& m : all({0.9, 0.5, 0.2})) {
    context() = m.name;
    for (int n = 0; n < 1000; ++n) {
      const double u1 = rng.uniform(), u2 = rng.uniform(), u3 = rng.uniform(), u4 = rng.uniform();
      const Vec3 a = square_to_cosine_hemisphere(u1, u2), b = square_to_cosine_hemisphere(u3, u4);
      const double forth = m.material->eval(a, b).x * a.z, back = m.material->eval(b, a).x * b.z;
      CHECK(std::abs(forth - back), <=, 1e-9 * (forth + back));
    }
  }
}

TEST(materials_keep_energy) {
  // Lambert returns all. Single-scatter GGX may only lose; at roughness .3 under 3%.
  for (const Named& m : all({1, 1, 1}))
    for (const Vec3& wo : directions()) {
      context() = m.name + " at cos " + std::to_string(wo.z);
      Rng rng(7, 0);
      Mean albedo;
      for (int n = 0; n < 40'000; ++n) {
        const auto s = m.material->sample(wo, square_point(rng));
        albedo.add(s ? s->weight.x : 0);
      }
      CHECK(albedo.mean(), <, 1 + 4 * albedo.error() + (m.name[0] == 'p' ? 0.02 : 1e-9));
      if (m.name == "lambert") CHECK(albedo.mean(), ==, 1.0);
      if (m.name == "conductor 0.300000" && wo.z > 0.5) CHECK(albedo.mean(), >, 0.97);
    }
}

TEST(smooth_conductor_is_a_mirror) {
  Rng rng(1, 0);
  CHECK(make_conductor({1, 1, 1}, 0)->specular(), ==, true);
  CHECK(make_conductor({1, 1, 1}, 0.1)->specular(), ==, false);
  const Vec3 wo = directions()[1];
  const auto s = make_mirror({0.5, 0.5, 0.5}, {1, 1, 1})->sample(wo, square_point(rng));
  CHECK(s->wi.x, ==, -wo.x);
  CHECK(s->wi.z, ==, wo.z);
  CHECK(std::abs(s->weight.x - (0.5 + 0.5 * std::pow(1 - wo.z, 5))), <, 1e-12);
}

TEST(rough_dielectrics_are_reciprocal) {
  // Of basic radiance: f(a, b) cos a / η² is f(b, a) cos b from the other side, under refraction.
  Rng rng(6, 0);
  const double ior = 1.5;
  for (const double roughness : {0.3, 0.8}) {
    const auto glass = make_dielectric({0.5, 0.5, 0.5}, {1, 1, 1}, ior, roughness);
    int refracted = 0;
    for (int n = 0; n < 3000; ++n) {
      const double u1 = rng.uniform(), u2 = rng.uniform(), u3 = rng.uniform(), u4 = rng.uniform();
      const Vec3 a = square_to_cosine_hemisphere(u1, u2), b = square_to_cosine_hemisphere(u3, u4);
      const double forth = glass->eval(a, {b.x, b.y, -b.z}).x * a.z / (ior * ior);
      const double back = glass->from_inside().eval(b, {a.x, a.y, -a.z}).x * b.z;
      CHECK(std::abs(forth - back), <=, 1e-9 * (forth + back) + 1e-15);
      refracted += forth > 0;
    }
    CHECK(refracted, >, 500);
  }
}

TEST(dielectrics_lose_only_what_is_scattered_twice) {
  // R + T = 1: exactly where it is smooth, to 1% where it is a little rough.
  for (const double roughness : {0.0, 0.1})
    for (const bool inside : {false, true}) {
      const auto glass = make_dielectric({1, 1, 1}, {1, 1, 1}, 1.5, roughness);
      const Material& face = inside ? glass->from_inside() : *glass;
      for (const Vec3& wo : directions()) {
        Rng rng(8, 0);
        Mean albedo;
        for (int n = 0; n < 20'000; ++n) {
          const auto s = face.sample(wo, square_point(rng));
          albedo.add(s ? s->weight.x : 0);
        }
        CHECK(albedo.mean(), <=, 1.0);
        CHECK(albedo.mean(), >, roughness > 0 ? wo.z > 0.5 ? 0.99 : 0.9 : 1 - 1e-15);
      }
    }
}

TEST(smooth_dielectric_obeys_snell_and_fresnel) {
  // At normal incidence ((n-1)/(n+1))²; at Brewster's angle light polarised in the plane passes
  // wholly, which leaves (cos 2θ)² / 2; total reflection beyond asin 1/n from inside.
  const double ior = 1.5;
  CHECK(std::abs(fresnel_dielectric(1, ior) - 0.04), <, 1e-15);
  CHECK(std::abs(fresnel_dielectric(1, 1 / ior) - 0.04), <, 1e-15);
  const double brewster = std::atan(ior);
  const double expected = std::pow(std::cos(2 * brewster), 2) / 2;
  CHECK(std::abs(fresnel_dielectric(std::cos(brewster), ior) - expected), <, 1e-15);
  const double critical = std::asin(1 / ior);
  CHECK(fresnel_dielectric(std::cos(critical + 1e-6), 1 / ior), ==, 1.0);
  CHECK(fresnel_dielectric(std::cos(critical - 1e-3), 1 / ior), <, 0.9);

  const auto glass = make_dielectric({0.5, 0.6, 0.7}, {0.9, 0.8, 0.7}, ior, 0);
  for (const bool inside : {false, true}) {
    const Material& face = inside ? glass->from_inside() : *glass;
    const double eta = inside ? 1 / ior : ior;
    for (const Vec3& wo : directions()) {
      const double sin = std::hypot(wo.x, wo.y), share = fresnel_dielectric(wo.z, eta);
      Rng rng(9, 0);
      Mean reflected;
      for (int n = 0; n < 20'000; ++n) {
        const auto s = face.sample(wo, square_point(rng));
        CHECK(s->specular, ==, true);
        CHECK(std::abs(length(s->wi) - 1), <, 1e-12);
        // In the plane of incidence, on the other side of the normal.
        CHECK(std::abs(s->wi.x * wo.y - s->wi.y * wo.x), <, 1e-12);
        CHECK(s->wi.x * wo.x + s->wi.y * wo.y, <, 0.0);
        const bool up = s->wi.z > 0;
        reflected.add(up);
        CHECK(std::abs(std::hypot(s->wi.x, s->wi.y) - (up ? sin : sin / eta)), <, 1e-12);
        CHECK(s->weight.x, ==, (up ? 0.9 : 0.5));
      }
      CHECK(std::abs(reflected.mean() - share), <=, 4 * std::sqrt(share * (1 - share) / 20'000));
    }
  }
}
