#include "process/transformed.h"

#include "core/box_image.h"
#include "field/check.h"
#include "field/transformed_field.h"
#include "field/transformed_tensor_field.h"
#include "kernel/transformed_kernel.h"
#include "process/conditions.h"

namespace gpis {
namespace {

bool is_identity(const Mat3& m) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (m.row[i][j] != (i == j)) return false;
  return true;
}

}  // namespace

std::shared_ptr<GaussianProcess> transformed(const GaussianProcess& process, const Affine& matrix) {
  const double least_stretch = check_transform(matrix).min;
  auto out = std::make_shared<GaussianProcess>(process);
  out->mean = transformed(process.mean, matrix);
  out->sigma = transformed(process.sigma, matrix);
  if (process.anisotropy) {
    // The kernel is a factor on it.
    out->anisotropy = std::make_shared<TransformedTensorField>(process.anisotropy, matrix);
  } else if (!is_identity(matrix.linear)) {
    out->kernel =
        std::make_shared<TransformedKernel>(process.kernel, inverse(matrix.linear), least_stretch);
  }
  if (process.bounds) out->bounds = image_of(*process.bounds, matrix);
  if (process.conditions) {
    const Affine back = inverse(matrix);
    std::vector<Conditions::Point> points = process.conditions->points;
    for (Conditions::Point& p : points) {
      p.at = matrix.point(p.at);
      if (p.gradient) p.gradient = transpose(back.linear) * *p.gradient;
    }
    out->conditions = std::make_shared<Conditions>(std::move(points));
  }
  return out;
}

TreePtr transformed(const ProcessTree& tree, const Affine& matrix) {
  return tree.with_leaves(
      [&](const GaussianProcess& process) { return transformed(process, matrix); });
}

}  // namespace gpis
