#include "kernel/transformed_kernel.h"

#include "core/orthogonal_rows.h"

namespace gpis {

void TransformedKernel::transform(Term& term) const {
  term.whitening = orthogonal_rows(term.whitening * inverse_);
  term.wave_vector = transpose(inverse_) * term.wave_vector;
}

std::optional<std::vector<Term>> TransformedKernel::terms() const {
  auto terms = kernel_->terms();
  if (terms)
    for (Term& term : *terms) transform(term);
  return terms;
}

std::optional<std::vector<ProductTerm>> TransformedKernel::products() const {
  auto products = kernel_->products();
  if (products)
    for (ProductTerm& product : *products)
      for (Term& factor : product.factors) transform(factor);
  return products;
}

}  // namespace gpis
