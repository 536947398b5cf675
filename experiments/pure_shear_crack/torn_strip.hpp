// A run of a strip in pure shear, six times as long as high, whose crack of one and a half heights tears on.
#pragma once

#include "experiments/experiment.hpp"
#include "experiments/support/precut_series.hpp"

namespace spherecut::experiments {

/// Strips of both laws, each at the stretches, torn over half of their length by a run of the program. Adds to the
/// errors what the release is off W H when the tear starts and on its way, how far the front leaves the middle over the
/// height, what of the way is not torn, and what the strip gives up over W H times the torn area, all as shares.
void tear_strips(const std::vector<double>& stretches, std::uint64_t seed, const ExperimentContext& context,
                 ErrorSeries& errors);

/// A strip tears where its toughness is W H / (1 + margin), and rests where it is W H (1 + margin). Returns how many of
/// the runs do otherwise.
int wrong_onsets(const std::vector<double>& stretches, double margin, const ExperimentContext& context);

} // namespace spherecut::experiments
