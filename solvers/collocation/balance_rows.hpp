// Collocation of the force balance of each node's cell (Petrov-Galerkin with Heaviside test functions).
//
// Notation: i, j nodes sharing a cell face with area vector A (from i to j), centroid x_f and d = x_j - x_i; G_f the
// operator that gives grad u_h at x_f from the nodal coefficients X; mu, lambda Lame's constants; h_i spacing.
//
// Flux through the face, in newtons, positive when it pulls cell i towards j:
//
//   t_ij = sigma(G_f X) A + gamma mu w [X_j - X_i - (G_f X) d],   w = A.d / |d|^2.
//
// The first term is second order and exact for linear fields. Alone it does not see every oscillation from node to
// node; the second vanishes for linear fields and gives the coercivity that is missing (gamma = 0 loses seeds at small
// supports; 0.1 to 0.5 give the same errors within a third). Row i states that the fluxes and the applied force
// balance, -sum_j t_ij = f_i, so all rows add up to the total force: every t_ij appears twice with opposite signs.
// Face fluxes are a small numerical integration (one point a face), which the paper's point collocation avoids; it buys
// convergence and forces in newtons.
//
// Near incompressibility the volumetric stress becomes an unknown p = -lambda div u, one a node, p_f = (p_i + p_j) / 2,
// with the continuity row
//
//   sum_f u_h(x_f) . A + u_h(x_b) . B_i + V_i p_i / lambda - alpha sum_f |A| |d| (p_j - p_i) / mu = 0,
//
// B_i the part of the body's surface that belongs to the cell, V_i its volume, and tr(e0) V_i on the right for an
// initial strain e0. The system holds p h_i / E instead of p: its entries then are E h whatever the units.
//
// A cut: lip nodes stand 1e-4 h off the sheet, so the face between partners is the sheet. Faces between nodes that the
// sheet keeps apart carry no flux but the traction tau on the lips, -sum_j t_ij = f_i + tau; G_f sees what the sight
// rule lets it see. Where the basis is enriched the second term measures the coefficients against the field instead of
// against a linear one, so that it vanishes for the singular field too,
//
//   gamma mu w [X_j - u_h(x_j) - X_i + u_h(x_i)],
//
// and G_f is a mean over points that crowd towards the front (face_operators.hpp). Faces between partners end at the
// front: what of them lies ahead of it carries flux. Measured on a straight front with h = 0.14 (350 nodes, ten seeds):
// K within 3 %, the opening within 2 %. With one point a face K in mode II or III is 6 to 8 % too large; faces that end
// half way to the next nodes made a grown cut 11 % too soft; an enrichment that reaches 4 spacings lets the corners of
// lips flap (two node sets 20 % apart, against 2 %); gamma = 0.3 at the front loses seeds; means over the nodes'
// gradients are useless there.
#pragma once

#include "solvers/body/elastic_body.hpp"
#include "topology/cells/voronoi_cells.hpp"

namespace spherecut::solvers {

/// Balance of one cell: rows 0-2 forces (N per m, N per Pa), row 3 continuity (m3 per m, m3 per Pa) of the mixed form.
/// The first node is the cell's own.
struct BalanceRow {
  std::vector<int> nodes;
  std::vector<Eigen::Matrix4d> blocks;
};

/// Rows of all nodes, into `rows`. Throws InputError for a node without a cell, NumericalError where a face has no
/// sound support.
void assemble_rows(const Problem& problem, const topology::CellComplex& cells, const Spheres& spheres,
                   const NodalSupports& supports, bool mixed, std::vector<BalanceRow>& rows);

} // namespace spherecut::solvers
