// Walls of an organ and the gaps between its parts, against the spacing of the nodes.
#pragma once

#include "solvers/nodes/nodes.hpp"
#include "topology/domain/domain.hpp"
#include "topology/surface/widths.hpp"

#include <optional>
#include <string>

namespace spherecut::app {

/// Nodes that a derived spacing may ask for to follow thin walls.
inline constexpr int wall_budget = 8000;

/// A wall or a gap and where it is.
struct WidthAt {
  double width = 0;                // m
  Vector3 place = Vector3::Zero(); // m, its middle
};

/// What the surface of an organ says about its walls.
struct OrganWalls {
  topology::SurfaceWidths widths;
  double median = 0;                // m, of the thickness, by area
  std::optional<WidthAt> thinnest;  // of the walls whose two sides are about parallel
  std::optional<WidthAt> narrowest; // likewise of the gaps
};

/// Measured from places about `apart` m from one another; gaps up to `reach` m.
OrganWalls measure_walls(const topology::Domain& domain, double apart, double reach);

/// "walls from 3.1 mm at [...] m, 24 mm in the middle; gaps from 0.8 mm at [...] m".
std::string walls_text(const OrganWalls& walls);

/// Makes the coarsest spacing half the thickness of the thinnest wall that would have fewer than three nodes through
/// it; where that asks for more than `budget` nodes the one that asks for so many.
void follow_walls(const OrganWalls& walls, const topology::Domain& domain, int budget, solvers::SpacingField& spacing);

/// The wall that is worst off with a spacing; nothing where all have `through` spacings, by default three nodes,
/// through them.
struct CoarseWall {
  double thickness = 0, spacing = 0;                                         // m
  Vector3 place = Vector3::Zero();                                           // m
  double wanted = 0;                                                         // m, spacing of three nodes through it
  [[nodiscard]] double nodes_through() const { return thickness / spacing; } // spacings, of which three nodes need two
};
std::optional<CoarseWall> coarsest_wall(const OrganWalls& walls, const solvers::SpacingField& spacing,
                                        double through = 2);

/// The narrowest gap of half a spacing to two between parallel parts of the surface, where there is enough of such gaps
/// to matter: beside one `collocation` is 5 to 14 % too stiff (docs/experiments/real_world.md, narrow gaps).
std::optional<WidthAt> stiff_gap(const OrganWalls& walls, const solvers::SpacingField& spacing);

} // namespace spherecut::app
