// The world: a constant colour, or an equirectangular image.
//
// Image convention (Blender's): direction (x, y, z) in image space is seen at column u = ½ -
// atan2(y, x)/2π, row v = ½ + atan2(z, √(x²+y²))/π of the unit square, row 0 at the bottom.
// Bilinear between texel centres, wrapped in u.
//
// Sampling: the patches between texel centres are chosen by their solid angle times what their mean
// brightness exceeds that of the whole sky by, then a direction uniformly in solid angle within the
// patch. The density is constant per patch, without a singularity at the poles. Where it is zero,
// light is found by scattering alone, which is as good there: MIS needs only one of the two
// densities (Karlík et al. 2019, "MIS compensation").
#include "light/light.h"
#include "light/piecewise.h"

namespace gpis {
namespace {

// The relative variance of brightness over the sphere below which a sky is even. Measured at
// spheres (Lambert and mirror) under skies exp(k z).
constexpr double kEvenSky = 0.5;

class ConstantEnvironment final : public Light {
 public:
  explicit ConstantEnvironment(const Color& radiance) : radiance_(radiance) {}

  double power(double) const override { return 0; }
  std::optional<LightSample> sample(const Vec3&, SquarePoint) const override {
    return std::nullopt;
  }
  std::optional<LightHit> intersect(const Ray&, double t_max) const override {
    if (t_max < kInfinity) return std::nullopt;
    return LightHit{radiance_, 0};
  }

 private:
  Color radiance_;
};

class ImageEnvironment final : public Light {
 public:
  ImageEnvironment(int width, int height, const float* image, const Mat3& image_to_world,
                   double strength)
      : width_(width),
        height_(height),
        image_(image),
        to_world_(image_to_world),
        strength_(strength) {
    std::vector<double> brightness;
    double sum = 0, squares = 0;
    for (int j = 0; j <= height; ++j) {
      const double share = band(j) / (2 * width);  // of the sphere
      for (int i = 0; i < width; ++i) {
        double b = 0;
        for (const Color& c : {texel(i, j - 1), texel(i + 1, j - 1), texel(i, j), texel(i + 1, j)})
          b += luminance({std::abs(c.x), std::abs(c.y), std::abs(c.z)}) / 4;
        brightness.push_back(b);
        sum += b * share;
        squares += b * b * share;
      }
    }
    const double variance = std::max(0.0, squares - sum * sum);
    mean_ = variance > kEvenSky * sum * sum ? sum * strength : 0;

    std::vector<Piecewise1D> rows;
    std::vector<double> row(width);
    for (int j = 0; j <= height; ++j) {
      for (int i = 0; i < width; ++i)
        row[i] = std::max(0.0, brightness[j * width + i] - sum) * band(j);
      rows.emplace_back(row);
    }
    patches_.emplace(std::move(rows));
  }

  // An even sky is not sampled: what a shadow ray adds to what scattering finds is not worth it.
  double power(double r) const override { return mean_ * 4 * kPi * kPi * r * r; }
  std::optional<LightSample> sample(const Vec3&, SquarePoint at) const override {
    const auto [i, j] = patches_->sample(at);
    const double phi = 2 * kPi * (0.5 - (i + 0.5 + at.u) / width_);
    const double low = sin_latitude(j), high = sin_latitude(j + 1);
    const double z = low + (high - low) * at.v, r = std::sqrt(std::max(0.0, 1 - z * z));
    const Vec3 local{r * std::cos(phi), r * std::sin(phi), z};
    return LightSample{to_world_ * local, kInfinity, look_up(local).first, density(i, j)};
  }
  std::optional<LightHit> intersect(const Ray& ray, double t_max) const override {
    if (t_max < kInfinity) return std::nullopt;
    const auto [radiance, pdf] = look_up(transpose(to_world_) * ray.direction);
    return LightHit{radiance, pdf};
  }

 private:
  // Patch (i, j) lies between the texel centres of columns i, i+1 and rows j-1, j (rows -1 and
  // `height` repeat the pole rows).
  double sin_latitude(int j) const {
    return j <= 0 ? -1 : j > height_ ? 1 : std::sin(kPi * ((j - 0.5) / height_ - 0.5));
  }
  double band(int j) const { return sin_latitude(j + 1) - sin_latitude(j); }
  Color texel(int i, int j) const {
    const std::size_t row = std::clamp(j, 0, height_ - 1), column = i % width_;
    const float* p = image_ + 3 * (row * width_ + column);
    return {p[0], p[1], p[2]};
  }
  double density(int i, int j) const {
    return patches_->probability(i, j) * width_ / (2 * kPi * band(j));
  }
  // Radiance and sampling density towards a direction of image space.
  std::pair<Color, double> look_up(const Vec3& d) const {
    const double u = 0.5 - std::atan2(d.y, d.x) / (2 * kPi);
    const double v = 0.5 + std::atan2(d.z, std::hypot(d.x, d.y)) / kPi;
    double column = u * width_ - 0.5;
    if (column < 0) column += width_;
    const double row = v * height_ + 0.5;
    const int i = std::clamp(static_cast<int>(column), 0, width_ - 1),
              j = std::clamp(static_cast<int>(row), 0, height_);
    const double a = column - i, b = row - j;
    const Color low = texel(i, j - 1) * (1 - a) + texel(i + 1, j - 1) * a;
    const Color high = texel(i, j) * (1 - a) + texel(i + 1, j) * a;
    return {(low * (1 - b) + high * b) * strength_, density(i, j)};
  }

  int width_, height_;
  const float* image_;
  Mat3 to_world_;
  double strength_, mean_ = 0;
  std::optional<Piecewise2D> patches_;
};

}  // namespace

std::unique_ptr<Light> make_constant_environment(const Color& radiance) {
  return std::make_unique<ConstantEnvironment>(radiance);
}

std::unique_ptr<Light> make_image_environment(int width, int height, const float* image,
                                              const Mat3& image_to_world, double strength) {
  return std::make_unique<ImageEnvironment>(width, height, image, image_to_world, strength);
}

}  // namespace gpis
