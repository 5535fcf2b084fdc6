// One ray through one process: its sample path, where it was sampled, and where it ended.
#pragma once

#include <memory>
#include <vector>

#include "process/path.h"
#include "process/surface.h"

namespace gpis {

struct Line::Impl {
  LineGeometry geometry;  // object space
  // What the path was drawn under: of -f for a ray that travels inside.
  const PlannedLine* plan = nullptr;
  bool inside = false;
  const std::atomic<bool>* stop = nullptr;
  bool near_conditions = false;  // drawn given conditions, where some lines are not

  // Where the sample path begins: the first uncertain t.
  double anchor = 0;
  // Stretches of t on which the path was sampled, in increasing order.
  struct Stretch {
    double begin, end;
    long last_cell;
  };
  std::vector<Stretch> stretches;

  // The hit, of f or -f: fields and g by the piece and cell of the arriving side, dg per t.
  double hit_t = kInfinity, hit_g = 0, hit_dg = 0;
  double hit_value = 0;  // f there, not 0 where a smooth union blends it with others
  FieldSample hit_mean, hit_sigma;

  // A leaf of a tree that sees the g of another leaf: that one's line holds the path.
  Impl* shared = nullptr;

  // The one instance of each kind of path, made when first used: a line serves objects of every
  // kind.
  template <class Path>
  Path& path() {
    const std::size_t i = kIndex<Path>;
    if (i >= paths_.size()) paths_.resize(i + 1);
    if (!paths_[i]) paths_[i] = std::make_unique<Slot<Path>>();
    return static_cast<Slot<Path>&>(*paths_[i]).path;
  }

 private:
  struct AnySlot {
    virtual ~AnySlot() = default;
  };
  template <class Path>
  struct Slot : AnySlot {
    Path path;
  };
  inline static std::size_t kinds_ = 0;
  template <class Path>
  inline static const std::size_t kIndex = kinds_++;

  std::vector<std::unique_ptr<AnySlot>> paths_;
};

}  // namespace gpis
