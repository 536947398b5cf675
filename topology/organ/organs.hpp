// Built-in organs: closed surfaces made here, from sizes in metres. All are 2-manifold, closed, outward oriented and
// deterministic. Sharp edges of the solid are edges of the mesh, and every vertex lies on the exact surface (for the
// liver to 1e-9 m).
#pragma once

#include "topology/surface/mesh.hpp"

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

/// A liver of adult size, about 0.22 m wide and 1.6 litres, as a smooth closed surface of about `target_triangles`
/// (within 15 %; 5000, 20000 and 80000 are the usual choices) near-equilateral triangles. It is our own implicit shape:
/// a large right lobe under a dome, a left lobe that tapers to a thin edge, and a flattened, hollowed underside. Frame:
/// origin at the centre of the bounding box; z up towards the dome, visceral underside -z; x towards the patient's
/// left, so the right lobe lies at x < 0; y towards the back, the thin front margin at y < 0. Throws InputError outside
/// 1000 to 500000 triangles.
SurfaceMesh make_liver(int target_triangles);

} // namespace spherecut::topology
