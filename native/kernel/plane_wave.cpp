#include "kernel/plane_wave.h"

#include "field/check.h"

namespace gpis {

PlaneWave::PlaneWave(const Vec3& wave_vector) : k_(wave_vector) {
  check_direction("wave_vector", wave_vector);
}

std::optional<std::vector<Term>> PlaneWave::terms() const {
  return std::vector{Term{1, {Radial::Family::constant}, Mat3{} * 0, k_}};
}

}  // namespace gpis
