#include "process/lattice_field.h"

#include <Eigen/Core>
#include <algorithm>

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

void Lattice::box(LatticeNoise& noise, const Vec3& x, double spacing,
                  const std::array<int, 3>& size, double* g) {
  const std::ptrdiff_t row = size[2];
  box(noise, x, spacing, size, row * size[1], row, g);
}

void Lattice::box(LatticeNoise& noise, const Vec3& x, double spacing,
                  const std::array<int, 3>& size, std::ptrdiff_t slice, std::ptrdiff_t row,
                  double* g) {
  const Vec3 y = factor_ * x;
  const Mat3 step = factor_ * spacing;  // row a: of whitened coordinate a, per i, j and k
  // The nodes that any point of the box reads.
  Node first;
  std::array<int, 3> nodes;
  double count = 1;
  for (int a = 0; a < 3; ++a) {
    if (thin_ >> a & 1) {
      first[a] = 0;
      nodes[a] = 1;
      continue;
    }
    double low = y[a], high = y[a];
    for (int axis = 0; axis < 3; ++axis) {
      const double span = step.row[a][axis] * (size[axis] - 1);
      (span < 0 ? low : high) += span;
    }
    // Rounding may put a point one node further.
    first[a] = GaussianWindow(low).first - 1;
    nodes[a] = static_cast<int>(
        std::min<std::int64_t>(GaussianWindow(high).first + kNodes + 1 - first[a], 1 << 20));
    count *= nodes[a];
  }
  // Points far apart share few nodes: halves, down to where there are few (a point has 18³).
  constexpr double kMostNodes = 1 << 17;
  const int longest = static_cast<int>(std::max_element(size.begin(), size.end()) - size.begin());
  if (count > kMostNodes) {
    std::array<int, 3> part = size;
    part[longest] /= 2;
    box(noise, x, spacing, part, slice, row, g);
    const std::array<std::ptrdiff_t, 3> stride{slice, row, 1};
    Vec3 middle = x;
    middle[longest] += part[longest] * spacing;
    g += part[longest] * stride[longest];
    part[longest] = size[longest] - part[longest];
    box(noise, middle, spacing, part, slice, row, g);
    return;
  }

  const double* normals = window(noise, first, nodes);
  const std::ptrdiff_t n0 = nodes[0], n10 = n0 * nodes[1];
  plane_.resize(n10);
  row_.resize(n0 + kNodes);
  using Array = Eigen::Map<Eigen::ArrayXd>;
  using ConstArray = Eigen::Map<const Eigen::ArrayXd>;
  // Coordinate 0 is the same function of k in every row, up to a constant that is none where the
  // axes are not sheared.
  const bool sheared = step.row[0].x != 0 || step.row[0].y != 0;
  const auto windows_from = [&](double y0) {
    along_.clear();
    for (int k = 0; k < size[2]; ++k) along_.emplace_back(y0 + k * step.row[0].z);
  };
  const bool constant = thin_ & 1;
  if (!sheared && !constant) windows_from(y.x);
  for (int i = 0; i < size[0]; ++i) {
    const Axis a2(y.z + i * step.row[2].x, thin_ & 4);
    Array plane(plane_.data(), n10);
    plane.setZero();
    for (int n = 0; n < a2.nodes; ++n)
      plane +=
          a2.window.weight[n] * ConstArray(normals + (a2.window.first - first[2] + n) * n10, n10);
    for (int j = 0; j < size[1]; ++j) {
      const Axis a1(y.y + i * step.row[1].x + j * step.row[1].y, thin_ & 2);
      Array along(row_.data(), n0);
      along.setZero();
      for (int n = 0; n < a1.nodes; ++n)
        along += a1.window.weight[n] *
                 ConstArray(plane_.data() + (a1.window.first - first[1] + n) * n0, n0);
      double* out = g + i * slice + j * row;
      if (constant) {
        std::fill(out, out + size[2], row_[0]);
        continue;
      }
      if (sheared) windows_from(y.x + i * step.row[0].x + j * step.row[0].y);
      for (int k = 0; k < size[2]; ++k)
        out[k] = (ConstRow(row_.data() + (along_[k].first - first[0])) * ConstRow(along_[k].weight))
                     .sum();
    }
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

void LatticeField::add_box(LatticeNoise& noise, const Vec3& x, double spacing,
                           const std::array<int, 3>& size, float* g) {
  const std::size_t count = static_cast<std::size_t>(size[0]) * size[1] * size[2];
  scratch_.resize(count);
  lattices_[0].box(noise, x, spacing, size, scratch_.data());
  if (lattices_.size() == 1) {
    for (std::size_t n = 0; n < count; ++n) g[n] += static_cast<float>(scale_ * scratch_[n]);
    return;
  }
  const auto add = [&](const auto& wave) {
    std::size_t n = 0;
    for (int i = 0; i < size[0]; ++i)
      for (int j = 0; j < size[1]; ++j)
        for (int k = 0; k < size[2]; ++k, ++n) {
          const double theta =
              dot(wave_vector_, x + Vec3{double(i), double(j), double(k)} * spacing);
          g[n] += static_cast<float>(scale_ * wave(theta) * scratch_[n]);
        }
  };
  add([](double theta) { return std::cos(theta); });
  lattices_[1].box(noise, x, spacing, size, scratch_.data());
  add([](double theta) { return std::sin(theta); });
}

double LatticeField::fourth_derivative_variance(const Vec3& d) const {
  const Vec3 whitened = whitening_ * d;
  return scale_ * scale_ * eighth_moment(dot(wave_vector_, d), dot(whitened, whitened));
}

}  // namespace gpis
