// Tetrahedral meshes of the cut organ by CGAL's Mesh_3 (which stays in its .cpp: 90 s of compilation).
#pragma once

#include "experiments/remeshing_ledger/tetrahedra.hpp"

namespace spherecut::experiments::ledger {

struct MeshRequest {
  std::function<int(const Vector3& x)> label; // 0: outside, 1, 2: above and below the plane of the cut
  Vector3 centre = Vector3::Zero();           // m, of a ball around the organ
  double radius = 0;
  std::vector<std::vector<Vector3>> features;   // polylines that meet in their ends alone; closed: first = last point
  std::function<double(const Vector3& x)> size; // m, of edges
  double distance = 0;                          // m, of faces from a curved surface
};

/// Throws NumericalError when the mesher gives nothing of use, and passes on what it throws.
TetMesh mesh_volume(const MeshRequest& request);

} // namespace spherecut::experiments::ledger
