// The matrix behind a `galerkin` discretisation, for those who update it or look into it.
#pragma once

#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/pieces.hpp"
#include "solvers/body/surface_patches.hpp"
#include "solvers/shapes/cell_shapes.hpp"

namespace spherecut::solvers {

struct OrderedStiffness {
  const SparseMatrix& lower;                 // lower triangle in elimination order with full diagonal blocks, N/m
  const std::vector<int>& order;             // node of every elimination rank
  const std::vector<Anchor>& anchors;        // springs E h on the coefficients that hold pieces, part of the matrix
  const std::vector<DisplacementMean>& held; // what each entry of Problem::prescribed holds
  const BackgroundCells& cells;
  const Spheres& spheres;
  Eigen::Map<const SparseMatrix> elastic; // `lower` without the penalties of the held means
  const std::vector<CellShapes>& shapes;  // of every cell; a body that is factored keeps them where it needs them
  const VectorX& loads;                   // N, 3 a node, prescribed displacements left out
  bool dropped = false;                   // whether unknowns of severed pieces are taken out
};

/// A body of method galerkin that is assembled and not factored: only its stiffness and its report can be asked for.
std::unique_ptr<Discretisation> assemble_galerkin(Problem problem, const DiscretisationOptions& options);

/// Support radius over galerkin_lengths that the options ask for, or the default for this material. Bodies with a cut
/// take smaller spheres: an increment then changes a quarter fewer nodes, and openings and intensities are as exact as
/// with 2.0 (docs/performance.md); smooth fields are not (0.57 for 0.37 % at 729 nodes).
double galerkin_support_radius(const Problem& problem, const DiscretisationOptions& options);

/// Cells and quadrature that the options ask for.
BackgroundOptions background_of(const DiscretisationOptions& options);

/// What the radii are that many times of: the reaches of the nodes, near incompressibility their spacings.
std::vector<double> NodeCloud::*galerkin_lengths(const Material& material);

/// Penalty of a held mean displacement of a node, N/m per component.
double constraint_stiffness(const Problem& problem, int node);

/// Stiffness with the penalties of the prescribed displacements; lives as long as `body`. Throws InputError when `body`
/// is of another method.
OrderedStiffness stiffness_of(const Discretisation& body);

} // namespace spherecut::solvers
