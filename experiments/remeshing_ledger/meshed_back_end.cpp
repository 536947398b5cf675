#include "experiments/remeshing_ledger/meshed_back_end.hpp"

#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/own_process.hpp"

namespace spherecut::experiments::ledger {

Grading MeshedBackEnd::grading(double share) const {
  return {share * resolution_.fine, resolution_.slope, share * resolution_.coarse_over_fine * resolution_.fine,
          front_of(scenario_, number_).points};
}

TetMesh MeshedBackEnd::mesh_organ(Increment& increment, double share) const {
  increment.number = number_;
  increment.anew = true;
  MeshRequest request;
  {
    const StageClock clock(increment.times, Stage::topology);
    request = mesh_request(scenario_, number_, grading(share));
  }
  return mesh_for(
      increment, [&] { return mesh_volume(request); }, limit_);
}

} // namespace spherecut::experiments::ledger
