// What the joint samplers share (math.md §5.4, §5.5): a line whose g is drawn from the covariance
// of given points, given what is known at its anchor, with the gradient from the same rows. It
// serves every kernel and tensor field, at the price of a factorisation per line.
#pragma once

#include "process/gaussian_process.h"
#include "process/joint_rows.h"
#include "process/path.h"
#include "process/posterior.h"
#include "process/segment_memory.h"

namespace gpis {

class JointLine {
 public:
  struct Plan {
    // Refuses a kernel without gradient.
    explicit Plan(const GaussianProcess& process);
    Covariance covariance;
    PosteriorPtr posterior;  // null: no conditions
    double correlation_error = 0;
    // How far conditions may hold the mean of g from 0.
    double pull() const { return posterior ? posterior->pull() : 0; }
  };

  // The lines from here on are drawn given these segments too, null: none. `sign` -1: the ray sees
  // -g of them.
  void recall(const SegmentMemory* segments, double sign) {
    segments_ = segments;
    sign_ = sign;
  }
  // Appends what the line met of g up to t.
  void record(double t, std::vector<SegmentMemory::Row>& rows) const;

  double value_mean() const { return anchor_mean_[0]; }
  double value_deviation() const;
  void slope_law(double g0, double& mean, double& deviation) const;
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double t) const { return pull_ + (t < pull_end_ ? rows_.known_norm() : 0); }
  PathGradient gradient(double t, double g, double dg, Rng&);

 protected:
  // More rows of the line itself than these are not kept in one factor: new ones are then drawn
  // given those kKept that tell most about them.
  static constexpr int kMostRows = 340, kKept = 240;

  void begin(const Plan& plan, const LineGeometry& line, double anchor, Counters& counters);
  LocalPoint point(double t) const { return covariance_->at(line_.origin + line_.direction * t); }
  SymMat3 along(const LocalPoint& p) const {  // ∂_d A
    return p.da[0] * line_.direction.x + p.da[1] * line_.direction.y + p.da[2] * line_.direction.z;
  }
  // To be called before rows at t and behind it are drawn: forgets the oldest ones, goes on to the
  // conditions that matter there. Whether it will.
  bool forgets(double t) const;
  void reach(double t, Counters& counters);
  // Nothing is known of g but on the line itself.
  bool alone() const { return !posterior_ && !segments_; }
  Functional value_row() const { return {}; }
  Functional slope_row() const { return {0, line_.direction}; }
  // Shortest length scale near the anchor, but for the changes of A, which may be sudden.
  double near_length(double t_end) const;
  // The largest correlation with what comes that was forgotten on this line.
  double lost() const { return lost_; }
  // The anchor among the points of the line; null unless lengths vary.
  const LinePoint* line_anchor() const { return rows_.has_line() ? &on_line_at_anchor_ : nullptr; }

  const Covariance* covariance_ = nullptr;
  LineGeometry line_;
  double anchor_ = 0;
  LocalPoint at_anchor_;
  JointRows rows_;

 private:
  // Starts base_ with the conditions of a block and the segments.
  void begin_base(int block, Counters& counters);
  // Values and slopes from t on, for as far as lengths reach.
  std::vector<JointRows::Ahead> ahead(double t) const;

  JointRows base_;  // never forgotten; the line's own rows come after them
  int lasting_rows_ = 0;
  bool base_has_segments_ = false, rebased_ = false;
  PosteriorPtr posterior_;
  int block_ = -1;
  double lost_ = 0;
  const SegmentMemory* segments_ = nullptr;
  double sign_ = 1, pull_ = 0;
  LinePoint on_line_at_anchor_;
  Eigen::Vector4d anchor_mean_;
  Eigen::Matrix4d anchor_law_;  // of (g, ∇g)
  double pull_end_ = 0;
};

}  // namespace gpis
