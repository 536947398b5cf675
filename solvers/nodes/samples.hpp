// Sample points that cover a body and its surface at a fraction of the node spacing: they measure how many nodes a
// spacing asks for and find the places a filling has missed.
#pragma once

#include "solvers/nodes/nodes.hpp"

namespace spherecut::solvers {

/// A cube of an octree; the samples of all cells together integrate over the body.
struct VolumeSample {
  Vector3 point;   // centre, m
  double spacing;  // h there, m
  double expected; // inside volume of the cell / h^3
};

struct SurfaceSample {
  Vector3 point;   // centroid of a piece of a triangle of Domain::surface(), m
  double spacing;  // m
  double expected; // area of the piece / h^2
};

/// Cells no larger than `fraction` h, those outside the body left out, and those outside `region` if there is one.
/// Relies on |signed_distance| being no larger than the true distance. Throws InputError when the body needs more than
/// maximum_nodes.
std::vector<VolumeSample> sample_volume(const topology::Domain& domain, const SpacingField& spacing, double fraction,
                                        int maximum_nodes, const BoundingBox* region = nullptr);

/// Pieces of a surface no longer than `fraction` h. Throws InputError when it needs more than maximum_nodes.
std::vector<SurfaceSample> sample_surface(const topology::SurfaceMesh& surface, const SpacingField& spacing,
                                          double fraction, int maximum_nodes);

/// Share of a node's surroundings that lies in the body and on its side of a sheet; see SprinkleZone.
double node_share(const topology::Domain& domain, const Vector3& x, double h, NodeKind kind, const Vector3& normal);

/// Size, place and flatness of the pieces of a cut body, largest first.
std::vector<SprinklePiece> inspect_pieces(const NodeCloud& nodes, const topology::Incision& incision);

/// inspect_filling with the volume samples given (cells of half a spacing).
SprinkleReport inspect_filling(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& nodes,
                               const std::vector<VolumeSample>& samples);

} // namespace spherecut::solvers
