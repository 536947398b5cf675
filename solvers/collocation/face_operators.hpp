// Displacement gradient on the faces between cells, from the nodal coefficients.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/body/elastic_body.hpp"
#include "topology/cells/voronoi_cells.hpp"

namespace spherecut::solvers {

/// Means of u_h and grad u_h over every face of a cell complex, in compressed rows: face f owns entries start[f] ..
/// start[f + 1]. One point a face, its centroid; where the field is singular as many as the mean needs.
struct FaceOperators {
  std::vector<int> start{0}, nodes;
  std::vector<double> value;
  std::vector<Vector3> gradient; // 1/m
  std::vector<char> at_front;    // per face: near the front of a cut, in the reach of an enriched basis
};

/// Throws NumericalError when a face has no sound support.
FaceOperators face_operators(const topology::CellComplex& cells, const Problem& problem, const Spheres& spheres,
                             const NodalSupports& supports);

} // namespace spherecut::solvers
