// The matrix behind a `galerkin` discretisation, for those who update it or look into it.
#pragma once

#include "solvers/factorisation.hpp"
#include "solvers/pieces.hpp"

namespace spherecut::solvers {

struct OrderedStiffness {
  const SparseMatrix& lower;          // lower triangle in elimination order with full diagonal blocks, N/m
  const std::vector<int>& order;      // node of every elimination rank
  const std::vector<Anchor>& anchors; // springs E h on the coefficients that hold pieces, part of the matrix
};

/// Stiffness with the penalties of the prescribed displacements; lives as long as `body`. Throws InputError when `body`
/// is of another method.
OrderedStiffness stiffness_of(const Discretisation& body);

} // namespace spherecut::solvers
