// A line sampler with all that was decided once per object: kinds of mean, deviation and path.
#pragma once

#include <memory>
#include <string>

#include "process/line_impl.h"
#include "process/line_noise.h"

namespace gpis {

class JointLine;
class Posterior;
struct PlannedLine;

class LineSampler {
 public:
  virtual ~LineSampler() = default;
  // Draws a new path and marches it: fills line.hit_* and returns the hit's t, or infinity.
  virtual double first_hit(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
                           const Start& start, Rng& rng, Counters& counters) const = 0;
  // On that path: g and its slope per t, where it was sampled.
  virtual void path_at(Line::Impl& line, double t, Rng& rng, double& g, double& dg) const = 0;
  virtual PathGradient gradient(Line::Impl& line, double t, double g, double dg,
                                Rng& rng) const = 0;
  // The path of a leaf of a tree, which marches all of its leaves itself.
  virtual std::unique_ptr<LineNoise> noise(Line::Impl& line) const = 0;
  // The path where it is drawn jointly with what else is known of g; null for other paths.
  virtual JointLine* joint(Line::Impl&) const { return nullptr; }
  // g given the conditions; null where there are none. How far they may hold its mean from 0.
  virtual std::shared_ptr<const Posterior> posterior() const { return nullptr; }
  virtual double condition_pull() const { return 0; }
  // Length scales of a line within which that bound holds.
  virtual double reach() const { return kInfinity; }
  // The share of the way across finite bounds for which it does.
  virtual double known_share() const { return 1; }
  // Bound on |implied - exact correlation| of the path.
  virtual double correlation_error() const = 0;
};

// One per path, in its own file. They throw a sentence where the path cannot serve the process.
std::unique_ptr<LineSampler> make_zero(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_convolution(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_markov(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_sum(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_ornstein_uhlenbeck(const GaussianProcess& process, const Box3&);
std::unique_ptr<LineSampler> make_spectral(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_dense(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_realisation(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_nystrom(const GaussianProcess& process, const Box3& bounds);
std::unique_ptr<LineSampler> make_joint_dense(const GaussianProcess& process, const Box3& bounds);
// The table of first passages, drawn by a path of that correlation error; the process it cannot
// serve, in words that follow "since", empty where it can.
std::unique_ptr<LineSampler> make_first_passage(const GaussianProcess& process, const Box3& bounds,
                                                double missed_root, double correlation_error);
std::string why_no_first_passage(const GaussianProcess& process, const Box3& bounds,
                                 double missed_root);

}  // namespace gpis
