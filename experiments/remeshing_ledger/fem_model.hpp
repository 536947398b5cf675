// Linear elasticity on parted tetrahedra: linear, quadratic, or quadratic with quarter-point nodes at the front.
#pragma once

#include "experiments/remeshing_ledger/back_end.hpp"
#include "experiments/remeshing_ledger/tet_mesh.hpp"
#include "solvers/algebra/factorisation.hpp"

#include <memory>

namespace spherecut::experiments::ledger {

/// Nodes of the elements: the mesh's vertices first, then, for quadratic ones, one on every edge.
struct FemNodes {
  Element element = Element::linear;
  std::vector<Vector3> positions;
  struct EdgeNode {
    int from, to;
    double share; // of the way from one to the other
  };
  std::vector<EdgeNode> edges;               // nodes from corners() on
  std::vector<std::array<int, 10>> elements; // corners, then edges 01 12 02 03 13 23
  struct FaceNodes {
    std::array<int, 6> above, below; // corners, then edges 01 12 02
  };
  std::vector<FaceNodes> faces;
  std::vector<char> held;          // by node
  std::vector<Vector3> prescribed; // m, where held
  std::vector<char> tip;           // by element: it touches the front
  [[nodiscard]] int corners() const { return static_cast<int>(positions.size() - edges.size()); }
  /// Puts the nodes of the edges where their corners say.
  void place_edges();
  [[nodiscard]] int per_element() const { return element == Element::linear ? 4 : 10; }
};
FemNodes number_nodes(const CutMesh& mesh, const Scenario& scenario, Element element);

/// Stiffness of one element, 3 a + c row-major over its nodes. False where its map folds over.
bool element_stiffness(const FemNodes& nodes, int element, const solvers::Material& material, MatrixX& stiffness);

/// Loads of the pressure on the faces, 3 a node.
VectorX face_loads(const FemNodes& nodes, const Scenario& scenario);

/// Opening volume, marked opening and tool force under the displacements (3 a node).
Opening fem_opening(const FemNodes& nodes, const Scenario& scenario, const VectorX& displacement);

/// Lower triangle of the stiffness over the free nodes in the given order, and the right-hand side of the held ones.
/// `place`: of each node in the order, -1 where it has none; `which`: elements that count, empty for all.
struct FemSystem {
  solvers::SparseMatrix lower;
  VectorX right;
  int folded = 0; // elements whose map folds over
};
FemSystem assemble(const FemNodes& nodes, const solvers::Material& material, const std::vector<int>& place,
                   int unknown_nodes, const std::vector<char>& which = {});

/// Fill-reducing order of the free nodes: place of each, -1 where held or left out.
std::vector<int> elimination_places(const FemNodes& nodes, int& unknown_nodes, const std::vector<char>& left_out = {});

/// Everything from a parted mesh to displacements, with its times.
struct FemSolution {
  FemNodes nodes;
  VectorX displacement; // 3 a node
  std::unique_ptr<solvers::Factorisation> factor;
  double norm = 0; // 1-norm of the matrix
  int unknowns = 0, folded = 0;
};
FemSolution solve_fem(const CutMesh& mesh, const Scenario& scenario, Element element, StageTimes& times);

/// Parts a mesh along the cut of the increment's number, solves and books it; `solution` stays where that fails.
void part_and_solve(const TetMesh& mesh, const Scenario& scenario, Element element, double tolerance,
                    Increment& increment, FemSolution& solution);

} // namespace spherecut::experiments::ledger
