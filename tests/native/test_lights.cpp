// Every light: sample, intersect and density agree, and the irradiance is the one of a closed form.
#include "check.h"
#include "chi_squared.h"
#include "light/light_set.h"

using namespace gpis;
using namespace gpis::test;

namespace {

struct Named {
  std::string name;
  std::unique_ptr<Light> light;
  double irradiance;  // at the origin on a plane facing +z, red
  bool delta;
};

constexpr double kPower = 100;

// Of a disk of radius r and radiance 1 at height h above the plane, axis through the point.
double disk_factor(double r, double h) {
  return kPi * r * r / (r * r + h * h);
}

std::vector<Named> all() {
  const Color power{kPower, 0, 0};
  const Vec3 above{0, 0, 2}, down{0, 0, -1};
  const double disk_radiance = kPower / (kPi * area_of({1, 0, 0}, {0, 1, 0}, true));
  std::vector<Named> list;
  list.push_back({"point", make_point(above, power, 0), kPower / (4 * kPi * 4), true});
  list.push_back({"sphere", make_point(above, power, 0.5), kPower / (4 * kPi * 4), false});
  list.push_back(
      {"spot", make_spot(above, down, power, 0, 0.8, 0.2), kPower / (4 * kPi * 4), true});
  list.push_back({"spot, sphere", make_spot(above, down, power, 0.1, 0.8, 0.2),
                  kPower / (4 * kPi * 4), false});
  list.push_back({"sun", make_sun(down, power, 0), kPower, true});
  list.push_back({"sun, half a degree", make_sun(down, power, 0.01), kPower, false});
  list.push_back({"sun, 60 degrees", make_sun(down, power, kPi / 3), kPower, false});
  list.push_back(
      {"ellipse",
       make_area(above, {1, 0, 0}, {0, 1, 0}, down, true, Color{1, 0, 0} * disk_radiance),
       disk_radiance * disk_factor(0.5, 2), false});
  // A small rectangle, sheared: its power spreads as a cosine.
  list.push_back({"rectangle",
                  make_area(above, {0.02, 0, 0}, {0.005, 0.01, 0}, down, false,
                            Color{1, 0, 0} * (kPower / (kPi * 0.02 * 0.01))),
                  kPower / (kPi * 4), false});
  return list;
}

std::vector<float> gradient_image(int width, int height) {
  std::vector<float> image;
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i)
      for (int k = 0; k < 3; ++k)
        image.push_back(
            static_cast<float>((i == 5 && j == 2) ? 30 : 0.2 + 0.1 * j + (i % 3) * 0.3 * k));
  return image;
}

Mat3 some_rotation() {
  const Frame f(normalize({0.3, -0.5, 0.8}));
  return transpose(Mat3{{f.s, f.t, f.n}});
}

}  // namespace

TEST(light_irradiance_is_that_of_the_closed_form) {
  for (const Named& l : all()) {
    context() = l.name;
    Rng rng(1, 0);
    Mean e;
    for (int n = 0; n < 100'000; ++n) {
      const auto s = l.light->sample({}, square_point(rng));
      if (!s) {
        e.add(0);
        continue;
      }
      CHECK(s->delta(), ==, l.delta);
      e.add(s->radiance.x * s->direction.z / (s->delta() ? 1 : s->pdf));
    }
    CHECK(std::abs(e.mean() - l.irradiance), <, 4 * e.error() + 1e-4 * l.irradiance);
  }
}

TEST(light_samples_meet_the_light) {
  for (const Named& l : all()) {
    if (l.delta) continue;
    context() = l.name;
    Rng rng(2, 0);
    int missed = 0;
    for (int n = 0; n < 10'000; ++n) {
      const auto s = l.light->sample({0.3, 0.1, 0}, square_point(rng));
      if (!s) continue;
      const bool distant = s->distance == kInfinity;
      const auto hit = l.light->intersect({{0.3, 0.1, 0}, s->direction},
                                          distant ? kInfinity : s->distance * (1 + 1e-9));
      if (!hit) {
        ++missed;  // on the edge, by rounding
        continue;
      }
      CHECK(std::abs(hit->pdf - s->pdf), <=, 1e-6 * s->pdf);
      CHECK(hit->radiance.x, ==, s->radiance.x);
      if (!distant) {
        const bool before =
            l.light->intersect({{0.3, 0.1, 0}, s->direction}, s->distance * (1 - 1e-6)).has_value();
        CHECK(before, ==, false);
      }
    }
    CHECK(missed, <=, 2);
  }
}

TEST(light_samplers_follow_their_density) {
  // Only lights as large as the cells of the test; small ones are covered by the two tests above.
  std::vector<Named> list;
  list.push_back({"sphere", make_point({0, 1, 0.5}, {1, 1, 1}, 0.8), 0, false});
  list.push_back({"sun", make_sun(normalize({0.3, 0.4, -1}), {1, 1, 1}, 2), 0, false});
  list.push_back({"area",
                  make_area({0.2, 0.1, 1}, {2, 0, 0.3}, {1, 3, 0}, {0, 0, -1}, false, {1, 1, 1}), 0,
                  false});
  const auto image = gradient_image(16, 8);
  list.push_back(
      {"image", make_image_environment(16, 8, image.data(), some_rotation(), 2), 0, false});
  for (const Named& l : list) {
    context() = l.name;
    const auto sample = [&](Rng& rng) -> std::optional<Vec3> {
      const auto s = l.light->sample({}, square_point(rng));
      if (!s) return std::nullopt;
      return s->direction;
    };
    const auto pdf = [&](const Vec3& w) {
      const auto hit = l.light->intersect({{}, w}, kInfinity);
      return hit ? hit->pdf : 0;
    };
    const ChiSquared result = chi_squared(sample, pdf, 30'000, 5);
    CHECK(result.p_value, >, 2.5e-4);
    CHECK(std::abs(result.total - 1), <, 0.01);
  }
}

TEST(both_ways_to_find_a_sky_add_up) {
  // What is darker than the mean is found by scattering alone, an even sky wholly.
  const auto spot = gradient_image(16, 8);
  auto even = spot;
  for (int k = 0; k < 3; ++k) even[3 * (2 * 16 + 5) + k] = 0.4f;
  std::vector<float> half(3 * 16 * 8, 1);
  std::fill(half.begin(), half.begin() + 3 * 16 * 4, 0.f);
  for (const auto& [image, sampled] : {std::pair{spot, true}, {even, false}, {half, true}}) {
    LightSet set;
    set.add(make_image_environment(16, 8, image.data(), some_rotation(), 2), true);
    set.finish(3, true);
    CHECK(set.groups(), ==, sampled);
    Rng rng(4, 0);
    Mean both, scattered;
    int unsampled = 0;
    for (int n = 0; n < 100'000; ++n) {
      const double pdf = 1 / (4 * kPi);  // of scattering into any direction
      const Vec3 to{rng.normal(), rng.normal(), rng.normal()};
      const Ray ray{{}, normalize(to)};
      const double found = set.met(ray, kInfinity, pdf).x / pdf;
      scattered.add(set.met(ray, kInfinity, kInfinity).x / pdf);
      unsampled += found == set.met(ray, kInfinity, kInfinity).x / pdf;
      double lit = 0;
      if (sampled) {
        const auto light = set.sample(0, {}, square_point(rng));
        lit = light->radiance.x * balance(light->pdf, pdf) / light->pdf;
      }
      both.add(found + lit);
    }
    CHECK(std::abs(both.mean() - scattered.mean()), <,
          4 * std::hypot(both.error(), scattered.error()));
    CHECK(unsampled, >, sampled ? 30'000 : 99'999);
    if (sampled) CHECK(both.error(), <, 0.8 * scattered.error());
  }
}

TEST(lights_shine_on_one_side) {
  const auto area = make_area({0, 0, 2}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, false, {1, 1, 1});
  Rng rng(1, 0);
  CHECK(area->sample({}, square_point(rng)).has_value(), ==, false);
  CHECK(area->intersect({{}, {0, 0, 1}}, kInfinity).has_value(), ==, false);
  const auto sphere = make_point({}, {1, 1, 1}, 1);
  CHECK(sphere->sample({0.1, 0, 0}, square_point(rng)).has_value(), ==, false);
  CHECK(sphere->intersect({{0.1, 0, 0}, {0, 0, 1}}, kInfinity).has_value(), ==, false);
}

TEST(image_lies_as_in_blender) {
  // u = .5 looks along +x, u = .25 along +y; rows from the bottom (-z) up.
  std::vector<float> image(3 * 8 * 4, 0.f);
  const auto set = [&](int i, int j, float v) { image[3 * (8 * j + i)] = v; };
  set(3, 2, 1);
  set(4, 2, 1);  // the two texels beside u = .5, just above the horizon
  set(1, 2, 2);
  set(2, 2, 2);  // beside u = 2/8
  for (int i = 0; i < 8; ++i) set(i, 0, 5);
  const auto world = make_image_environment(8, 4, image.data(), {}, 1);
  const auto red = [&](const Vec3& d) {
    return world->intersect({{}, normalize(d)}, kInfinity)->radiance.x;
  };
  const double up = std::sin(kPi * 0.125);
  CHECK(std::abs(red({std::sqrt(1 - up * up), 0, up}) - 1), <, 1e-6);
  CHECK(std::abs(red({0, std::sqrt(1 - up * up), up}) - 2), <, 1e-6);
  CHECK(std::abs(red({0, 0, -1}) - 5), <, 1e-6);
  CHECK(red({0, 0, 1}), ==, 0.0);
  CHECK(world->intersect({{}, {0, 0, -1}}, 10).has_value(), ==, false);
}

namespace {

// A point over a lamp, a sun and a world, and as many weak lamps as are wanted.
LightSet some_lights(int weak) {
  LightSet set;
  set.add(make_point({0, 0, 2}, {10, 0, 0}, 0), false);
  set.add(make_sun({0, 0, -1}, {3, 0, 0}, 0.2), false);
  set.add(make_constant_environment({7, 0, 0}), true);
  for (int i = 0; i < weak; ++i) set.add(make_point({0, 0, 1.0 + i}, {1, 0, 0}, 0.1 * i), false);
  return set;
}

}  // namespace

TEST(light_set_keeps_choice_in_the_density) {
  for (const int weak : {0, 1, 2, 5}) {
    context() = std::to_string(weak) + " weak lamps";
    LightSet set = some_lights(weak);
    set.finish(5, true);
    // The strongest are sampled always, the others share a group.
    CHECK(set.groups(), ==, std::min(2 + weak, LightSet::kMostGroups));
    double sum = 0, expected = 10 / (16 * kPi) + 3;
    for (int i = 0; i < 3 + weak; ++i) sum += set.probability(i);
    for (int i = 0; i < weak; ++i) expected += 1 / (4 * kPi * (1 + i) * (1 + i));
    CHECK(std::abs(sum - set.groups()), <, 1e-12);
    CHECK(set.probability(0), ==, 1.0);
    CHECK(set.probability(2), ==, 0.0);  // a constant world is not sampled
    Rng rng(3, 0);
    Mean e;
    for (int n = 0; n < 100'000; ++n) {
      double irradiance = 0;
      for (int group = 0; group < set.groups(); ++group) {
        const auto s = set.sample(group, {}, square_point(rng));
        irradiance += s->radiance.x * s->direction.z / (s->delta() ? 1 : s->pdf);
      }
      e.add(irradiance);
    }
    CHECK(std::abs(e.z(expected)), <, 4.0);
    CHECK(set.met_by_camera({{}, {0, 0, 1}}, 0.5).x, ==, 0.0);
    set.finish(5, false);
    CHECK(set.groups(), ==, 0);
  }
  LightSet set = some_lights(0);
  set.finish(5, true);
  CHECK(set.met_by_camera({{}, {0, 0, 1}}, kInfinity).x, ==, 7.0);
}
