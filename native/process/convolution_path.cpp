#include "process/convolution_path.h"

#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

Term squared_exponential(const GaussianProcess& process) {
  const Term term = single_term(process, "The convolution sampler");
  if (term.radial.family != Radial::Family::squared_exponential)
    refuse("The convolution sampler serves the squared exponential, not ",
           process.kernel->describe(), ": take sampler 'auto'.");
  return term;
}

}  // namespace

ConvolutionPath::Plan::Plan(const GaussianProcess& process, const Box3&)
    : line(squared_exponential(process)) {}

std::unique_ptr<LineSampler> make_convolution(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<ConvolutionPath, Fields::by_type>(process, bounds);
}

}  // namespace gpis
