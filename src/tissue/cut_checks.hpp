// What a cut must not do: pieces that nodes cannot carry, pieces that nothing holds, cuts under the tool.
#pragma once

#include "src/model/body_model.hpp"
#include "src/tissue/log.hpp"
#include "topology/wound/wound.hpp"

namespace spherecut::app {

/// Makes nodes fine along every piece that would be too small for the spacing there but not for the fine one.
void refine_small_pieces(const topology::Wound& wound, solvers::SpacingField& spacing);

/// Throws InputError naming the first piece that is smaller than the node spacing there: 6 volume / area, the diameter
/// of a ball of that ratio, below it.
void require_pieces(const topology::Wound& wound, const solvers::SpacingField& spacing);

/// Pieces no part of whose surface lies in a fixed region.
std::vector<int> unheld_pieces(const topology::Wound& wound, const std::vector<FixedRegion>& fixed);

/// Throws InputError, naming the place, when the new incision comes nearer than a node spacing to the tissue under the
/// tool where the old one did not, or when a bonded contact is to be kept.
void require_clear_of_tool(const topology::Incision& incision, const BodyModel& before,
                           solvers::ContactCondition condition);

/// Warns of severed pieces that no fixed region holds; throws InputError where the scenario, or its law, allows none.
void check_held(const Scenario& scenario, const topology::Wound& wound, double time, SessionLog& log);

} // namespace spherecut::app
