// Stands for the enriched back end where GetFEM is not installed.
#include "experiments/remeshing_ledger/back_end.hpp"

namespace spherecut::experiments::ledger {

bool has_xfem() {
  return false;
}

std::unique_ptr<BackEnd> make_xfem(const Scenario&, const Resolution&, Element, double) {
  return nullptr;
}

} // namespace spherecut::experiments::ledger
