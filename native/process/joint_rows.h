// Linear functionals of g, drawn or known jointly: one row of a Cholesky factor each, added one
// after the other (math.md §3, §5.4). A row that the ones before it determine is left out.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/counters.h"
#include "core/rng.h"
#include "process/line_rows.h"

namespace gpis {

class JointRows {
 public:
  // A row is left out where the rows before leave it less variance than this, relative to its own:
  // known ones (definitions B11), and drawn ones. Rounding reaches the variance left to later rows
  // multiplied by the square of weights that grow as 1/√pivot: rows come in the order of the line
  // and not of their pivots, so drawn ones, which nobody misses, are left out earlier. At 1e-7
  // covariances behind a sudden change of lengths were off by 100 on some lines, and those of waves
  // much shorter than the lengths beside them by .5. What is left out is a kink of the path, of its
  // root in slope deviations.
  static constexpr double kPivot = 1e-10, kDrawnPivot = 1e-5;

  void reset(const Covariance& covariance);
  // Starts with the rows of another: solved once, used by many.
  void reset(const JointRows& base);
  // Rows from now on may lie on this line, where covariances cost less (under an anisotropy alone);
  // those there are lie elsewhere.
  void begin_line(const LineGeometry& line);
  bool has_line() const { return has_line_; }
  const LineRows& line() const { return line_; }
  // Forgets all rows but the first `count`.
  void truncate(int count);
  int count() const { return static_cast<int>(rows_.size()); }
  // Rows that new ones are drawn given: all, or those since `forget`.
  int active() const { return count() - base_; }

  // What the rows before it say of a known value.
  struct Known {
    double deviation;  // its prior one
    double left;       // share of its variance that they leave
    double off;        // how far it lies from what they say
  };
  // A functional with a known value (known but for noise of this variance). `on_line`: the same
  // point as one of the line; null: elsewhere.
  Known add_known(const LocalPoint& at, const Functional& what, double value, double noise,
                  Counters& counters, const LinePoint* on_line = nullptr);
  // A functional drawn given the rows before it, with independent noise of `jitter` times its own
  // variance, at most `of_left` times what the rows before leave of that; its value.
  double add_free(const LocalPoint& at, const Functional& what, Rng& rng, Counters& counters,
                  double jitter = 0, const LinePoint* on_line = nullptr,
                  double of_left = kInfinity);
  // From now on rows are drawn given those of `base` and at most `most` of the active rows alone:
  // those that tell most about what lies `ahead`. The largest correlation with any of that which
  // the others still have, given what is kept. The first `given` of the active rows are those of a
  // base, of this one where it is the `same`.
  struct Ahead {
    LocalPoint at;
    LinePoint on_line;  // where rows may lie on a line
    Functional what;
  };
  double rebase(const JointRows& base, int given, bool same, int most,
                const std::vector<Ahead>& ahead);

  // Law of (g, ∇g) at a point, given the active rows; `on_line` as above.
  void law(const LocalPoint& at, Eigen::Vector4d& mean, Eigen::Matrix4d& covariance) const;
  void law(const LocalPoint& at, const LinePoint& on_line, Eigen::Vector4d& mean,
           Eigen::Matrix4d& covariance);
  // Covariance that they leave to the values at two points; null: elsewhere than on the line.
  double covariance_left(const LocalPoint& x, const LinePoint* x_on_line, const LocalPoint& y,
                         const LinePoint* y_on_line);

  // A functional in units of the active rows' independent parts: its covariance with what they
  // leave of another is the prior's less the product of both; its mean is the product with
  // `whitened`.
  Eigen::VectorXd whitened(const LocalPoint& at, const Functional& what) const;
  Eigen::Map<const Eigen::VectorXd> whitened() const { return {xi_.data(), active()}; }
  // Solves for the weights of active rows: those of `mean` from other whitened values.
  std::vector<double> weights(std::vector<double> whitened) const;
  // Whitened values of the active rows had their values been these.
  std::vector<double> whiten(const std::vector<double>& values) const;

  // Rows of g that this line met first, in order; not those it was told to start with.
  template <class Visit>
  void visit_own(int first, const Visit& visit) const {
    for (std::size_t i = first; i < rows_.size(); ++i)
      if (!rows_[i].copied) visit(rows_[i].at.x, rows_[i].what, rows_[i].value, rows_[i].noise);
  }

  // Of active row i, for those who sum over rows.
  const LocalPoint& point(int i) const { return row(i).at; }
  const Functional& functional(int i) const { return row(i).what; }
  double value(int i) const { return row(i).value; }
  double noise(int i) const { return row(i).noise; }

  // The mean of g given the active rows is Σ weight · cov(g, row). Later rows leave it as it is.
  struct Mean {
    int first_row = 0;
    std::vector<double> weights;
    LineRows::Weights on_line;  // the same of rows on the line
    bool elsewhere = true;      // some rows are not on it
  };
  Mean mean() const;
  // That mean and its slope along d; `da` is ∂_d A.
  void evaluate(const Mean& mean, const LocalPoint& at, const Vec3& d, const SymMat3& da, double& g,
                double& dg) const;
  // The same of rows that are all on the line.
  void evaluate(const Mean& mean, const LinePoint& at, double& g, double& dg) {
    g = dg = 0;
    line_.sum(at, mean.on_line, g, dg);
  }

  // Norm, in the space of the kernel, of the mean that the known rows make: it exceeds the mean
  // anywhere, in units of the deviation of g.
  double known_norm() const { return std::sqrt(known_norm2_); }

 private:
  struct Row {
    LocalPoint at;
    Functional what;
    double value, noise;
    bool known;
    bool copied = false;  // from a base, or kept when others were forgotten
    bool on_line = false;
  };
  // Noise keeps rows apart.
  static double least_pivot(const Row& row) {
    return row.known || row.noise > 0 ? kPivot : kDrawnPivot;
  }
  using FactorRow = Eigen::Map<const Eigen::VectorXd>;

  // Row i of the factor, of the active rows: i entries and its diagonal.
  FactorRow factor_row(int i) const {
    return {factor_.data() + static_cast<std::size_t>(i) * (i + 1) / 2, i};
  }
  double diagonal(int i) const {
    return factor_[static_cast<std::size_t>(i) * (i + 1) / 2 + static_cast<std::size_t>(i)];
  }
  const Row& row(int i) const { return rows_[static_cast<std::size_t>(base_ + i)]; }
  // Fills next_ with the row's entries of the factor: the mean that the rows before it leave to it,
  // and the variance.
  double border(const LocalPoint& at, const Functional& what, double own, double& mean,
                const LinePoint* on_line);
  using Crosses = Eigen::Matrix<double, 4, Eigen::Dynamic>;  // of (g, ∇g) with the active rows
  void law(Crosses crosses, const LocalPoint& at, Eigen::Vector4d& mean,
           Eigen::Matrix4d& covariance) const;
  // Covariances with the active rows, into next_.
  void covariances(const LocalPoint& at, const Functional& what, const LinePoint* on_line);
  double own(const LocalPoint& at, const Functional& what, const LinePoint* on_line) const;
  void append(const Row& row, double pivot, double xi);
  // Which of the active rows behind the first `given` to keep, in the order of what they tell, the
  // factor of all by them, and see rebase.
  struct Kept {
    std::vector<int> rows;
    Eigen::MatrixXd factor;
    double lost = 0;
  };
  Kept telling(int given, int most, const std::vector<Ahead>& ahead);

  const Covariance* covariance_ = nullptr;
  std::vector<Row> rows_;
  int base_ = 0;
  std::vector<double> factor_;  // packed lower triangle, row by row
  std::vector<double> xi_;      // whitened values
  Eigen::VectorXd next_;
  LineRows line_;  // its rows are those of rows_
  bool has_line_ = false;
  double known_norm2_ = 0;
};

}  // namespace gpis
