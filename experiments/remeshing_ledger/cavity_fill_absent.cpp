// Builds that found no TetGen.
#include "experiments/remeshing_ledger/cavity_fill.hpp"
#include "topology/base/errors.hpp"

namespace spherecut::experiments::ledger {

TetMesh fill_cavity(const CavityBorder& /*border*/) {
  throw NumericalError("cavities are filled by TetGen, which this build did not find (libtet1.5-dev)");
}

bool has_cavity_mesher() {
  return false;
}

} // namespace spherecut::experiments::ledger
