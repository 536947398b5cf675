// The matrix behind a `collocation` discretisation, for those who look into it.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/pieces.hpp"

namespace spherecut::solvers {

/// Balance of every cell before displacements are prescribed: forces (N) and, where the pressure is an unknown, the
/// continuity of each cell, on nodal coefficients (m) and pressures (Pa).
struct CellBalance {
  SparseMatrix rows;
  int stride = 3;              // unknowns a node: 3, with a pressure 4
  std::vector<Anchor> anchors; // springs E h on the coefficients that hold pieces, part of the rows
};

/// Throws InputError when `body` is of another method.
CellBalance cell_balance_of(const Discretisation& body);

} // namespace spherecut::solvers
