// Narrow gaps of a body's own surface, told to sight lines as the sheets of a cut are.
#pragma once

#include "topology/incision/incision.hpp"

#include <functional>

namespace spherecut::topology {

/// Spacings: wider gaps part the spheres by themselves, or nearly so.
inline constexpr double widest_gap = 2;
/// Of the squared spacing: a smaller patch is roughness.
inline constexpr double least_gap_area = 0.5;

/// Sheets in the middle of the body's narrow gaps, as walls of an incision without cuts. A gap is narrow where a ray
/// out of the surface meets the surface again within two spacings and the two sides face each other within 25 degrees;
/// patches of less than half a squared spacing are roughness and count for nothing. A sheet stands half way between the
/// sides of its gap. At the bottom of the gap it goes on into the material by a thousandth of the spacing, so that its
/// border there is a front. Where the bottom is wider than 0.6 of the spacing it is none: there the sheet ends half the
/// gap's width above the bottom. Elsewhere it reaches three spacings out of the gap, farther than spheres see. Null:
/// the body has no such gap. `spacing` is that of the nodes at a place, m.
std::shared_ptr<const Incision> gap_walls(const std::shared_ptr<const Domain>& domain,
                                          const std::function<double(const Vector3&)>& spacing);

/// The sheets of a cut (null: uncut) with the walls (null: none) as one, for sight lines.
std::shared_ptr<const Incision> with_walls(const std::shared_ptr<const Incision>& cut,
                                           const std::shared_ptr<const Incision>& walls);

} // namespace spherecut::topology
