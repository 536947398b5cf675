// The body of a session whose law is not linear: made on the nodes of a model, and solved.
#pragma once

#include "src/model/finite_model.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// The body at finite strain on the model's nodes and cut; it begins where the body `before` (null: none) has come to.
/// Throws as FiniteModel.
void make_finite(SessionState& state, BodyModel& model, const BodyModel* before = nullptr);

/// Goes on to equilibrium at `time`, s, with the tool at a pose (empty: there is none). Throws NumericalError.
void solve_finite(double time, const std::optional<topology::ToolPose>& pose, BodyModel& model,
                  SessionProfile& profile);

} // namespace spherecut::app
