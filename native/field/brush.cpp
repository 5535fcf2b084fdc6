#include "field/brush.h"

#include "field/check.h"

namespace gpis {
namespace {

bool takes(Channel channel, Operation operation) {
  if (operation == Operation::smooth) return true;
  switch (channel) {
    case Channel::mean:
      return operation == Operation::inflate || operation == Operation::deflate ||
             operation == Operation::flatten || operation == Operation::grab;
    case Channel::deviation:
    case Channel::length_scale:
      return operation == Operation::set || operation == Operation::add;
    case Channel::anisotropy:
      return operation == Operation::comb;
    case Channel::albedo:
      return operation == Operation::set;
  }
  return false;
}

void check_between(const char* what, double v, double low, double high) {
  if (!(v >= low && v <= high))
    refuse("", what, " is ", v, "; it takes a number from ", low, " to ", high, ".");
}

}  // namespace

void check_brush(const Brush& b) {
  if (!takes(b.channel, b.operation))
    refuse("operation does not go with channel: 'mean' takes 'inflate', 'deflate', 'smooth', ",
           "'flatten' and 'grab'; 'deviation' and 'length_scale' take 'set', 'add' and 'smooth'; ",
           "'anisotropy' takes 'comb' and 'smooth'; 'albedo' takes 'set' and 'smooth'.");
  const bool length = b.channel == Channel::length_scale;
  if (b.operation == Operation::inflate || b.operation == Operation::deflate)
    check_between("value (displacement in radii)", b.value.x, -10, 10);
  if (b.operation == Operation::add) check_between("value (factor)", b.value.x, 1e-3, 1e3);
  if (b.operation == Operation::set) {
    if (b.channel == Channel::albedo)
      for (int i = 0; i < 3; ++i) check_between("value (colour)", b.value[i], 0, 1);
    else
      check_between("value", b.value.x, length ? kLeastLength : kLeastDeviation,
                    length ? kMostLength : kMostDeviation);
  }
  if (b.operation == Operation::comb) {
    check_positive("ratios", b.ratios);
    const auto [low, high] = std::minmax({b.ratios.x, b.ratios.y, b.ratios.z});
    if (high > kMostRatio * low)
      refuse("ratios is ", b.ratios, "; the longest is at most ", kMostRatio,
             " times the shortest.");
  }
}

void check_dabs(const Brush& brush, const std::vector<Dab>& dabs) {
  for (std::size_t i = 0; i < dabs.size(); ++i) {
    const Dab& d = dabs[i];
    const std::string of = " of dab " + std::to_string(i);
    check_finite(("centers" + of).c_str(), d.center);
    check_positive(("radius" + of).c_str(), d.radius);
    check_between(("strength" + of).c_str(), d.strength, 0, 1);
    check_finite(("directions" + of).c_str(), d.direction);
    if (brush.operation == Operation::comb)
      check_direction(("directions" + of).c_str(), d.direction);
  }
}

}  // namespace gpis
