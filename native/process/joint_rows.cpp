#include "process/joint_rows.h"

namespace gpis {

void JointRows::reset(const Covariance& covariance) {
  covariance_ = &covariance;
  base_ = 0;
  truncate(0);
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

double JointRows::add_known(const LocalPoint& at, const Functional& what, double value,
                            double noise, Counters& counters) {
  const double own = covariance_->between(at, what, at, what) + noise;
  double mean;
  const double pivot = border(at, what, own, mean);
  if (!(pivot > kPivot * own)) {
    ++counters.pivots_dropped;
    return 0;
  }
  const double xi = (value - mean) / std::sqrt(pivot);
  append({at, what, value, noise, true}, pivot, xi);
  return xi;
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

void JointRows::forget(int first, int last) {
  std::vector<Row> kept(rows_.begin(), rows_.begin() + first);
  kept.insert(kept.end(), rows_.end() - last, rows_.end());
  base_ = count();
  known_norm2_ = 0;
  factor_.clear();
  xi_.clear();
  for (const Row& row : kept) {
    const double own = covariance_->between(row.at, row.what, row.at, row.what) + row.noise;
    double mean;
    const double pivot = border(row.at, row.what, own, mean);
    if (pivot > (row.known ? kPivot : kDrawnPivot) * own)
      append(row, pivot, (row.value - mean) / std::sqrt(pivot));
  }
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
  Mean out{base_, xi_};
  Eigen::Map<Eigen::VectorXd> w(out.weights.data(), active());
  for (int i = active() - 1; i >= 0; --i) {
    w[i] /= diagonal(i);
    w.head(i) -= w[i] * factor_row(i);
  }
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
