// What the parts of a session work on together: the setting, which stays, and the tissue as it is.
#pragma once

#include "src/model/incision_builder.hpp"
#include "src/model/organ.hpp"
#include "src/model/rest_place.hpp"
#include "src/scenario/schedule.hpp"
#include "src/tissue/fine_zone_tracker.hpp"
#include "src/tissue/options.hpp"

namespace spherecut::app {

/// Wall clock of each stage, s, summed over the run.
struct SessionProfile {
  double organ = 0, sprinkle = 0, discretise = 0, condense = 0, press = 0, evaluate = 0, topology = 0, level_sets = 0;
  double intensities = 0; // at the fronts of tears
};

/// What a step had to do with a body that was built or updated.
enum class Rebuild : std::uint8_t {
  none,
  in_step,             // it did that, or waited for it
  in_background,       // it took over what had been made in the background
  in_background_early, // before the blade had gone a third of the way on which it need not wait
};

/// Who leads the tool: the scenario's path, or a device, to which the path says no more than where nodes are fine at
/// first.
enum class Leader : std::uint8_t { path, device };

/// Holds between steps: `model` is the body that the next step presses; the cut of `incisions` is that of the body, or
/// ahead of it while a blade's next cut is under way, and `shown_wound` is there in just that case.
struct SessionState {
  /// Makes and checks the organ, and the spacings that its nodes will have. Throws InputError.
  SessionState(Scenario scenario_in, std::function<void(const std::string&)> say, Leader leader);
  SessionState(const SessionState&) = delete;
  SessionState& operator=(const SessionState&) = delete;

  // The setting: the same in all steps.
  Leader leader;
  Scenario scenario;
  SessionLog log;
  SessionProfile profile;
  Organ organ;
  topology::ContactQuery query;                    // of its surface at rest
  std::optional<FirstTouch> touch;                 // empty: there is no tool, or its path never touches the organ
  std::vector<StepSample> steps;                   // of the scenario
  std::function<double(const Vector3&)> toughness; // J/m2, in the tissue at rest
  SessionOptions options;

  // The tissue.
  FineZoneTracker zone;
  std::unique_ptr<IncisionBuilder> incisions; // null in a scenario without cuts
  BodyModel model;
  std::optional<topology::Wound> shown_wound; // of the body while the cut is ahead of it; empty: that of the cut

  // What the last step has found.
  std::optional<topology::SurfaceContact> contact; // on the surface at rest
  VectorX displacements;                           // m, 3 a node
  std::vector<solvers::PointState> node_states;
  Rebuild rebuild = Rebuild::none; // since the last step

  /// Where a place of the body was at rest.
  [[nodiscard]] Vector3 rest_of(const Vector3& x) const {
    return rest_position(x, model, *organ.domain, zone.spacing());
  }
  [[nodiscard]] topology::RestMap to_rest() const {
    return [this](const Vector3& x) { return rest_of(x); };
  }
  /// The same, and empty before the first solution, when everything is at rest.
  [[nodiscard]] topology::RestMap to_rest_if_moved() const { return model.solved() ? to_rest() : topology::RestMap{}; }
  /// The surface with the cut of the body; null in a scenario without cuts.
  [[nodiscard]] const topology::Wound* wound() const {
    return incisions == nullptr ? nullptr : shown_wound ? &*shown_wound : &incisions->wound();
  }
  /// Nothing severed is held by no fixed region, or cut.unheld allows it, and all pieces are large enough for the
  /// nodes. Throws InputError where not.
  void check_pieces(double time);
  /// Why the body cannot follow its cut; empty: it can.
  [[nodiscard]] std::string hindrance() const;
};

} // namespace spherecut::app
