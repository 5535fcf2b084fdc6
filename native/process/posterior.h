// g given the conditions (math.md §3). Thousands of points are solved in blocks: space is divided
// by planes into regions of few rows each, and a region is solved with the rows in it and those
// near enough to matter. Solved once, before the first ray; across a dividing plane neighbours are
// blended over a short way, so that the mean is smooth.
#pragma once

#include "process/condition_rows.h"
#include "process/joint_rows.h"

namespace gpis {

class Posterior {
 public:
  // Throws a sentence that names the points where conditions contradict each other.
  explicit Posterior(const GaussianProcess& process);

  const ConditionRows& conditions() const { return conditions_; }
  const Covariance& covariance() const { return *covariance_; }
  int blocks() const { return static_cast<int>(blocks_.size()); }
  // The block that serves a point; its rows.
  int block(const Vec3& x) const;
  const JointRows& rows(int block) const { return blocks_[block].rows; }
  // Which of the conditions' rows a row of the block is.
  int condition(int block, int row) const { return blocks_[block].conditions[row]; }

  // Calls visit(block, weight, ∇weight) for all blocks that meet at x; weights sum to 1.
  template <class Visit>
  void blend(const Vec3& x, const Visit& visit) const {
    blend(0, x, 1, {}, visit);
  }

  // Σ weight · covariance of (g, ∇g) with the rows of a block.
  Eigen::Vector4d sum(int block, const std::vector<double>& weights, const LocalPoint& at) const;
  // Law of (g, ∇g).
  void law(const LocalPoint& at, Eigen::Vector4d& mean, Eigen::Matrix4d& covariance) const;
  // How far the conditions may hold the mean of g from 0 anywhere.
  double pull() const { return pull_; }
  // Rows of the largest block.
  int most_rows() const { return most_rows_; }
  // Largest difference found in mean and standard deviation of g, where blocks of twice as many
  // rows and reach were solved for comparison.
  double truncation_error() const { return truncation_error_; }

 private:
  struct Block {
    JointRows rows;
    std::vector<int> conditions;  // by row
    std::vector<double> mean;     // weights of the rows
  };
  struct Region {  // divided by a plane, or served by a block
    int axis = 0;
    double at = 0, half_width = 0;
    int below = -1, above = -1, block = -1;
  };

  int divide(const Box3& region, std::vector<int> points);
  // Points near a region, the nearest first.
  std::vector<int> near(const Box3& region, double reach, int most_rows) const;
  Block solve(const std::vector<int>& points) const;
  bool add(const std::vector<int>& order, bool sorted, Block& block) const;
  void order_by_what_is_left(std::vector<int>& order) const;
  void refuse_contradiction(const ConditionRows::Row& row, const JointRows::Known& known,
                            const Block& block) const;
  double truncation(const Box3& region, int block) const;

  template <class Visit>
  void blend(int region, const Vec3& x, double weight, const Vec3& slope,
             const Visit& visit) const {
    const Region& r = regions_[region];
    if (r.block >= 0) return visit(r.block, weight, slope);
    const double s = (x[r.axis] - r.at) / r.half_width;
    if (s <= -1) return blend(r.below, x, weight, slope, visit);
    if (s >= 1) return blend(r.above, x, weight, slope, visit);
    // The smooth step 3u² - 2u³, u = (1 + s)/2.
    const double u = 0.5 * (1 + s), up = u * u * (3 - 2 * u);
    Vec3 up_slope;
    up_slope[r.axis] = 3 * u * (1 - u) / r.half_width;
    blend(r.below, x, weight * (1 - up), slope * (1 - up) - up_slope * weight, visit);
    blend(r.above, x, weight * up, slope * up + up_slope * weight, visit);
  }

  std::shared_ptr<const Covariance> covariance_;
  ConditionRows conditions_;
  double shortest_;  // length scale
  std::vector<Region> regions_;
  std::vector<Box3> boxes_;  // of blocks, while they are made
  std::vector<Block> blocks_;
  double pull_ = 0, truncation_error_ = 0;
  int most_rows_ = 0;
};

using PosteriorPtr = std::shared_ptr<const Posterior>;
// Null where the process has no conditions.
PosteriorPtr posterior_of(const GaussianProcess& process);

}  // namespace gpis
