// Tetrahedra inside a given surface of triangles, which stay as they are (TetGen, where it is installed).
#pragma once

#include "experiments/remeshing_ledger/tetrahedra.hpp"

#include <vector>

namespace spherecut::experiments::ledger {

struct CavityBorder {
  std::vector<Vector3> points;
  std::vector<double> sizes; // m, of the edges wanted about each point
  /// Closed surface of the cavity and, inside, the faces of the cut: every one is a face of the filling.
  std::vector<Triangle> triangles;
};

/// Its vertices begin with the border's points. Throws NumericalError where the mesher fails or changes a triangle; it
/// may also crash or never end. Throws it too in builds without TetGen.
TetMesh fill_cavity(const CavityBorder& border);

bool has_cavity_mesher();

} // namespace spherecut::experiments::ledger
