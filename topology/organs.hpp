// Built-in organs: closed surfaces made here, from sizes in metres. All are 2-manifold, closed, outward oriented and
// deterministic. Sharp edges of the solid are edges of the mesh, and every vertex lies on the exact surface.
#pragma once

#include "topology/surface_mesh.hpp"

namespace spherecut::topology {

/// Box with the given side lengths (m), centred on the z axis, base on z = 0. Right-angled triangles with legs of about
/// `edge` m. Throws InputError when a size or the edge is not positive and finite, or the mesh would be absurdly large.
SurfaceMesh make_block(const Vector3& size, double edge);

/// Box from corner `lower` to corner `upper`, m; the same mesh and the same errors.
SurfaceMesh make_block(const Vector3& lower, const Vector3& upper, double edge);

/// Upright cylinder on z = 0 about the z axis; radius, height, edge in m. Errors as make_block.
SurfaceMesh make_cylinder(double radius, double height, double edge);

/// Half ball about the origin: base on z = 0, pole at (0, 0, radius); radius and edge in m. Errors as make_block.
SurfaceMesh make_hemisphere(double radius, double edge);

} // namespace spherecut::topology
