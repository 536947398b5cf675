// The body of a session whose law is not linear: made on the nodes of a model, and solved.
#pragma once

#include "src/model/finite_model.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// The body at finite strain on the model's nodes and cut; it begins where the body `before` (null: none) has come to.
/// Throws as FiniteModel.
void make_finite(SessionState& state, BodyModel& model, const BodyModel* before = nullptr);

/// The same away from the session, for a body that takes over later and then goes on from the one before it. Nodes and
/// cut are those of `model`; `wanted`: nodes that a tool may touch there.
void make_finite_apart(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                       const std::vector<int>& wanted, BodyModel& model);

/// Such a body takes over from the one before, in equilibrium at the time and with the tool of its last solution; it
/// may be a linear one, and then nothing is done. Throws NumericalError where there is no equilibrium.
void take_over_finite(const BodyModel& before, BodyModel& next, SessionProfile& profile);

/// Goes on to equilibrium at `time`, s, with the tool at a pose (empty: there is none). Throws NumericalError.
void solve_finite(double time, const std::optional<topology::ToolPose>& pose, BodyModel& model,
                  SessionProfile& profile);

} // namespace spherecut::app
