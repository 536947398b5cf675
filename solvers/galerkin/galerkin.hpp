// The matrix behind a `galerkin` discretisation, for those who look into it.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/pieces.hpp"

namespace spherecut::solvers {

struct OrderedStiffness {
  const SparseMatrix& lower;          // lower triangle in elimination order with full diagonal blocks, N/m
  const std::vector<int>& order;      // node of every elimination rank
  const std::vector<Anchor>& anchors; // springs E h on the coefficients that hold pieces, part of the matrix
};

/// Support radius over galerkin_lengths that the options ask for, or the default for this material. Bodies with a cut
/// take smaller spheres, which couple a third fewer nodes: openings and intensities are as exact as with 2.0
/// (docs/performance.md); smooth fields are not (0.57 for 0.37 % at 729 nodes).
double galerkin_support_radius(const Problem& problem, const DiscretisationOptions& options);

/// What the radii are that many times of: the reaches of the nodes, near incompressibility their spacings.
std::vector<double> NodeCloud::*galerkin_lengths(const Material& material);

/// Penalty of a held mean displacement of a node, N/m per component.
double constraint_stiffness(const Problem& problem, int node);

/// Stiffness with the penalties of the prescribed displacements; lives as long as `body`. Throws InputError when `body`
/// is of another method.
OrderedStiffness stiffness_of(const Discretisation& body);

} // namespace spherecut::solvers
