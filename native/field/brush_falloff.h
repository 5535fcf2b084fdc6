// How the strength of a brush falls from its centre to its rim: Blender's presets, or a table.
#pragma once

#include <string>
#include <vector>

namespace gpis {

class Falloff {
 public:
  Falloff() = default;
  // 'smooth', 'smoother', 'sphere', 'root', 'sharp', 'sharper', 'inverse_square', 'linear',
  // 'constant'.
  explicit Falloff(const std::string& preset);
  // Values at equal distances from the centre (first) to the rim (last), linear between.
  explicit Falloff(std::vector<double> curve);

  double operator()(double distance) const;  // in radii, 0 to 1

 private:
  enum class Preset {
    smooth,
    smoother,
    sphere,
    root,
    sharp,
    sharper,
    inverse_square,
    linear,
    constant
  };
  static constexpr const char* kNames[] = {"smooth",         "smoother", "sphere",
                                           "root",           "sharp",    "sharper",
                                           "inverse_square", "linear",   "constant"};
  Preset preset_ = Preset::smooth;
  std::vector<double> curve_;  // empty: the preset
};

}  // namespace gpis
