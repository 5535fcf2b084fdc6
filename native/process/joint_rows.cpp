#include "process/joint_rows.h"

namespace gpis {
namespace {

// Of variances ahead, relative: a row that lowers them by less in all is not worth keeping.
constexpr double kTelling = 1e-9;

}  // namespace

void JointRows::reset(const Covariance& covariance) {
  covariance_ = &covariance;
  base_ = 0;
  has_line_ = false;
  truncate(0);
}

void JointRows::reset(const JointRows& base) {
  covariance_ = base.covariance_;
  base_ = 0;
  has_line_ = false;
  rows_.assign(base.rows_.begin() + base.base_, base.rows_.end());
  for (Row& row : rows_) row.on_line = false;
  factor_ = base.factor_;
  xi_ = base.xi_;
  known_norm2_ = base.known_norm2_;
}

void JointRows::begin_line(const LineGeometry& line) {
  has_line_ = true;
  line_.reset(*covariance_, line);
  for (const Row& row : rows_) line_.add(nullptr, row.at, row.what);
}

void JointRows::truncate(int count) {
  const auto n = static_cast<std::size_t>(count);
  rows_.resize(n);
  xi_.resize(n);
  factor_.resize(n * (n + 1) / 2);
  if (has_line_) line_.truncate(count);
  known_norm2_ = 0;
  for (std::size_t i = 0; i < n; ++i)
    if (rows_[i].known) known_norm2_ += xi_[i] * xi_[i];
}

double JointRows::own(const LocalPoint& at, const Functional& what,
                      const LinePoint* on_line) const {
  if (what.value_only()) return what.value * what.value * covariance_->variance();
  if (on_line && line_.is_slope(what)) return line_.slope_variance(*on_line);
  return covariance_->between(at, what, at, what);
}

void JointRows::covariances(const LocalPoint& at, const Functional& what,
                            const LinePoint* on_line) {
  const int n = active();
  if (next_.size() < n) next_.resize(2 * n + 16);
  const bool value = on_line && line_.is_value(what), slope = on_line && line_.is_slope(what);
  if (value || slope) line_.covariances(*on_line, slope, base_, n, next_.data());
  for (int i = 0; i < n; ++i)
    if (!((value || slope) && row(i).on_line))
      next_[i] = covariance_->between(at, what, row(i).at, row(i).what);
}

double JointRows::border(const LocalPoint& at, const Functional& what, double own, double& mean,
                         const LinePoint* on_line) {
  covariances(at, what, on_line);
  const int n = active();
  double left = own;
  mean = 0;
  for (int i = 0; i < n; ++i) {
    next_[i] = (next_[i] - factor_row(i).dot(next_.head(i))) / diagonal(i);
    left -= next_[i] * next_[i];
    mean += next_[i] * xi_[i];
  }
  return left;
}

void JointRows::append(const Row& row, double pivot, double xi) {
  factor_.insert(factor_.end(), next_.data(), next_.data() + active());
  factor_.push_back(std::sqrt(pivot));
  xi_.push_back(xi);
  rows_.push_back(row);
  if (row.known) known_norm2_ += xi * xi;
}

JointRows::Known JointRows::add_known(const LocalPoint& at, const Functional& what, double value,
                                      double noise, Counters& counters, const LinePoint* on_line) {
  const double variance = own(at, what, on_line) + noise;
  double mean;
  const double pivot = border(at, what, variance, mean, on_line);
  const Known known{std::sqrt(variance), pivot / variance, value - mean};
  if (pivot > kPivot * variance) {
    append({at, what, value, noise, true, false, on_line != nullptr}, pivot,
           known.off / std::sqrt(pivot));
    if (has_line_) line_.add(on_line, at, what);
  } else {
    ++counters.pivots_dropped;
  }
  return known;
}

double JointRows::add_free(const LocalPoint& at, const Functional& what, Rng& rng,
                           Counters& counters, double jitter, const LinePoint* on_line,
                           double of_left) {
  const double variance = own(at, what, on_line);
  double mean;
  const double left = border(at, what, variance, mean, on_line);
  const double noise = jitter > 0 ? std::min(jitter * variance, of_left * std::max(0.0, left)) : 0;
  const double pivot = left + noise;
  if (!(pivot > (jitter > 0 ? kPivot : kDrawnPivot) * variance)) {
    ++counters.pivots_dropped;
    return mean;
  }
  const double xi = rng.normal(), value = mean + std::sqrt(pivot) * xi;
  ++counters.line_normals;
  append({at, what, value, noise, false, false, on_line != nullptr}, pivot, xi);
  if (has_line_) line_.add(on_line, at, what);
  return value;
}

// Rows are chosen one by one, each as the one that lowers the variances ahead most (relative to
// what they are), in units of the rows' independent parts behind those given.
JointRows::Kept JointRows::telling(int given, int most, const std::vector<Ahead>& ahead) {
  const int n = active() - given, m = static_cast<int>(ahead.size());
  // Row-major: products take the first entries of rows.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows(n, n);
  rows.setZero();
  for (int i = 0; i < n; ++i) {
    rows.row(i).head(i) = factor_row(given + i).tail(i).transpose();
    rows(i, i) = diagonal(given + i);
  }
  Eigen::MatrixXd them(m, n);
  for (int j = 0; j < m; ++j) {
    const Ahead& to = ahead[static_cast<std::size_t>(j)];
    const LinePoint* on_line = has_line_ ? &to.on_line : nullptr;
    const double variance = own(to.at, to.what, on_line);
    double mean;
    border(to.at, to.what, variance, mean, on_line);
    them.row(j) = next_.segment(given, n).transpose() / std::sqrt(variance);
  }
  const Eigen::VectorXd whole = rows.rowwise().squaredNorm();
  Eigen::VectorXd left = whole, of_best(n);
  Eigen::MatrixXd shared = rows * them.transpose();  // what is left of it, too
  Kept out;
  out.factor.resize(n, std::min(most, n));
  std::vector<bool> kept(static_cast<std::size_t>(n), false);
  for (int k = 0; k < out.factor.cols(); ++k) {
    int best = -1;
    double tells = kTelling;
    for (int i = 0; i < n; ++i) {
      if (kept[static_cast<std::size_t>(i)] || !(left[i] > least_pivot(row(given + i)) * whole[i]))
        continue;
      const double by = shared.row(i).squaredNorm() / left[i];
      if (by > tells) {
        best = i;
        tells = by;
      }
    }
    if (best < 0) break;
    kept[static_cast<std::size_t>(best)] = true;
    out.rows.push_back(best);
    of_best.noalias() = rows.leftCols(best + 1) * rows.row(best).head(best + 1).transpose();
    of_best.noalias() -= out.factor.leftCols(k) * out.factor.row(best).head(k).transpose();
    const double root = std::sqrt(left[best]);
    out.factor.col(k) = of_best / root;
    left -= out.factor.col(k).cwiseAbs2();
    const Eigen::RowVectorXd told = shared.row(best) / root;
    shared.noalias() -= out.factor.col(k) * told;
  }
  for (int i = 0; i < n; ++i)
    if (!kept[static_cast<std::size_t>(i)])
      out.lost = std::max(out.lost, shared.row(i).cwiseAbs().maxCoeff() / std::sqrt(whole[i]));
  return out;
}

// The rows kept come in the order in which they were chosen: as they were, given the same base.
double JointRows::rebase(const JointRows& base, int given, bool same, int most,
                         const std::vector<Ahead>& ahead) {
  const Kept kept = telling(given, most, ahead);
  const int first = base_ + given;
  base_ = count();
  const auto from = base.rows_.begin() + base.base_;
  rows_.insert(rows_.end(), from, base.rows_.end());
  for (auto row = rows_.begin() + base_; row != rows_.end(); ++row) {
    row->copied = true;
    row->on_line = false;
    if (has_line_) line_.add(nullptr, row->at, row->what);
  }
  const std::vector<double> before = std::move(factor_);
  factor_ = base.factor_;
  xi_ = base.xi_;
  // What is known pulls no less when drawn rows come before it.
  const double pulled = known_norm2_;
  known_norm2_ = base.known_norm2_;
  for (std::size_t k = 0; k < kept.rows.size(); ++k) {
    const int index = first + kept.rows[k];
    Row row = rows_[static_cast<std::size_t>(index)];
    row.copied = true;
    double mean = 0, pivot;
    if (same) {
      const auto i = static_cast<std::size_t>(given + kept.rows[k]);
      const double* of_base = before.data() + i * (i + 1) / 2;
      const int n = active();
      for (int j = 0; j < n; ++j) {
        next_[j] = j < given ? of_base[j] : kept.factor(kept.rows[k], j - given);
        mean += next_[j] * xi_[static_cast<std::size_t>(j)];
      }
      const double root = kept.factor(kept.rows[k], static_cast<Eigen::Index>(k));
      pivot = root * root;
    } else {
      LinePoint point;
      if (row.on_line) point = line_.point(index);
      const LinePoint* on_line = row.on_line ? &point : nullptr;
      const double variance = own(row.at, row.what, on_line) + row.noise;
      pivot = border(row.at, row.what, variance, mean, on_line);
      if (!(pivot > least_pivot(row) * variance)) continue;
    }
    append(row, pivot, (row.value - mean) / std::sqrt(pivot));
    if (has_line_) line_.add_copy(index);
  }
  known_norm2_ = std::max(pulled, known_norm2_);
  return kept.lost;
}

Eigen::VectorXd JointRows::whitened(const LocalPoint& at, const Functional& what) const {
  Eigen::VectorXd v(active());
  for (int i = 0; i < active(); ++i)
    v[i] = (covariance_->between(at, what, row(i).at, row(i).what) - factor_row(i).dot(v.head(i))) /
           diagonal(i);
  return v;
}

std::vector<double> JointRows::weights(std::vector<double> whitened) const {
  Eigen::Map<Eigen::VectorXd> w(whitened.data(), active());
  for (int i = active() - 1; i >= 0; --i) {
    w[i] /= diagonal(i);
    w.head(i) -= w[i] * factor_row(i);
  }
  return whitened;
}

std::vector<double> JointRows::whiten(const std::vector<double>& values) const {
  std::vector<double> out = values;
  Eigen::Map<Eigen::VectorXd> v(out.data(), active());
  for (int i = 0; i < active(); ++i) v[i] = (v[i] - factor_row(i).dot(v.head(i))) / diagonal(i);
  return out;
}

void JointRows::law(const LocalPoint& at, Eigen::Vector4d& mean,
                    Eigen::Matrix4d& covariance) const {
  Crosses crosses(4, active());
  for (int i = 0; i < active(); ++i)
    crosses.col(i) = covariance_->cross(at, row(i).at, row(i).what);
  law(std::move(crosses), at, mean, covariance);
}

void JointRows::law(const LocalPoint& at, const LinePoint& on_line, Eigen::Vector4d& mean,
                    Eigen::Matrix4d& covariance) {
  const LineRows::Gradient of_points = line_.gradient(on_line, at);
  Crosses crosses(4, active());
  for (int i = 0; i < active(); ++i) {
    Eigen::Vector4d c;
    if (!line_.cross(of_points, base_ + i, c)) c = covariance_->cross(at, row(i).at, row(i).what);
    crosses.col(i) = c;
  }
  law(std::move(crosses), at, mean, covariance);
}

void JointRows::law(Crosses v, const LocalPoint& at, Eigen::Vector4d& mean,
                    Eigen::Matrix4d& covariance) const {
  mean.setZero();
  covariance = covariance_->block(at, at);
  for (int i = 0; i < active(); ++i) {
    v.col(i) = (v.col(i) - v.leftCols(i) * factor_row(i)).eval() / diagonal(i);
    mean += v.col(i) * xi_[static_cast<std::size_t>(i)];
  }
  covariance -= v * v.transpose();
}

double JointRows::covariance_left(const LocalPoint& x, const LinePoint* x_on_line,
                                  const LocalPoint& y, const LinePoint* y_on_line) {
  double mean;
  border(x, {}, 0, mean, x_on_line);
  const Eigen::VectorXd of_x = next_.head(active());
  border(y, {}, 0, mean, y_on_line);
  return covariance_->value(x, y) - of_x.dot(next_.head(active()));
}

JointRows::Mean JointRows::mean() const {
  Mean out;
  out.first_row = base_;
  out.weights = weights(xi_);
  if (!has_line_) return out;
  line_.weigh(base_, out.weights, out.on_line);
  out.elsewhere = active() > 0 && !row(0).on_line;  // they come first
  return out;
}

void JointRows::evaluate(const Mean& mean, const LocalPoint& at, const Vec3& d, const SymMat3& da,
                         double& g, double& dg) const {
  g = dg = 0;
  const Row* row = rows_.data() + mean.first_row;
  for (const double weight : mean.weights) {
    double slope;
    g += weight * covariance_->along(at, d, da, row->at, row->what, slope);
    dg += weight * slope;
    ++row;
  }
}

}  // namespace gpis
