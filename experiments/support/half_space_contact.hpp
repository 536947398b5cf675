// A local piece of an elastic half-space with a tool's patch on it: ground of the punch and Hertz experiments.
#pragma once

#include "solvers/contact/solver.hpp"

#include <functional>
#include <string>

namespace spherecut::experiments {

/// Every length is in units of the contact radius, and Young's modulus is 1 Pa: problems of linear contact scale.
inline constexpr double contact_radius = 1;
/// Half-width and depth of the local domain, whose far boundary moves as the half-space does (HalfSpaceCoupling).
inline constexpr double half_width = 4;
/// Growth of the spacing away from the fine zone, the same for every method and case.
inline constexpr double spacing_slope = 0.35;

enum class Indenter {
  punch,  // flat, edge known: fine at the edge, with a ring of nodes on either side of it
  sphere, // edge an outcome: fine over the whole contact
};

struct HalfSpaceCase {
  Indenter indenter = Indenter::punch;
  solvers::Method method = solvers::Method::galerkin;
  double poisson_ratio = 0.3;
  int target_nodes = 1200;
  std::uint64_t seed = 1;
  std::vector<topology::SurfaceMesh> cut{}; // sheets of a buried cut
  double fine = 0;                          // m, spacing at the contact; 0: what target_nodes asks for
};

/// The body and its condensed patch. Seconds are processor time.
struct HalfSpaceBody {
  std::unique_ptr<solvers::Discretisation> body;
  solvers::ContactPatch patch;
  double fine = 0; // m, spacing at the contact
  double sprinkle_seconds = 0, build_seconds = 0, condense_seconds = 0;
  [[nodiscard]] int nodes() const { return body->report().nodes; }
};

/// Sprinkles with the wanted spacing, or to within 3 % of the wanted number of nodes where that can be had, assembles
/// and condenses.
HalfSpaceBody half_space_body(const HalfSpaceCase& half_space);

/// Displacement of the surface into the body at distance r from the axis: mean, and largest deviation from `exact`,
/// over directions.
struct SurfaceSample {
  double r = 0, mean = 0, largest_error = 0; // m
};
std::vector<SurfaceSample> surface_profile(const HalfSpaceBody& half_space, const solvers::Field& field, double from,
                                           double to, const std::function<double(double r)>& exact);

/// Contact force and the force at the far boundary: |sum of both| / contact force.
double far_force_imbalance(const HalfSpaceBody& half_space, const solvers::ContactState& state,
                           const solvers::Field& field);

/// Columns of the table that both experiments write, and one row of it.
std::vector<std::string> half_space_columns();
std::vector<std::string> half_space_row(const HalfSpaceCase& half_space, const HalfSpaceBody& body, double force_ratio,
                                        double profile_error, double imbalance);

} // namespace spherecut::experiments
