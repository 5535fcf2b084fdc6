#include "process/lattice_field.h"

#include <Eigen/Core>

namespace gpis {
namespace {

constexpr int kNodes = GaussianWindow::kNodes;
using Row = Eigen::Array<double, kNodes, 1>;
using ConstRow = Eigen::Map<const Row>;

// Turns the rows of B, which leaves BᵀB as it is, until only the first depends on z and, of the
// others, only the first on y. Returns the rank; rows beyond it vanish.
int echelon(Mat3& b) {
  double scale = 0;
  for (const Vec3& row : b.row) scale = std::max(scale, length(row));
  int rank = 0;
  for (int column = 2; column >= 0 && rank < 3; --column) {
    for (int r = rank + 1; r < 3; ++r) {
      const double x = b.row[rank][column], y = b.row[r][column], norm = std::hypot(x, y);
      if (norm <= 1e-14 * scale) continue;
      const Vec3 upper = (b.row[rank] * x + b.row[r] * y) / norm;
      b.row[r] = (b.row[r] * x - b.row[rank] * y) / norm;
      b.row[rank] = upper;
      b.row[r][column] = 0;
    }
    if (std::abs(b.row[rank][column]) > 1e-14 * scale) {
      ++rank;
    } else {
      for (int r = rank; r < 3; ++r) b.row[r][column] = 0;
    }
  }
  return rank;
}

// The weights of one axis; a thin one has the one node 0 of weight 1.
struct Axis {
  GaussianWindow window;
  int nodes;

  Axis(double y, bool thin) : window(y), nodes(thin ? 1 : kNodes) {
    if (!thin) return;
    window.first = 0;
    window.weight[0] = 1;
    window.moment[0] = 0;
  }
};

}  // namespace

Lattice::Lattice(const Mat3& whitening, int number) : factor_(whitening), number_(number) {
  const int rank = echelon(factor_);
  for (int axis = rank; axis < 3; ++axis) {
    factor_.row[axis] = {};
    thin_ |= 1u << axis;
  }
}

const double* Lattice::window(LatticeNoise& noise, const Node& first,
                              const std::array<int, 3>& size) {
  if (window_.generation != noise.generation() || window_.first != first || window_.size != size) {
    window_.normals.resize(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
    noise.window(number_, thin_, first, size, window_.normals.data());
    window_.generation = noise.generation();
    window_.first = first;
    window_.size = size;
  }
  return window_.normals.data();
}

FieldSample Lattice::sample(LatticeNoise& noise, const Vec3& x) {
  const Vec3 y = factor_ * x;
  const Axis a0(y.x, thin_ & 1), a1(y.y, thin_ & 2), a2(y.z, thin_ & 4);
  const double* normals = window(noise, {a0.window.first, a1.window.first, a2.window.first},
                                 {a0.nodes, a1.nodes, a2.nodes});
  if (a0.nodes == 1) return {normals[0], {}};  // constant everywhere

  // Sums over axes 1 and 2 of whole rows of axis 0; w weights, m moments.
  Row ww = Row::Zero(), mw = Row::Zero(), wm = Row::Zero();
  for (int j = 0; j < a2.nodes; ++j) {
    Row w = Row::Zero(), m = Row::Zero();
    for (int i = 0; i < a1.nodes; ++i, normals += kNodes) {
      const ConstRow row(normals);
      w += a1.window.weight[i] * row;
      m += a1.window.moment[i] * row;
    }
    ww += a2.window.weight[j] * w;
    mw += a2.window.weight[j] * m;
    wm += a2.window.moment[j] * w;
  }
  const ConstRow weight(a0.window.weight), moment(a0.window.moment);
  const Vec3 slope{2 * (ww * moment).sum(), 2 * (mw * weight).sum(), 2 * (wm * weight).sum()};
  return {(ww * weight).sum(), transpose(factor_) * slope};
}

void Lattice::line(LatticeNoise& noise, const Vec3& x, double spacing, int count, double* g) {
  const double step = factor_.row[0].z * spacing;
  if (thin_ & 1) {  // constant everywhere
    std::fill(g, g + count, sample(noise, x).value);
    return;
  }
  // Points further apart than a window share no nodes: no row is worth making.
  if (std::abs(step) > 0.5 * kNodes * GaussianWindow::kStep) {
    for (int n = 0; n < count; ++n) g[n] = sample(noise, x + Vec3{0, 0, n * spacing}).value;
    return;
  }
  const Vec3 y = factor_ * x;
  const Axis a1(y.y, thin_ & 2), a2(y.z, thin_ & 4);
  const double y_end = y.x + (count - 1) * step;
  std::int64_t first = GaussianWindow(std::min(y.x, y_end)).first,
               last = GaussianWindow(std::max(y.x, y_end)).first + kNodes - 1;
  // The row before had the same nodes, or some a little further along: a margin saves reading most
  // of them again.
  const Node at{first, a1.window.first, a2.window.first};
  const bool kept = window_.generation == noise.generation() && window_.first[1] == at[1] &&
                    window_.first[2] == at[2] && window_.first[0] <= first &&
                    window_.first[0] + window_.size[0] > last;
  if (kept) {
    first = window_.first[0];
    last = first + window_.size[0] - 1;
  } else {
    first -= kNodes;
    last += kNodes;
  }
  const int nodes = static_cast<int>(last - first + 1);
  const double* normals = window(noise, {first, at[1], at[2]}, {nodes, a1.nodes, a2.nodes});
  row_.resize(nodes);
  Eigen::Map<Eigen::ArrayXd> row(row_.data(), nodes);
  row.setZero();
  for (int j = 0; j < a2.nodes; ++j)
    for (int i = 0; i < a1.nodes; ++i, normals += nodes)
      row += (a1.window.weight[i] * a2.window.weight[j]) *
             Eigen::Map<const Eigen::ArrayXd>(normals, nodes);
  for (int n = 0; n < count; ++n) {
    const GaussianWindow a0(y.x + n * step);
    g[n] = (ConstRow(row_.data() + (a0.first - first)) * ConstRow(a0.weight)).sum();
  }
}

LatticeField::LatticeField(const Term& term, int number)
    : whitening_(term.whitening), scale_(std::sqrt(term.weight)), wave_vector_(term.wave_vector) {
  if (term.radial.family == Radial::Family::constant) whitening_ = {{Vec3{}, Vec3{}, Vec3{}}};
  const bool modulated = dot(wave_vector_, wave_vector_) > 0;
  for (int i = 0; i < (modulated ? 2 : 1); ++i) lattices_.emplace_back(whitening_, number + i);
}

void LatticeField::add(LatticeNoise& noise, const Vec3& x, FieldSample& g) {
  const FieldSample first = lattices_[0].sample(noise, x);
  if (lattices_.size() == 1) {
    g.value += scale_ * first.value;
    g.gradient += first.gradient * scale_;
    return;
  }
  const FieldSample second = lattices_[1].sample(noise, x);
  const double theta = dot(wave_vector_, x);
  const double c = scale_ * std::cos(theta), s = scale_ * std::sin(theta);
  g.value += c * first.value + s * second.value;
  g.gradient += first.gradient * c + second.gradient * s +
                wave_vector_ * (c * second.value - s * first.value);
}

void LatticeField::add_line(LatticeNoise& noise, const Vec3& x, double spacing, int count,
                            double* g) {
  scratch_.resize(count);
  lattices_[0].line(noise, x, spacing, count, scratch_.data());
  if (lattices_.size() == 1) {
    for (int n = 0; n < count; ++n) g[n] += scale_ * scratch_[n];
    return;
  }
  const double theta = dot(wave_vector_, x), turn = wave_vector_.z * spacing;
  for (int n = 0; n < count; ++n) g[n] += scale_ * std::cos(theta + n * turn) * scratch_[n];
  lattices_[1].line(noise, x, spacing, count, scratch_.data());
  for (int n = 0; n < count; ++n) g[n] += scale_ * std::sin(theta + n * turn) * scratch_[n];
}

double LatticeField::fourth_derivative_variance(const Vec3& d) const {
  const Vec3 whitened = whitening_ * d;
  return scale_ * scale_ * eighth_moment(dot(wave_vector_, d), dot(whitened, whitened));
}

}  // namespace gpis
