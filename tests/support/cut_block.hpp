// A block with a plane cut that is aligned with nothing, and irregular nodes with pairs on the faces of the cut.
#pragma once

#include "solvers/body/discretisation.hpp"

#include <memory>

namespace spherecut::tests {

/// Frame of a cut: a sheet in the plane through `origin` spanned by `ahead` and `tangent`, ending at ahead = 0.
struct CutFrame {
  Vector3 origin, ahead, normal, tangent;
};

/// Shifted and tilted against all axes; `normal` is near +z.
CutFrame tilted_frame();

/// A flat strip of the plane, from `behind` (negative) to `front` along `ahead` and `half_width` to either side, m.
topology::SurfaceMesh flat_sheet(const CutFrame& frame, double behind, double front, double half_width, int divisions);

struct CutBlock {
  std::shared_ptr<const topology::Domain> domain;
  std::shared_ptr<const topology::Incision> incision;
  solvers::NodeCloud nodes;
  CutFrame frame;
};

/// Cube of edge 1 m about the origin with spacing 1 / divisions: a jittered lattice, and lip pairs where the cut is.
/// The cut ends within the block (a front), or goes through it when `through` is set.
CutBlock cut_block(int divisions, bool through, std::uint64_t seed);

/// The block with its cut and nodes, free and without loads.
solvers::Problem problem_of(const CutBlock& block, const solvers::Material& material);

} // namespace spherecut::tests
