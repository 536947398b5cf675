// Tetrahedra of an organ, parted along the cut.
#pragma once

#include "experiments/remeshing_ledger/scenario.hpp"
#include "experiments/remeshing_ledger/tetrahedra.hpp"

#include <array>
#include <vector>

namespace spherecut::experiments::ledger {

struct TetFace {
  std::array<int, 3> key; // its vertices, ascending
  int tet, face;
};
/// Faces of all tetrahedra; those of two stand beside one another.
std::vector<TetFace> sorted_faces(const std::vector<std::array<int, 4>>& tets);

/// The mesh with the faces of the cut doubled. Vertices behind the front have one copy on either side, those on it are
/// shared.
struct CutMesh {
  std::vector<Vector3> vertices;
  std::vector<std::array<int, 4>> tets;
  std::vector<int> original; // of each vertex, in the mesh that was parted
  std::vector<char> front;   // by vertex
  std::vector<char> skin;    // by vertex: on the surface of the organ
  struct Face {
    std::array<int, 3> above, below; // the same corners on either side of the cut
  };
  std::vector<Face> faces;
  std::vector<Triangle> surface; // of the organ, the faces of the cut left out
};

/// Vertices within `tolerance` m of the plane belong to it.
CutMesh part(const TetMesh& mesh, const Scenario& scenario, int increment, double tolerance);

/// The mesh as it is: no faces of a cut, no front.
CutMesh uncut(const TetMesh& mesh);

} // namespace spherecut::experiments::ledger
