// The model: f = mean + sigma·g, g a zero-mean Gaussian process; f > 0 outside, the
// surface is f = 0 (math.md §1-2).
#pragma once

#include <memory>
#include <optional>

#include "field/tensor_field.h"
#include "kernel/kernel.h"

namespace gpis {

struct Conditions;

struct GaussianProcess {
  FieldPtr mean;
  FieldPtr sigma;  // standard deviation, never variance
  KernelPtr kernel;
  // Squared length scales A(x), null where the kernel is stationary: its own length is then a
  // factor on them.
  TensorFieldPtr anisotropy;
  std::optional<Box3> bounds;  // outside there is no surface
  // Now, in temporal length scales: realisations of one seed at two times are correlated as
  // exp(-Δ²/2). None: the process does not change with time.
  std::optional<double> time;
  std::shared_ptr<const Conditions> conditions;  // what is known of f; null: nothing
};

// What a ray that leaves a surface point remembers of the process (definitions B1-B4, B11);
// `segments`: g on the last few segments of the path too (global-n); `global`: a path sees one
// realisation.
struct Memory {
  enum Kind { none, renewal, renewal_plus, segments, global };
  static constexpr int kMostSegments = 64;

  constexpr Memory(Kind k = renewal_plus, int n = 0) : kind(k), count(n) {}
  constexpr operator Kind() const { return kind; }

  Kind kind;
  int count;  // of segments
};
enum class Sampler {
  automatic,
  convolution,
  markov,
  spectral,
  nystrom,
  dense,
  realisation,
  first_passage,
};

}  // namespace gpis
