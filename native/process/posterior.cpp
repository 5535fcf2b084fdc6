#include "process/posterior.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <numeric>

#include "field/check.h"
#include "process/conditions.h"

namespace gpis {
namespace {

// A region with fewer rows is not divided further; a block takes at most this many.
constexpr int kCoreRows = 48, kMostRows = 640;
constexpr int kProbes = 6;  // blocks whose truncation is measured

// Conditions whose others leave them less of their variance than this, and which lie this many
// deviations of what is left from what the others say, contradict them.
constexpr double kDetermined = 1e-6, kContradiction = 30;

}  // namespace

Posterior::Posterior(const GaussianProcess& process)
    : covariance_(std::make_shared<Covariance>(process)), conditions_(process, *covariance_) {
  shortest_ = process.kernel->min_length_scale();
  if (process.anisotropy) shortest_ *= std::sqrt(process.anisotropy->eigenvalues().min);
  if (!std::isfinite(shortest_)) shortest_ = 1;
  std::vector<int> all(conditions_.points());
  std::iota(all.begin(), all.end(), 0);
  divide(Box3::everywhere(), std::move(all));

  blocks_.resize(boxes_.size());
  tbb::parallel_for(std::size_t{0}, blocks_.size(), [&](std::size_t i) {
    blocks_[i] = solve(near(boxes_[i], 1, kMostRows));
    blocks_[i].mean = blocks_[i].rows.mean().weights;
  });
  for (const Block& block : blocks_) {
    pull_ = std::max(pull_, block.rows.known_norm());
    most_rows_ = std::max(most_rows_, block.rows.count());
  }
  const std::size_t stride = std::max<std::size_t>(1, blocks_.size() / kProbes);
  std::vector<double> error(blocks_.size(), 0);
  if (blocks_.size() > 1)
    tbb::parallel_for(std::size_t{0}, (blocks_.size() - 1) / stride + 1, [&](std::size_t i) {
      error[i] = truncation(boxes_[i * stride], static_cast<int>(i * stride));
    });
  truncation_error_ = *std::max_element(error.begin(), error.end());
}

// Regions are divided in their middle, by points, along the axis of their largest extent.
int Posterior::divide(const Box3& region, std::vector<int> points) {
  const auto rows_of = [&](const std::vector<int>& list) {
    int rows = 0;
    for (const int i : list) rows += conditions_.last_row(i) - conditions_.first_row(i);
    return rows;
  };
  const int index = static_cast<int>(regions_.size());
  regions_.push_back({});
  const auto serve = [&] {
    regions_[index].block = static_cast<int>(boxes_.size());
    boxes_.push_back(region);
    return index;
  };
  if (rows_of(points) <= kCoreRows) return serve();
  Box3 box;
  for (const int i : points) box.include(conditions_.point(i));
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (box.max[k] - box.min[k] > box.max[axis] - box.min[axis]) axis = k;
  const auto middle = points.begin() + points.size() / 2;
  std::nth_element(points.begin(), middle, points.end(), [&](int a, int b) {
    return conditions_.point(a)[axis] < conditions_.point(b)[axis];
  });
  const double at = conditions_.point(*middle)[axis];
  Box3 below = region, above = region;
  below.max[axis] = above.min[axis] = at;
  if (!(box.min[axis] < at)) return serve();  // many points in one place
  // Points closer than the kernel reaches: all parts would hold them all.
  const int rows = rows_of(near(region, 1, kMostRows));
  if (rows < kMostRows &&
      std::max(rows_of(near(below, 1, kMostRows)), rows_of(near(above, 1, kMostRows))) > 0.9 * rows)
    return serve();
  Region divided;
  divided.axis = axis;
  divided.at = at;
  divided.half_width = 0.25 * shortest_;
  divided.below = divide(below, {points.begin(), middle});
  divided.above = divide(above, {middle, points.end()});
  regions_[index] = divided;
  return index;
}

std::vector<int> Posterior::near(const Box3& region, double reach, int most_rows) const {
  Box3 box = region;  // and where it is blended with its neighbours
  const Vec3 blend = Vec3{1, 1, 1} * (0.25 * shortest_);
  box.min = box.min - blend;
  box.max = box.max + blend;
  std::vector<std::pair<double, int>> found;
  for (int i = 0; i < conditions_.points(); ++i) {
    if (conditions_.distance_at_least(conditions_.point(i), box) > reach) continue;
    const double distance = conditions_.distance(conditions_.point(i), box);
    if (distance <= reach) found.emplace_back(distance, i);
  }
  std::sort(found.begin(), found.end());
  std::vector<int> points;
  int rows = 0;
  for (const auto& [distance, i] : found) {
    rows += conditions_.last_row(i) - conditions_.first_row(i);
    if (rows > most_rows && distance > 0) break;
    points.push_back(i);
  }
  return points;
}

// The rows in the order of what each tells beside those before (Cholesky with pivoting): where some
// are determined by others, those that are kept then span all of them, and nothing is extrapolated.
void Posterior::order_by_what_is_left(std::vector<int>& order) const {
  const auto n = static_cast<Eigen::Index>(order.size());
  const auto row = [&](Eigen::Index i) -> const ConditionRows::Row& {
    return conditions_.rows()[order[i]];
  };
  const auto between = [&](Eigen::Index i, Eigen::Index j) {
    return covariance_->between(row(i).at, row(i).what, row(j).at, row(j).what);
  };
  Eigen::MatrixXd factor(n, n);
  Eigen::VectorXd variance(n), left(n), share(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    left[i] = variance[i] = between(i, i) + row(i).noise;
    share[i] = variance[i] > 0;  // none of a slope along which g is constant
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index next;
    share.tail(n - k).maxCoeff(&next);
    next += k;
    if (!(share[next] > JointRows::kPivot)) {
      std::sort(order.begin() + k, order.end());
      return;
    }
    std::swap(order[k], order[next]);
    std::swap(left[k], left[next]);
    std::swap(variance[k], variance[next]);
    std::swap(share[k], share[next]);
    factor.row(k).head(k).swap(factor.row(next).head(k));
    const double pivot = std::sqrt(left[k]);
    for (Eigen::Index i = k + 1; i < n; ++i) {
      factor(i, k) = (between(i, k) - factor.row(i).head(k).dot(factor.row(k).head(k))) / pivot;
      left[i] -= factor(i, k) * factor(i, k);
      if (variance[i] > 0) share[i] = left[i] / variance[i];
    }
  }
}

Posterior::Block Posterior::solve(const std::vector<int>& points) const {
  std::vector<int> order;
  for (const int i : points)
    for (int r = conditions_.first_row(i); r < conditions_.last_row(i); ++r) order.push_back(r);
  Block block;
  if (add(order, false, block)) return block;
  order_by_what_is_left(order);
  add(order, true, block);
  return block;
}

// False where the order is not `sorted` and matters: others all but determine a row.
bool Posterior::add(const std::vector<int>& order, bool sorted, Block& block) const {
  block.rows.reset(*covariance_);
  block.conditions.clear();
  Counters counters;
  for (const int r : order) {
    const ConditionRows::Row& row = conditions_.rows()[r];
    const JointRows::Known known =
        block.rows.add_known(row.at, row.what, row.value, row.noise, counters);
    if (known.left <= kDetermined && !sorted) return false;
    const double deviation = known.deviation * std::sqrt(std::max(known.left, JointRows::kPivot));
    if (known.left <= kDetermined && !(std::abs(known.off) < kContradiction * deviation))
      refuse_contradiction(row, known, block);
    if (block.rows.count() > static_cast<int>(block.conditions.size()))
      block.conditions.push_back(r);
  }
  return true;
}

// Names the condition among those before that is closest by its correlation.
void Posterior::refuse_contradiction(const ConditionRows::Row& row, const JointRows::Known& known,
                                     const Block& block) const {
  int other = row.point;
  double closest = -1;
  for (const int k : block.conditions) {
    const ConditionRows::Row& before = conditions_.rows()[k];
    const double c = std::abs(covariance_->value(row.at, before.at));
    if (before.point != row.point && c > closest) {
      other = before.point;
      closest = c;
    }
  }
  refuse("conditions.points[", row.point, "] at ", row.at.x, " and conditions.points[", other,
         "] at ", conditions_.point(other),
         " contradict each other: with this kernel, what is known around the first leaves it "
         "a standard deviation of ",
         known.deviation * std::sqrt(std::max(known.left, 0.0)), ", and it is ",
         std::abs(known.off),
         " away. Remove one, move them apart, or give their values some noise.");
}

int Posterior::block(const Vec3& x) const {
  int i = 0;
  while (regions_[i].block < 0)
    i = x[regions_[i].axis] < regions_[i].at ? regions_[i].below : regions_[i].above;
  return regions_[i].block;
}

Eigen::Vector4d Posterior::sum(int block, const std::vector<double>& weights,
                               const LocalPoint& at) const {
  const JointRows& rows = blocks_[block].rows;
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (int i = 0; i < rows.active(); ++i)
    sum += weights[i] * covariance_->cross(at, rows.point(i), rows.functional(i));
  return sum;
}

void Posterior::law(const LocalPoint& at, Eigen::Vector4d& mean,
                    Eigen::Matrix4d& covariance) const {
  Eigen::Vector4d unused;
  rows(block(at.x)).law(at, unused, covariance);
  mean.setZero();
  blend(at.x, [&](int block, double weight, const Vec3& slope) {
    const Eigen::Vector4d part = sum(block, blocks_[block].mean, at);
    mean += weight * part;
    for (int i = 0; i < 3; ++i) mean[1 + i] += slope[i] * part[0];
  });
}

// At the points of the block and half a length scale beside them.
double Posterior::truncation(const Box3& region, int block) const {
  const JointRows& here = rows(block);
  const std::vector<int> more = near(region, 1.5, 2 * std::max(here.count(), kCoreRows));
  const JointRows whole = solve(more).rows;
  double error = 0;
  int probes = 0;
  for (const int i : more) {
    const Vec3& p = conditions_.point(i);
    const Vec3 beside = p + normalize(Vec3{1, 0.5, -0.7}) * (0.5 * shortest_);
    for (const Vec3& x : {p, beside}) {
      if (this->block(x) != block) continue;
      const LocalPoint at = covariance_->at(x);
      Eigen::Vector4d mean[2];
      Eigen::Matrix4d law[2];
      here.law(at, mean[0], law[0]);
      whole.law(at, mean[1], law[1]);
      const auto deviation = [&](int k) { return std::sqrt(std::max(0.0, law[k](0, 0))); };
      error = std::max(
          {error, std::abs(mean[0][0] - mean[1][0]), std::abs(deviation(0) - deviation(1))});
      ++probes;
    }
    if (probes >= 16) break;
  }
  return error;
}

PosteriorPtr posterior_of(const GaussianProcess& process) {
  if (!process.conditions) return nullptr;
  const Conditions& conditions = *process.conditions;
  const std::lock_guard lock(conditions.mutex);
  for (const Conditions::Solved& s : conditions.solved)
    if (s.process->mean == process.mean && s.process->sigma == process.sigma &&
        s.process->kernel == process.kernel && s.process->anisotropy == process.anisotropy)
      return s.posterior;
  // A thread that waits for its blocks must not take other work that asks for this lock.
  PosteriorPtr posterior;
  tbb::this_task_arena::isolate([&] { posterior = std::make_shared<const Posterior>(process); });
  // Without a way back to the conditions: they would keep themselves.
  auto key = std::make_shared<GaussianProcess>(process);
  key->conditions = nullptr;
  conditions.solved.push_back({std::move(key), posterior});
  return posterior;
}

}  // namespace gpis
