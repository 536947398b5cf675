// The paper's sprinkling: nodes at places fixed offline relative to the tool tip [De 2001, sections 2 and 3, Fig. 2].
#pragma once

#include "solvers/nodes/nodes.hpp"

namespace spherecut::solvers {

/// Support radius / spacing at which a placed pattern has the radii of the pattern.
constexpr double pattern_support_radius = 2.0;

/// Nodes and spheres relative to the tip; all vectors have the same length. Node 0 is the tip, at the origin.
struct ToolPattern {
  std::vector<Vector3> positions; // m, +z along the outward normal at the contact
  std::vector<double> radii;      // m, of the spheres
  std::vector<bool> on_surface;   // z = 0; the others are inside, z < 0
  std::vector<int> shells;        // 0 the tip, 1 the nodes whose spheres reach it, ..., the last the outer boundary
  double reach = 0;               // m, radius of the half ball that the pattern fills
  [[nodiscard]] int size() const { return static_cast<int>(positions.size()); }
};

/// Largest condition number of the moment matrix at the tip of the pattern.
constexpr double tip_condition_limit = 1000;

/// 34 nodes: the tip and shells of 5, 13 and 15 nodes at 0.32, 0.66 and 1 times `reach` (m), 21 of them on the surface.
/// A node of the two outer shells has a sphere that ends short of the tip. The five of the first shell, four around the
/// tip and one below it, are the fewest that a support accepts beside the tip (basis + 2, see Spheres), and their
/// spheres go beyond the tip by the smallest common factor for which the moment matrix A there has a condition of at
/// most tip_condition_limit: with any less A is worse, with none it is singular, and without the node below it is
/// singular too, whatever the factor. So the tip's own shape function is nearly 1 at the tip, which is what Eq. 5 takes
/// it for. Throws InputError when reach is not positive and finite.
ToolPattern paper_pattern(double reach);

/// Condition number (1-norm) at x of the moment matrix A of the linear basis {1, (y - x) / scale} with quartic splines
/// on the given spheres [De 2001, Eq. 3]; infinity when it is singular.
double moment_condition(const std::vector<Vector3>& centres, const std::vector<double>& radii, const Vector3& x,
                        double scale);

/// The pattern on the organ, in the pattern's order, tip at the surface point nearest to `contact`: surface nodes
/// follow the surface, keeping their distance from the tip along it where it bends; inside nodes that would come closer
/// than 0.45 spacings to the surface are moved inwards to that depth. Radii follow the actual distance from the tip, so
/// that spheres still end short of it. The frame is the shortest rotation from +z to `normal` (unit, outward). Spacings
/// are radii / pattern_support_radius. Throws InputError when the contact is farther than 0.1 reach from the surface,
/// the normal is not a unit vector, or the body is too thin or too bent here for the pattern, naming the node.
NodeCloud place(const ToolPattern& pattern, const topology::Domain& domain, const Vector3& contact,
                const Vector3& normal);

} // namespace spherecut::solvers
