// The scheme as published [De 2001, section 2]: linear basis, quartic spline, exact derivatives, and one collocation of
// the differential equation (three scalar rows) at each node:
//   interior node                mu lap u + (lambda + mu) grad div u + b = 0          N/m3
//   free or loaded surface node  sigma n = t with the node's normal n                 Pa
//   prescribed component         u_h(x_i) = g                                         m
//   tool-tip node                alpha_tip = U_tip: the nodal unknown, not u_h [De 2001, Eq. 5]
// It passes the linear patch test but does not converge: a linear basis has no consistent second derivatives. The rows
// are not forces; every figure in newtons below is a row times the nodal area h^2 (surface) or volume h^3 (interior).
#pragma once

#include "solvers/body/discretisation.hpp"
#include "solvers/shapes/functions.hpp"

namespace spherecut::solvers {

/// Coefficient of alpha_k (k-th node of the support) in mu lap u + (lambda + mu) grad div u, N/m4. Needs second
/// derivatives.
Matrix3 equilibrium_block(const ShapeFunctions& shape, int k, const Material& material);

/// Coefficient of alpha_k in the traction sigma n, Pa/m.
Matrix3 traction_block(const ShapeFunctions& shape, int k, const Vector3& normal, const Material& material);

/// Support radius in units of h where DiscretisationOptions leaves it open.
constexpr double published_support_radius = 2.0;

/// Assembles and factors. A prescribed entry of options.tip_node (all three components) fixes the node's unknown.
/// Forces of the interface are rows times nodal area or volume, see above: an approximation that does not converge, and
/// the forces of a body in equilibrium do not add up to zero. Forces on prescribed components change nothing.
/// Throws InputError as `discretise` does, and when a surface node has no normal, a component is prescribed twice, or
/// the tip has no entry or is the only node held; NumericalError when the system is singular.
std::unique_ptr<Discretisation> make_published(Problem problem, const DiscretisationOptions& options);

/// The condensed tool tip: with U_b = -K_bb^-1 K_ba U_tip, f = K_aa U_tip + K_ab U_b = stiffness U_tip.
struct PublishedTip {
  int node = -1;
  Matrix3 row_stiffness = Matrix3::Zero(); // as the rows are: Pa/m for a tip on the surface, N/m4 for one inside
  double measure = 0;                      // h^2 in m2, or h^3 in m3
  Matrix3 stiffness = Matrix3::Zero();     // row_stiffness times measure, N/m; acts on the body
};

/// Throws InputError when `body` was not made by make_published with a tip node.
PublishedTip tip_stiffness(const Discretisation& body);

/// Force of the tool on the body for a tip displacement, all else homogeneous, N by the nodal area.
Vector3 published_tip_force(const Discretisation& body, const Vector3& displacement);

} // namespace spherecut::solvers
