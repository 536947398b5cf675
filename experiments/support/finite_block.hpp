// A block with irregular nodes whose faces are held along some axes: ground of the checks at finite strain.
#pragma once

#include "solvers/finite/equilibrium.hpp"

#include <optional>

namespace spherecut::experiments {

/// Faces 2 axis (low) and 2 axis + 1 (high); held[face][axis]: whether the face is held along the axis.
using HeldFaces = std::array<std::array<bool, 3>, 6>;

struct FiniteBlock {
  Vector3 lower = Vector3::Zero(), upper = Vector3::Ones(); // m
  double spacing = 0.125;                                   // m
  double jitter = 0.25; // nodes are moved at random by up to so many spacings, on their face or edge
  std::uint64_t seed = 1;
  HeldFaces held{};
  std::optional<solvers::SpacingField> graded{}; // nodes are sprinkled so, in place of the grid
  std::vector<topology::SurfaceMesh> cuts{};     // there from the start; nodes on a grid take no notice of them
  bool lips_apart = false; // sprinkled for the rule `appended`: nodes as without the cuts, then places on their faces
};

/// Nodes on a grid of about the spacing, or sprinkled. Entries are one per node and axis, or, where every face is held
/// along all axes or none, one per node.
solvers::Problem finite_block(const FiniteBlock& block);

/// Neo-Hookean law of a shear modulus, Pa, and a Poisson ratio.
std::shared_ptr<const solvers::Law> neo_hookean(double shear_modulus, double poisson_ratio);

/// Force on the body, N, of the constraints whose means lie on a face, axis by axis.
Vector3 face_force(const solvers::FiniteBody& body, const std::vector<Vector3>& constraint_forces, int axis,
                   double coordinate);

/// Relative L2 error of the nodal displacements against a field.
double nodal_error(const solvers::FiniteBody& body, const VectorX& coefficients,
                   const std::function<Vector3(const Vector3& x)>& exact);

/// Largest relative error |F - exact| / |exact - I| at the quadrature points' places: the body's middle and its nodes.
double gradient_error(const solvers::FiniteBody& body, const VectorX& coefficients, const Matrix3& exact);

} // namespace spherecut::experiments
