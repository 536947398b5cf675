// The tears of a session: fronts that are given more energy than new cut takes move, increment by increment, until they
// are not, or nothing is left to tear. The tool stands still meanwhile.
#pragma once

#include "src/session/resisted_blade.hpp"
#include "src/session/step_result.hpp"

namespace spherecut::app {

/// What a step has done before it tears.
struct Loading {
  bool releases = false;  // a grasper has let go
  double cut_surface = 0; // J, that a blade's cut takes
};

/// What the last step has left for the next one's account.
struct TearAccount {
  EnergyLedger ledger;
  Energies last;
  Vector3 force = Vector3::Zero();        // N, on the tool
  std::optional<topology::ToolPose> pose; // of the tool
  double time = 0;                        // s
  double area = 0;                        // m2 torn
  double decay = 0;                       // 1/m, of the release rate with the way of the front, as last seen
  bool grows = false;                     // it has in the last step
  double start = 0;                       // G / G_c when the growth at this load began
  int kept = 0;                           // increments since then that have left most of it
  bool told = false;                      // that it is unstable
};

class TearPropagation {
 public:
  /// All of these must outlive it; `blade` null: none is resisted.
  TearPropagation(SessionState& state, Grasping& grasping, ContactSolver& contact, BackgroundBodies& background,
                  BodyUpdater& updater, const TearFronts& fronts, ResistedBlade* blade);

  /// Tears the solved body as far as it goes in this step; the result's tear and cut tell of it. An increment that
  /// cannot be computed is taken back, and the report says why. Throws NumericalError where that cannot be.
  void tear(const StepSample& sample, const Loading& loading, StepResult& result);

 private:
  class Loop;
  void book_loading(const StepSample& sample, const Loading& loading);
  [[nodiscard]] bool follows_load(const StepSample& sample, const Loading& loading) const;
  bool take(const StepSample& sample, const std::function<void()>& grow, TearReport& report, BodyUpdate& update);
  void build(const StepSample& sample, std::optional<Grasp>& lost, BodyUpdate& update);

  SessionState& state_;
  Grasping& grasping_;
  ContactSolver& contact_;
  BackgroundBodies& background_;
  BodyUpdater& updater_;
  const TearFronts& fronts_;
  ResistedBlade* blade_;               // null: none is resisted
  std::optional<TearAccount> account_; // empty before the first solution
};

} // namespace spherecut::app
