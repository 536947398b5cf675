// Slits in a square plate in plane strain, their openings against the stored solutions of two finite element codes
// (experiments/reference/slits.py).
#pragma once

#include "experiments/experiment.hpp"

#include "topology/base/types.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace spherecut::experiments {

/// A plate 2 m wide about the origin, E = 1 Pa, pulled on its sides x = +-1 m and y = +-1 m.
struct PlaneSlits {
  struct Place {
    int slit = 0, part = 0;                 // of a slit the straight part
    double share = 0;                       // of that part, from its beginning
    Eigen::Vector2d opening = {0, 0};       // m, displacement on the left less that on the right; CalculiX
    Eigen::Vector2d of_other_code = {0, 0}; // m, the same by GetFEM
  };
  Eigen::Vector2d tension = {0, 0}; // Pa, along x and y
  double poisson_ratio = 0;
  std::vector<std::vector<Eigen::Vector2d>> slits; // m, corners of each
  std::vector<Place> places;
  double mesh_change = 0; // between the two meshes of a code, the larger of both codes, over the largest opening
  double codes_apart = 0; // the same between the codes
};

/// Reads a table of reference/slits.py. Throws InputError naming what it cannot read.
PlaneSlits read_plane_slits(std::string_view table);

/// Runs the plate on node sets of the default method and compares openings along every slit: the largest difference
/// over the largest opening of that slit, at most `bound`. The other methods with the enriched basis are reported.
/// Writes openings.csv and openings.png.
std::vector<Check> run_plane_slits(const ExperimentContext& context, const std::string& name, const std::string& title,
                                   const PlaneSlits& plate, double bound);

} // namespace spherecut::experiments
