// The fields of an object while they are painted on: mean, deviation, squared length scales and
// albedo, from a .vdb file and into the next. What a file does not hold yet is made where it is
// first painted on: a constant, with leaves only under the brush.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/sym_mat3.h"
#include "field/brush.h"
#include "field/vdb_field.h"

namespace gpis {

// Where the fields come from.
struct PaintSource {
  std::string path;
  std::string mean = "mean";  // the name of its grid, which it keeps
  double sigma = 1;           // of the object, where there are no painted grids
  SymMat3 squared_lengths = SymMat3::identity();
  // A deviation that the file holds under another name: it becomes the painted one, times factor.
  std::string sigma_grid;
  GridMeaning sigma_meaning = GridMeaning::value;
  double sigma_factor = 1;
  bool anisotropy = false, albedo = false;  // whether those of the file are the object's
};

class PaintedFields {
 public:
  explicit PaintedFields(const PaintSource& source);
  ~PaintedFields();

  // The dabs, one after the other.
  PaintCounts apply(const Brush& brush, const std::vector<Dab>& dabs);
  // Adds nodes, whole leaves at a time, until the box holds this one. The mean goes on with its
  // nearest value and slope, the rest with its nearest value.
  void extend(const Box3& bounds);
  // As it was before it was painted on. The length scale keeps the shape of A, the anisotropy its
  // size.
  PaintCounts reset(Channel channel);
  // One half becomes the image of the other: that of positive coordinates if `from_positive`.
  PaintCounts mirror(Channel channel, int axis, bool from_positive);
  // The channel of another object, in the same coordinates. It is then what `reset` goes back to.
  PaintCounts copy(const PaintedFields& other, Channel channel);
  // All as it was before anything was painted, extended or mirrored.
  void restart();
  // Cubic voxels of another size, over the same box.
  void resample(double voxel_size);

  Box3 bounds() const;                       // of the nodes
  Vec3 voxel_size() const;                   // lengths of the edges
  std::int64_t memory() const;               // bytes of all grids and of what they were
  std::vector<std::string> painted() const;  // names of the grids that `write` adds to the mean

  // Trilinear values, as many numbers for each point as the channel has (1, 3, or 6 of A), and of
  // the length scale its size; constants where it is not painted yet.
  std::vector<double> values(Channel channel, const std::vector<Vec3>& points) const;
  // The first point of origin + t direction with mean 0, in 0 < t < t_max, from a positive value;
  // its t, infinity if there is none, and ∇μ there.
  std::pair<double, Vec3> first_surface(const Vec3& origin, const Vec3& direction,
                                        double t_max) const;

  // The grids, what they were before (named gpis_base_*), and what else the source held; `strokes`
  // (any bytes) stands in the file's metadata. Written beside `path` first and renamed.
  void write(const std::string& path, const std::string& strokes) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The strokes that `write` put into a file; empty where there are none.
std::string read_strokes(const std::string& path);

}  // namespace gpis
