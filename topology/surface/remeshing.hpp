// Even triangulation of a smooth surface.
#pragma once

#include "topology/surface/mesh.hpp"

namespace spherecut::topology {

/// The closed 2-manifold `mesh` covered again by nearly equilateral triangles with edges of about `edge` m, by CGAL's
/// isotropic remeshing [Botsch and Kobbelt 2004]; vertices stay on the given triangles. Throws InputError when the edge
/// is not positive or the mesh is not a manifold.
SurfaceMesh remesh_isotropic(const SurfaceMesh& mesh, double edge, int iterations = 4);

} // namespace spherecut::topology
