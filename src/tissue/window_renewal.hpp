// Condenses a body anew in the background while updates let it follow its cut, so that no step has to do it.
#pragma once

#include "src/model/recondensing.hpp"
#include "src/tissue/blade_track.hpp"
#include "src/tissue/cut_report.hpp"
#include "src/tissue/state.hpp"

namespace spherecut::app {

/// Fine spacings ahead of the blade for which a body is condensed: in the step that needs it.
inline constexpr double way_spacings = 3;

/// A body that is condensed anew is that of the model, cut included, once it has followed what was cut meanwhile.
class WindowRenewal {
 public:
  /// These must outlive it.
  WindowRenewal(SessionState& state, const BladeTrack& blade) : state_(state), blade_(blade) {}

  /// After a step: begins one where the window has not much left of what lies ahead, is running out of room, or
  /// rounding has added up, or where the blade comes near to a body that does not follow yet. `last`: where the blade
  /// was before. Returns the residual of a body that has been looked at.
  std::optional<double> watch(const StepSample& sample, const std::optional<topology::BladePose>& last,
                              const CutReport& cut);
  /// Begins one where the blade is near to a body that does not follow yet.
  void meet_blade(const StepSample& sample, const std::optional<topology::BladePose>& last);

  /// The one under way goes with the cut that the body has just followed; `followed` null: it has not, and nobody will
  /// take that one.
  void lead(const StepSample& sample, const solvers::SprinkleIncrement* followed, const topology::RestMap& to_rest);
  void drop();
  /// Waits for it; its body becomes that of the model and `patch` its condensed patch. False: it could not follow.
  bool take(solvers::ContactPatch& patch);

  [[nodiscard]] bool is_under_way() const { return recondensing_ != nullptr; }
  [[nodiscard]] bool is_there() const { return recondensing_ != nullptr && recondensing_->ready(); }

  /// What the edge is going to sweep next, at rest.
  [[nodiscard]] topology::SurfaceMesh way_of_blade(const StepSample& sample, const topology::RestMap& to_rest) const;

 private:
  [[nodiscard]] topology::SurfaceMesh way_ahead(const StepSample& sample,
                                                const std::optional<topology::BladePose>& last, double length,
                                                const topology::RestMap& to_rest) const;
  void begin(const StepSample& sample, const std::optional<topology::BladePose>& last, double entry);
  [[nodiscard]] double way_into_body(const StepSample& sample) const;

  SessionState& state_;
  const BladeTrack& blade_;
  std::unique_ptr<Recondensing> recondensing_, given_up_; // null: none
  topology::SurfaceMesh way_;                             // for which it is condensed
};

} // namespace spherecut::app
