// The ways in which the body of a session comes about: built, following its cut by an update, built anew behind it. A
// cut that only appends is followed by what it appends; behind any other, a blade's or a tear's, nodes beside what is
// new are exchanged and the system is built anew. What is made in the background is described here too
// (BackgroundBodies).
#pragma once

#include "src/tissue/contact_solver.hpp"

namespace spherecut::app {

class BodyUpdater {
 public:
  /// These must outlive it.
  BodyUpdater(SessionState& state, ContactSolver& contact, const Grasping& grasping, BackgroundBodies& background);

  /// A model without body, to come after the present one: touched as that, with the cut as it is now.
  [[nodiscard]] BodyModel next() const;
  /// Nodes of a model: fresh ones, or those of `previous` that still fit and new ones.
  void sprinkle(const solvers::NodeCloud* previous, BodyModel& model) const;
  /// Assembles and condenses the body on the model's nodes. What is under way in the background is dropped.
  void build(BodyModel& model);
  /// Assembles it alone.
  void assemble(BodyModel& model);

  /// Nodes and body of `next`, which has the new cut: of what was there, what the cut did not touch stays. The body as
  /// it is stays, too. `renewed`: why all nodes are made anew; empty: those beside the cut are. Throws InputError and
  /// NumericalError.
  void build_cut(const std::string& renewed, BodyModel& next, BodyUpdate& report);
  /// Leads the fine zone along with the fronts of a tear. Returns why all nodes are to be made anew for its increment;
  /// empty: they are not.
  [[nodiscard]] std::string lead_zone(const topology::Incision& incision);
  /// The same for the cut of a blade: empty unless a hand leads it.
  [[nodiscard]] std::string lead_zone_by_hand(const topology::Incision& incision);

  /// What makes a body that has followed the tool: with the fine zone about `centre`.
  [[nodiscard]] BackgroundBodies::Make following_tool(const topology::SurfaceContact& centre) const;
  /// What makes the body with this cut, on the nodes that a step would have made. `reason`: why it is made there;
  /// `renewed`: as of build_cut().
  [[nodiscard]] BackgroundBodies::Make following_cut(const std::shared_ptr<const topology::Incision>& incision,
                                                     const char* reason, const std::string& renewed) const;

 private:
  [[nodiscard]] solvers::SprinkleOptions sprinkle_options(const BodyModel& model) const;
  void build_finite_cut(BodyModel& next, BodyUpdate& report) const;
  [[nodiscard]] bool spacing_stays() const;

  SessionState& state_;
  const Scenario& scenario_;
  const Organ& organ_;
  BodyModel& model_;
  ContactSolver& contact_;
  const Grasping& grasping_;
  BackgroundBodies& background_;
};

} // namespace spherecut::app
