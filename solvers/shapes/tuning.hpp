// Numbers of the discretisations that measurements have fixed. What half and twice each of them does is measured by the
// experiment `sensitivity`; docs/constants.md has its table. Nobody needs to set them.
#pragma once

namespace spherecut::solvers {

struct Tuning {
  // Both methods.
  double front_blend = 0.5;      // of the reach of the enrichment, from where on it fades
  double front_reach_soft = 2.5; // spacings as the spheres take them, of the enrichment, from nu = 0.45 on

  // `galerkin`. Radii of spheres are in reaches, from nu = 0.45 on in spacings.
  double sphere_radius = 2;        // of a body that is not cut
  double sphere_radius_cut = 1.75; // of one that is or will be
  double sphere_radius_soft = 2.2; // from nu = 0.45 on
  double front_reach = 1.35;       // spacings as the spheres take them, of the enrichment from the front
  double holding = 1e4;            // E h: stiffness per component that holds a mean

  // `collocation`.
  double collocation_front_reach = 1.75; // spacings, of the enrichment from the front
  double collocation_front_radius = 1.2; // times the radius of spheres at a front
  double damping = 0.3;                  // gamma, of mu A.d / d.d, on the difference of two nodes
  double damping_at_front = 2;           // the same where the basis is enriched
  double pressure_smoothing = 0.01;      // alpha, of A d / mu, on the difference of two pressures
};

} // namespace spherecut::solvers
