// The sheets of the precuts of a scenario.
#pragma once

#include "src/scenario/cut_settings.hpp"
#include "topology/domain/domain.hpp"

#include <string>

namespace spherecut::app {

/// The sheet of a precut with triangles of about `edge` m; a file's as it is, mended. Of a rectangle, what lies more
/// than two edges beside the body's bounding box is left out, so that its triangles in the body do not depend on how
/// far it reaches out. One sentence for each kind of mending goes to `remarks`, if there is one. Throws InputError.
topology::SurfaceMesh precut_sheet(const PrecutSettings& precut, const topology::Domain& domain, double edge,
                                   std::vector<std::string>* remarks = nullptr);

/// Moves the border of a sheet, where it lies inside the body but nearer than `within` m to its surface, along the
/// sheet as far out of it: such a strip of whole tissue is no part of anybody's intent, and no node would see it.
/// Returns the number of vertices at which the sheet ended there; a border that only passes through the surface has
/// none.
int end_on_surface(topology::SurfaceMesh& sheet, const topology::Domain& domain, double within);

} // namespace spherecut::app
