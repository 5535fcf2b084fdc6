#include "process/joint_rows.h"

namespace gpis {

void JointRows::reset(const Covariance& covariance) {
  covariance_ = &covariance;
  base_ = 0;
  truncate(0);
}

void JointRows::reset(const JointRows& base) {
  covariance_ = base.covariance_;
  base_ = 0;
  rows_.assign(base.rows_.begin() + base.base_, base.rows_.end());
  factor_ = base.factor_;
  xi_ = base.xi_;
  known_norm2_ = base.known_norm2_;
}

void JointRows::truncate(int count) {
  const auto n = static_cast<std::size_t>(count);
  rows_.resize(n);
  xi_.resize(n);
  factor_.resize(n * (n + 1) / 2);
  known_norm2_ = 0;
  for (std::size_t i = 0; i < n; ++i)
    if (rows_[i].known) known_norm2_ += xi_[i] * xi_[i];
}

double JointRows::border(const LocalPoint& at, const Functional& what, double own, double& mean) {
  const int n = active();
  if (next_.size() < n) next_.resize(2 * n + 16);
  double left = own;
  mean = 0;
  for (int i = 0; i < n; ++i) {
    const double c = covariance_->between(at, what, row(i).at, row(i).what);
    next_[i] = (c - factor_row(i).dot(next_.head(i))) / diagonal(i);
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
                                      double noise, Counters& counters) {
  const double own = covariance_->between(at, what, at, what) + noise;
  double mean;
  const double pivot = border(at, what, own, mean);
  const Known known{std::sqrt(own), pivot / own, value - mean};
  if (pivot > kPivot * own)
    append({at, what, value, noise, true}, pivot, known.off / std::sqrt(pivot));
  else
    ++counters.pivots_dropped;
  return known;
}

double JointRows::add_free(const LocalPoint& at, const Functional& what, Rng& rng,
                           Counters& counters, double jitter) {
  const double own = (1 + jitter) * covariance_->between(at, what, at, what);
  double mean;
  const double pivot = border(at, what, own, mean);
  if (!(pivot > kDrawnPivot * own)) {
    ++counters.pivots_dropped;
    return mean;
  }
  const double xi = rng.normal(), value = mean + std::sqrt(pivot) * xi;
  ++counters.line_normals;
  append({at, what, value, own * jitter / (1 + jitter), false}, pivot, xi);
  return value;
}

void JointRows::rebase(const JointRows& base, int last) {
  std::vector<Row> kept(rows_.end() - last, rows_.end());
  base_ = count();
  const auto from = base.rows_.begin() + base.base_;
  rows_.insert(rows_.end(), from, base.rows_.end());
  for (auto row = rows_.begin() + base_; row != rows_.end(); ++row) row->copied = true;
  factor_ = base.factor_;
  xi_ = base.xi_;
  known_norm2_ = base.known_norm2_;
  for (Row& row : kept) {
    row.copied = true;
    const double own = covariance_->between(row.at, row.what, row.at, row.what) + row.noise;
    double mean;
    const double pivot = border(row.at, row.what, own, mean);
    if (pivot > (row.known ? kPivot : kDrawnPivot) * own)
      append(row, pivot, (row.value - mean) / std::sqrt(pivot));
  }
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
  const int n = active();
  Eigen::Matrix<double, 4, Eigen::Dynamic> v(4, n);
  mean.setZero();
  covariance = covariance_->block(at, at);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector4d c = covariance_->cross(at, row(i).at, row(i).what);
    v.col(i) = (c - v.leftCols(i) * factor_row(i)) / diagonal(i);
    mean += v.col(i) * xi_[static_cast<std::size_t>(i)];
  }
  covariance -= v * v.transpose();
}

JointRows::Mean JointRows::mean() const {
  return {base_, weights(xi_)};
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
