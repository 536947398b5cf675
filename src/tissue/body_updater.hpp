// The ways in which the body of a session comes about: built, following its cut by an update, built anew behind it,
// taken back. A cut that only appends is followed by what it appends; behind any other, a blade's or a tear's, nodes
// beside what is new are exchanged and the system is built anew. What is made in the background is described here too
// (BackgroundBodies).
#pragma once

#include "src/tissue/contact_solver.hpp"

namespace spherecut::app {

/// An increment of the cut, for a body to follow.
struct CutGrowth {
  std::string renewed{}; // why all nodes are made anew; empty: those beside it are
  bool beside = false;   // the body as it is stays
};

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

  /// Nodes and body of `next`, which has the new cut: of what was there, what the cut did not touch stays. Throws
  /// InputError and NumericalError; take_back_cut() is then to be called.
  void build_cut(const CutGrowth& growth, BodyModel& next, BodyUpdate& report);
  /// Leads the fine zone along with the fronts of a tear. Returns why all nodes are to be made anew for its increment;
  /// empty: they are not.
  [[nodiscard]] std::string lead_zone(const topology::Incision& incision);
  /// After a cut that was refused: incision, wound and body as they were. `body`: that of the model before. True: it is
  /// another, of the same nodes, that has to be solved. Throws NumericalError where it cannot be had again.
  bool take_back_cut(const solvers::Discretisation* body);

  /// What makes a body that has followed the tool: with the fine zone about `centre`.
  [[nodiscard]] BackgroundBodies::Make following_tool(const topology::SurfaceContact& centre) const;
  /// What makes the body with this cut, on the nodes that a step would have made. `reason`: why it is made there.
  [[nodiscard]] BackgroundBodies::Make following_cut(const std::shared_ptr<const topology::Incision>& incision,
                                                     const char* reason) const;

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
