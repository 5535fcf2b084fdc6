#include "process/markov_model.h"

#include <Eigen/Cholesky>

namespace gpis {
namespace {

// Gauss-Legendre on [0, 1], 8 points: the integrand is a polynomial of degree 4 at most times an
// exponential.
constexpr double kNodes[] = {0.0198550717512319, 0.1016667612931866, 0.2372337950418355,
                             0.4082826787521751, 0.5917173212478249, 0.7627662049581645,
                             0.8983332387068134, 0.9801449282487681};
constexpr double kWeights[] = {0.0506142681451881, 0.1111905172266872, 0.1568533229389436,
                               0.1813418916891810, 0.1813418916891810, 0.1568533229389436,
                               0.1111905172266872, 0.0506142681451881};

// Lower triangle L with L Lᵀ = m, m positive definite but badly scaled.
template <class Matrix>
Matrix lower_root(const Matrix& m) {
  Matrix l = Matrix::Zero();
  for (int i = 0; i < m.rows(); ++i) {
    for (int j = 0; j <= i; ++j) {
      double v = m(i, j);
      for (int k = 0; k < j; ++k) v -= l(i, k) * l(j, k);
      if (i == j)
        l(i, i) = std::sqrt(std::max(v, 0.0));
      else
        l(i, j) = l(j, j) > 0 ? v / l(j, j) : 0;
    }
  }
  return l;
}

// The state of the reversed process: odd derivatives change sign.
template <class Matrix>
Matrix mirrored(const Matrix& m) {
  Matrix r = m;
  for (int i = 0; i < m.rows(); ++i)
    for (int j = 0; j < m.cols(); ++j)
      if ((i + j) % 2) r(i, j) = -r(i, j);
  return r;
}

}  // namespace

template <class Model>
typename Model::Matrix transition_noise(double delta) {
  using Matrix = typename Model::Matrix;
  if (delta > 0.6) {
    const Matrix a = Model::transition(delta), p = Model::stationary();
    return p - a * p * a.transpose();
  }
  Matrix q = Matrix::Zero();
  for (int i = 0; i < 8; ++i) {
    const typename Model::Vector h = Model::response(delta * kNodes[i]);
    q += kWeights[i] * h * h.transpose();
  }
  return Model::kIntensity * delta * q;
}

template <class Model>
Transition<Model>::Transition(double delta)
    : from(Model::transition(delta)), factor(lower_root(transition_noise<Model>(delta))) {}

template <class Model>
Bridge<Model>::Bridge(double left, double right) {
  using Matrix = typename Model::Matrix;
  // From the nearer end: what the other one adds then never cancels.
  const bool mirror = right < left;
  const double near = std::min(left, right), far = std::max(left, right);
  const Matrix q = transition_noise<Model>(near), a_far = Model::transition(far);
  const Matrix total = transition_noise<Model>(near + far);
  // Entries fall off as powers of Δ: scaled, the matrix is well conditioned.
  const typename Model::Vector scale = total.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix scaled = scale.asDiagonal() * total * scale.asDiagonal();
  const Matrix cross = scale.asDiagonal() * a_far * q;
  const Matrix gain =
      (scaled.ldlt().solve(cross)).transpose() * scale.asDiagonal();  // q a_farᵀ total⁻¹
  Matrix from_near = Model::transition(near) - gain * Model::transition(near + far);
  Matrix from_far = gain;
  Matrix rest = q - gain * a_far * q;
  rest = 0.5 * (rest + rest.transpose()).eval();
  if (mirror) {
    from_near = mirrored(from_near);
    from_far = mirrored(from_far);
    rest = mirrored(rest);
  }
  from_left = mirror ? from_far : from_near;
  from_right = mirror ? from_near : from_far;
  factor = lower_root(rest);
}

template struct Bridge<Matern32>;
template struct Bridge<Matern52>;
template struct Bridge<Wong>;
template struct Transition<Matern32>;
template struct Transition<Matern52>;
template struct Transition<Wong>;

}  // namespace gpis
