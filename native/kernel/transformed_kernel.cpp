#include "kernel/transformed_kernel.h"

#include "core/orthogonal_rows.h"

namespace gpis {
std::optional<std::vector<Term>> TransformedKernel::terms() const {
  auto terms = kernel_->terms();
  if (terms)
    for (Term& term : *terms) {
      term.whitening = orthogonal_rows(term.whitening * inverse_);
      term.wave_vector = transpose(inverse_) * term.wave_vector;
    }
  return terms;
}

}  // namespace gpis
