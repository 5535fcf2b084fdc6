#include "process/zero_path.h"

#include "process/march_sampler.h"

namespace gpis {

std::unique_ptr<LineSampler> make_zero(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<ZeroPath, Fields::by_type>(process, bounds);
}

}  // namespace gpis
