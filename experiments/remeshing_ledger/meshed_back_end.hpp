// What the back ends have in common that mesh the organ: what they are run with, sizes about the front, and a mesh of
// the organ with its cut.
#pragma once

#include "experiments/remeshing_ledger/back_end.hpp"
#include "experiments/remeshing_ledger/tetrahedra.hpp"

namespace spherecut::experiments::ledger {

class MeshedBackEnd : public BackEnd {
 protected:
  MeshedBackEnd(const Scenario& scenario, const Resolution& resolution, Element element, double limit)
      : scenario_(scenario), resolution_(resolution), element_(element), limit_(limit), number_(resolution.first) {}

  /// Sizes about the front of the cut of number_, `share` times those of the resolution.
  [[nodiscard]] Grading grading(double share = 1) const;

  /// The organ with the cut of number_, meshed by Mesh_3 with those sizes; books time, memory and failure, which is set
  /// when there is no mesh. The increment is then one made anew.
  [[nodiscard]] TetMesh mesh_organ(Increment& increment, double share = 1) const;

  /// m; nearer to the plane of the cut a vertex lies in it.
  [[nodiscard]] double tolerance() const { return 1e-3 * resolution_.fine; }

  Scenario scenario_;
  Resolution resolution_;
  Element element_;
  double limit_; // s a mesh may take
  int number_;   // of the cut
};

} // namespace spherecut::experiments::ledger
