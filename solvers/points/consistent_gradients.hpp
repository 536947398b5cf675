// Gradients at quadrature points that fit the quadrature.
//
// Under a constant stress P the forces on the nodes are P sum_q w_q grad h_J(q); those of its surface traction are
// P b_J, b_J = integral over the surface of h_J n. The two are the same by the divergence theorem, but not by a
// quadrature, and what lies between them bends every state of constant stress. So the gradients are moved by as little
// as possible, the least sum of w |change|^2, such that
//
//   sum_q w_q g_J(q) = b_J for every node,   sum_J g_J(q) = 0,  sum_J x_J g_J(q)^T = I at every point.
//
// The change is g_J(q) += v_J - (the linear function nearest to v on the nodes that reach q), with a vector v_J a node
// from one sparse semidefinite system for the three axes, solved by conjugate gradients [cf. Chen, Wu, Yoon and You
// 2001; Duan, Li, Belytschko and Lin 2012: consistency of the quadrature].
#pragma once

#include "solvers/points/point_table.hpp"

namespace spherecut::solvers {

struct ConsistencyReport {
  double before = 0, after = 0; // |sum w g - b| over |b|
  double change = 0;            // root mean square of the change over that of the gradients
  int iterations = 0;
};

/// b_J from points of the whole surface, with those on the faces of a cut, m2. Throws NumericalError where no sound
/// support covers one.
std::vector<Vector3> surface_integrals(const Spheres& spheres, std::span<const SurfacePoint> surface);

/// Makes the gradients of the table consistent with `boundary`, m2, to `tolerance` of its norm or as far as
/// `most_iterations` go.
ConsistencyReport make_consistent(const std::vector<Vector3>& nodes, const std::vector<Vector3>& boundary,
                                  PointTable& table, double tolerance = 1e-7, int most_iterations = 200);

} // namespace spherecut::solvers
