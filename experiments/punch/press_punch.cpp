#include "experiments/punch/press_punch.hpp"

#include "experiments/analytic/half_space.hpp"
#include "experiments/support/stopwatch.hpp"

#include <algorithm>

namespace spherecut::experiments {

PunchRun press_punch(const HalfSpaceCase& half_space) {
  PunchRun run;
  run.body = half_space_body(half_space);
  const topology::FlatPunch punch{contact_radius, 10 * contact_radius};
  solvers::ContactOptions options;
  options.gap_tolerance = 1e-9 * punch_depth;
  const Stopwatch press;
  const solvers::ContactState state =
      solvers::press(run.body.patch, punch, topology::pose_at(punch, {0, 0, -punch_depth}), options);
  run.press_seconds = press.seconds();
  const solvers::Field field = solvers::deform(run.body.patch, state);
  run.profile = surface_profile(run.body, field, contact_radius + run.body.fine, 3 * contact_radius,
                                [](double r) { return flat_punch_profile(contact_radius, punch_depth, r); });
  for (const SurfaceSample& sample : run.profile)
    run.profile_error = std::max(run.profile_error, sample.largest_error / punch_depth);
  run.force_ratio =
      state.tool_force.z() / flat_punch_force({1, half_space.poisson_ratio, 0}, contact_radius, punch_depth);
  run.imbalance = far_force_imbalance(run.body, state, field);
  return run;
}

} // namespace spherecut::experiments
