// Bodies with a cut that is there from the start, as the precut experiments use them.
#pragma once

#include "solvers/body/discretisation.hpp"

#include <functional>

namespace spherecut::experiments {

struct CutBodyCase {
  std::shared_ptr<const topology::Domain> domain;
  std::vector<topology::SurfaceMesh> sheets;
  double coarse = 4;   // spacing far from the front over that at it
  double slope = 0.35; // growth of the spacing away from the front, m per m
  int nodes = 1000;    // about
  std::uint64_t seed = 1;
  double fine = 0;                                    // m, spacing at the front; 0: as `nodes` asks for
  solvers::Method method = solvers::Method::galerkin; // the nodes are for
  solvers::SightRule sight = solvers::SightRule::enriched;
};

struct CutBody {
  solvers::Problem problem; // domain, incision and nodes; material, supports and loads are the caller's
  double fine = 0;          // m, spacing at the front
};

CutBody cut_body(const CutBodyCase& cut);

/// Holds the part of the surface that `region` tells at `field` (m).
void hold_surface(solvers::Problem& problem, std::function<bool(const Vector3& x, const Vector3& normal)> region,
                  std::function<Vector3(const Vector3& x)> field);

/// Holds the whole surface at `field` (m).
void hold_whole_surface(solvers::Problem& problem, std::function<Vector3(const Vector3& x)> field);

/// Jump u+ - u- at a point of a sheet with the given normal, m.
Vector3 opening_at(const solvers::Discretisation& body, const solvers::Field& field, const Vector3& x,
                   const Vector3& normal, double spacing);

} // namespace spherecut::experiments
