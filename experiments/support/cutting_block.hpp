// A block between two held faces and a straight edge that cuts into it from its free end.
#pragma once

#include "solvers/contact/blade_contact.hpp"

namespace spherecut::experiments {

/// Axes: x along the cut from the free end x = 0, z towards the held faces. The cut's plane is tilted about x.
struct CuttingCase {
  double length = 4, height = 2, width = 0.4; // m
  double above = 0.03, tilt = 0.15;           // m, rad: of the plane of the cut against the middle of the block
  double path = 1.2;                          // m, nodes are fine as far as this
  double spacing = 0.1;                       // m, along the way
  double half_width = 0.35;                   // m, of the edge's contact
  double flank = 0, shear = 0;                // m behind the edge and Pa: friction
  double slice = 0;                           // way along the edge over way ahead; the tissue goes along with the edge
  double gauge = 0;                           // m behind the edge, where its opening is told; 0: nowhere
  solvers::Material material{1, 0.3, 0};
  solvers::Method method = solvers::Method::galerkin;
  std::uint64_t seed = 1;

  [[nodiscard]] double front() const;   // m, length of the edge inside
  [[nodiscard]] double way() const;     // m, of the edge for every metre that it goes ahead
  [[nodiscard]] Vector3 along() const;  // unit, the edge
  [[nodiscard]] Vector3 course() const; // unit, its way
};

/// The block cut to a depth, seen from the edge. Places of the blade are how far it has gone ahead, m.
struct CuttingBody {
  double depth = 0, way = 1; // m; CuttingCase::way
  solvers::NodeCloud nodes;
  solvers::BladePatch patch;
  VectorX gauge; // m/N: opening of the cut at the gauge for every entry of the patch; empty without cut or gauge
  [[nodiscard]] VectorX advance(double blade) const {
    return VectorX::Constant(std::ssize(patch.contacts), (blade - depth) * way);
  }
  [[nodiscard]] solvers::BladeStroke stroke(double from, double to) const { return {advance(from), advance(to)}; }
};

/// Nodes of `previous` (null: none) stay where they still fit.
CuttingBody cutting_body(const CuttingCase& block, double depth, const solvers::NodeCloud* previous);

/// The block cut to one depth after the other.
std::vector<CuttingBody> cutting_bodies(const CuttingCase& block, const std::vector<double>& depths);

} // namespace spherecut::experiments
