// Every micro-BRDF: its sampler against its density, sample against eval, reciprocity, energy.
#include "check.h"
#include "chi_squared.h"
#include "core/warp.h"
#include "material/material.h"

using namespace gpis;
using namespace gpis::test;

namespace {

struct Named {
  std::string name;
  std::unique_ptr<Material> material;
};

std::vector<Named> all(const Color& color) {
  std::vector<Named> list;
  list.push_back({"lambert", make_lambert(color)});
  for (const double r : {0.3, 0.6, 1.0}) {
    list.push_back({"conductor " + std::to_string(r), make_conductor(color, r)});
    list.push_back({"principled " + std::to_string(r), make_principled(color, r, 0)});
    list.push_back({"principled half metal " + std::to_string(r), make_principled(color, r, 0.5)});
    list.push_back({"principled metal " + std::to_string(r), make_principled(color, r, 1)});
  }
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
  // Family-wise significance 1e-3 over 39 tests.
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
      CHECK(result.p_value, >, 2.6e-5);
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
