// A strip that is cut along its middle under tension across: what the tension releases, the blade need not pay.
#pragma once

#include "experiments/experiment.hpp"

#include <vector>

namespace spherecut::experiments {

/// Strips 160 x 40 x 10 mm (E = 10 kPa, nu = 0.3, toughness 10 J/m2) between clamps along their long sides, given as
/// stretched across; their faces do not move outwards. A slit from one end, and a blade that goes on in it. Behind a
/// front far from both ends both halves are free of strain, ahead of it the strain is even: the tension releases G = W
/// H, W the energy at rest without the slit, and the blade's work is G_c - G per area of the cut, linear in G as in the
/// Y-shaped cutting test [Lake and Yeoh 1978]. Checks by the linear law, and by neo-Hookean solid.
void cut_under_tension(const ExperimentContext& context, std::vector<Check>& checks);

} // namespace spherecut::experiments
