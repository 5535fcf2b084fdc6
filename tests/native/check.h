// A minimal test runner: TEST(name) { CHECK(a, <, b); }. A failed check prints both expressions and
// values.
#pragma once

#include <cmath>
#include <iostream>
#include <vector>

#include "core/rng.h"
#include "core/warp.h"

namespace gpis::test {

struct Case {
  const char* name;
  void (*run)();
};
inline std::vector<Case>& cases() {
  static std::vector<Case> all;
  return all;
}
inline int& failures() {
  static int count = 0;
  return count;
}
// What is being checked, printed with a failure; set it in loops.
inline std::string& context() {
  static std::string text;
  return text;
}
struct Registration {
  Registration(const char* name, void (*run)()) { cases().push_back({name, run}); }
};

template <class A, class B>
void report(const char* file, int line, const char* expression, const A& a, const B& b) {
  ++failures();
  std::cout << file << ":" << line << ": " << expression << "\n    " << a << "  against  " << b
            << (context().empty() ? "" : "\n    in " + context()) << std::endl;
}

// Mean of independent samples and its standard error.
struct Mean {
  double sum = 0, squares = 0, n = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
    ++n;
  }
  double mean() const { return sum / n; }
  double error() const { return std::sqrt(std::max(0.0, squares / n - mean() * mean()) / (n - 1)); }
  // Standard errors from `expected`; deterministic samples may be off by rounding.
  double z(double expected) const {
    return (mean() - expected) / std::hypot(error(), 1e-9 * std::max(1.0, std::abs(expected)));
  }
  double z(const Mean& o) const {
    return (mean() - o.mean()) / std::hypot(error(), o.error(), 1e-9 * std::max(1.0, mean()));
  }
};

inline SquarePoint square_point(Rng& rng) {
  const double u = rng.uniform();
  return {u, rng.uniform()};
}

}  // namespace gpis::test

#define TEST(name)                                                        \
  static void name();                                                     \
  static const gpis::test::Registration registration_##name(#name, name); \
  static void name()

#define CHECK(a, op, b)                                                            \
  do {                                                                             \
    const auto value_a = (a);                                                      \
    const auto value_b = (b);                                                      \
    if (!(value_a op value_b))                                                     \
      gpis::test::report(__FILE__, __LINE__, #a " " #op " " #b, value_a, value_b); \
  } while (false)
