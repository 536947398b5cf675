// The ways in which the body of a session comes about: built, following its cut by an update, built anew behind it,
// taken back. Of a cut, a blade's or a tear's, nodes beside what is new are exchanged and the system is updated where
// it is touched; where that cannot be, or does not pay, it is built anew. What is made in the background is described
// here too (BackgroundBodies), and a body that has been condensed anew there (WindowRenewal) takes over here.
#pragma once

#include "src/tissue/contact_solver.hpp"
#include "src/tissue/window_renewal.hpp"

namespace spherecut::app {

/// An increment of the cut, for a body to follow.
struct CutGrowth {
  std::function<topology::SurfaceMesh()> way_ahead; // where the cut is going to be next
  std::string renewed{};                            // why all nodes are made anew; empty: those beside it are
  bool window_pays = true;                          // for later increments to be followed
  bool beside = false;                              // the body as it is stays
};

class BodyUpdater {
 public:
  /// These must outlive it.
  BodyUpdater(SessionState& state, ContactSolver& contact, const Grasping& grasping, BackgroundBodies& background,
              WindowRenewal& renewal);

  /// A model without body, to come after the present one: touched as that, with the cut as it is now.
  [[nodiscard]] BodyModel next() const;
  /// Nodes of a model: fresh ones, or those of `previous` that still fit and new ones.
  void sprinkle(const solvers::NodeCloud* previous, BodyModel& model) const;
  /// Assembles and condenses the body on the model's nodes. What is under way in the background is dropped.
  void build(BodyModel& model);
  /// Assembles it alone, for a way of the cut ahead (no triangles: none) and for these candidates.
  void assemble(BodyModel& model, const topology::SurfaceMesh& way_ahead, const std::vector<int>& near);

  /// Nodes and body of `next`, which has the new cut: of what was there, what the cut did not touch stays. Throws
  /// InputError and NumericalError; take_back_cut() is then to be called.
  void build_cut(const CutGrowth& growth, BodyModel& next, BodyUpdate& report);
  /// Whether nodes are to be made anew for an increment of a tear, and why; leads the fine zone along with the fronts.
  void lead_zone(const topology::Incision& incision, CutGrowth& growth);
  /// By how the nodes changed when the body last followed a cut; null: it was made anew.
  [[nodiscard]] const solvers::SprinkleIncrement* followed() const { return followed_ ? &*followed_ : nullptr; }
  /// After a cut that was refused: incision, wound and body as they were. `body`: that of the model before. True: it is
  /// another, of the same nodes, that has to be solved. Throws NumericalError where it cannot be had again.
  bool take_back_cut(const solvers::Discretisation* body);

  /// What makes a body that has followed the tool: with the fine zone about `centre`.
  [[nodiscard]] BackgroundBodies::Make following_tool(const topology::SurfaceContact& centre) const;
  /// What makes the body with this cut, on the nodes that a step would have made. `reason`: why it is made there.
  [[nodiscard]] BackgroundBodies::Make following_cut(const std::shared_ptr<const topology::Incision>& incision,
                                                     const char* reason) const;
  /// The body that has been condensed anew takes over, after waiting for it. False: it could not follow.
  bool take_renewed();

 private:
  [[nodiscard]] solvers::SprinkleOptions sprinkle_options(const BodyModel& model) const;
  [[nodiscard]] solvers::BodyGrowth follow_cut(const std::function<topology::SurfaceMesh()>& way_ahead, BodyModel& next,
                                               BodyUpdate& report);
  void build_finite_cut(BodyModel& next, BodyUpdate& report) const;
  [[nodiscard]] bool spacing_stays() const;
  void condense_again();

  SessionState& state_;
  const Scenario& scenario_;
  const Organ& organ_;
  BodyModel& model_;
  ContactSolver& contact_;
  const Grasping& grasping_;
  BackgroundBodies& background_;
  WindowRenewal& renewal_;
  std::optional<solvers::SprinkleIncrement> followed_; // by the body of the last cut
};

} // namespace spherecut::app
