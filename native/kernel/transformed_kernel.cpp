#include "kernel/transformed_kernel.h"

#include <Eigen/Dense>

namespace gpis {
namespace {

// B' with B'ᵀB' = BᵀB and orthogonal rows: S Vᵀ of B = U S Vᵀ.
Mat3 orthogonal_rows(const Mat3& b) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = b.row[i][j];
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullV);
  Mat3 out;
  for (int i = 0; i < 3; ++i) {
    // Below rounding: constant along that axis.
    const double s = svd.singularValues()[i];
    const double kept = s > 1e-14 * svd.singularValues()[0] ? s : 0.0;
    for (int j = 0; j < 3; ++j) out.row[i][j] = kept * svd.matrixV()(j, i);
  }
  return out;
}

}  // namespace

std::optional<std::vector<Term>> TransformedKernel::terms() const {
  auto terms = kernel_->terms();
  if (terms)
    for (Term& term : *terms) {
      term.whitening = orthogonal_rows(term.whitening * inverse_);
      term.wave_vector = transpose(inverse_) * term.wave_vector;
    }
  return terms;
}

}  // namespace gpis
