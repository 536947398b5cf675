// Second opinions on the pieces of a cut body: CGAL's mesh package on the wound's surface, and voxels
// (voxel_pieces.hpp). Neither knows how the wound was made.
#pragma once

#include "topology/wound/voxel_pieces.hpp"
#include "topology/wound/wound.hpp"

namespace spherecut::topology {

/// A connected component of a closed surface as CGAL counts it.
struct AuditedComponent {
  int triangles = 0;
  int euler = 0;     // V - E + F
  double volume = 0; // m3, signed
};

/// Components by their first triangle, ascending. Throws InputError when the surface is not closed and 2-manifold.
std::vector<AuditedComponent> audit_components(const SurfaceMesh& surface);

/// What differs between the wound's own components (count, triangles, Euler characteristics, volumes to 1e-9 of the
/// whole) and CGAL's; nothing when they agree.
std::optional<std::string> component_difference(const Wound& wound);

/// Hausdorff distance, m, between the surfaces of the wound's pieces and the skins of the voxel pieces, matched by
/// volume; infinite when their numbers differ. The wound is sampled at its corners and centroids, the skins at the
/// middles of their faces. Where a piece ends in a wedge thinner than a voxel the voxels end before it.
double hausdorff_distance(const Wound& wound, const VoxelPieces& pieces, double voxel_size);

} // namespace spherecut::topology
