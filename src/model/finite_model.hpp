// The body of a scenario whose law is not linear: at finite strain, in equilibrium with its weight, its pre-strain, the
// pressure in its cuts and a tool that presses, rubs, bonds or holds. The faces of its cuts do not go through each
// other.
#pragma once

#include "solvers/contact/blade_contact.hpp"
#include "solvers/finite/equilibrium.hpp"
#include "solvers/fracture/tearing.hpp"
#include "src/model/body_model.hpp"

namespace spherecut::app {

/// Throws InputError naming file, line, what a run cannot compute with the scenario's law and what it can.
void require_run(const Scenario& scenario);
[[nodiscard]] bool can_run(const Scenario& scenario);

/// One equilibrium.
struct FiniteStep {
  Vector3 force = Vector3::Zero(); // N, of the body on the tool
  /// N, the part of it along the surface: with friction that of the tool, bonded or held that of the deformed body.
  Vector3 tangential = Vector3::Zero();
  Vector3 torque = Vector3::Zero(); // N m, of the same about the tool's point
  double contact_radius = 0;        // m, as ContactState::contact_radius
  int active_nodes = 0, iterations = 0;
  int closed_pairs = 0; // of lips that touch each other
  double residual = 0;  // norm of the unbalanced forces over that of the acting ones
  double least_jacobian = 1;
  double penetration = 0;   // m, deepest that corners and middles of the surface's triangles lie in the tool
  double energy = 0;        // J, of the strain
  double loads = 0;         // J, forces of the loads, which are dead, times displacement
  double friction_work = 0; // J, taken by the friction of the tool on the way from the last solution
};

/// How long an equilibrium is looked for that may not be there: a hand would wait for seconds, and its next pose may
/// have one.
enum class Patience : std::uint8_t { of_a_run, of_a_hand };

/// The edge of a blade against the body, and the body without it.
struct PressedEdge {
  std::vector<solvers::EdgeContact> contacts;
  MatrixX patterns;      // a unit of every entry of the patch, on the functions
  VectorX free;          // coefficients, m
  VectorX moved, acting; // m and N, of every entry when it was pressed; empty: not yet
  VectorX way, forces;   // by which they have changed up to then
  double potential = 0;  // J, of strain and loads
  std::vector<solvers::ContactShare> shares;
  FiniteStep pressed; // the last equilibrium with it
};

class FiniteModel {
 public:
  /// The body on nodes, cut and lips of `nodes`. `touched`: whether a tool may come to it. Throws as require_run() and
  /// solvers::FiniteBody.
  FiniteModel(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain, const BodyModel& nodes,
              bool touched, Patience patience);

  /// Begins where another body of the same organ, on other nodes or with less of the cut, has come to. Friction and
  /// bonds go on at the nodes that both have.
  void go_on_from(const BodyModel& before);
  /// Begins at rest again, where nothing is lost by that: friction, bonds and a grasper remember their way.
  void begin_anew();
  [[nodiscard]] bool may_begin_anew() const;

  /// The tool, a grasper at that pose, takes hold of these nodes, where they are now.
  void take_hold(const std::vector<int>& nodes, const topology::ToolPose& pose);
  /// It holds these, of this body, as it held those nearest to them of the body before.
  void hold_on(const std::vector<int>& nodes, const FiniteModel& before);
  void let_go();
  /// A share that touches the tool: its middle at rest, and the nodes' spacing there, m.
  struct Touch {
    Vector3 place;
    double spacing;
  };
  [[nodiscard]] std::vector<Touch> touches() const;

  /// Goes on to equilibrium at `time`, s, with the loads and the tool, which is nowhere when it has no pose. Throws
  /// NumericalError: the state is then what it was before, but that a viscoelastic body may have come to rest under its
  /// loads, as it does before its first step.
  FiniteStep solve(double time, const std::optional<topology::ToolPose>& pose);

  /// The same from the body at rest. Throws as solve().
  FiniteStep solve_from_rest(double time, const std::optional<topology::ToolPose>& pose);

  /// Pieces of a blade's edge against the body as it is without blade, as solvers::condense_blade(): the forces on them
  /// act along their pushes in space, on what has been ahead of the edge at rest. Throws InputError without contacts.
  [[nodiscard]] solvers::BladePatch edge_patch(const std::vector<solvers::EdgeContact>& contacts, double half_width,
                                               const solvers::ForcePattern& flanks);
  /// Equilibrium with the edge of a patch of this body at `advance`, m, its flanks dragging by `drag`; the patch
  /// becomes that of small motions about it. All else here goes on telling of the body without blade. Throws as
  /// solve().
  void press_edge(const VectorX& advance, double drag, solvers::BladePatch& patch);
  /// There is no blade any more.
  void leave_edge();
  [[nodiscard]] bool is_pressed() const { return edge_.has_value(); }
  /// What a direction in space has been at rest, at a place of the body at rest.
  [[nodiscard]] Vector3 turned_back(const Vector3& x, const Vector3& direction) const;
  /// Whether what is asked of the last solution is told of the body under the blade.
  void show_pressed(bool pressed) { shows_pressed_ = pressed; }
  [[nodiscard]] const VectorX& pressed_coefficients() const { return equilibrium_.coefficients(); }

  /// Displacement, its gradient F - I, Green's strain and Cauchy stress at a place of the body at rest, the pressure
  /// from the volume ratio there. Throws InputError where no sphere covers it.
  [[nodiscard]] solvers::PointState at(const Vector3& x) const;
  /// Shape functions there, with which the displacement is a sum over coefficients. Throws as at().
  void shape_at(const Vector3& x, solvers::ShapeFunctions& shape) const;
  [[nodiscard]] const solvers::Spheres& spheres() const { return body_.spheres(); }
  [[nodiscard]] int functions() const { return body_.functions(); }
  /// What the body with a longer cut goes on from, where cuts only append.
  [[nodiscard]] const solvers::CutLineage& lineage() const { return equilibrium_.lineage(); }
  [[nodiscard]] bool solved() const { return last_.has_value(); }
  /// Of the last solution: time, s, pose of the tool, and what else there is to tell.
  [[nodiscard]] double time() const { return *time_; }
  [[nodiscard]] const std::optional<topology::ToolPose>& pose() const { return pose_; }
  [[nodiscard]] const FiniteStep& last() const { return edge_ && shows_pressed_ ? edge_->pressed : *last_; }
  [[nodiscard]] const VectorX& coefficients() const { // 3 a function, m
    return edge_ && !shows_pressed_ ? edge_->free : equilibrium_.coefficients();
  }
  /// Gap of every pair of lips along its normal, m.
  [[nodiscard]] std::vector<double> openings() const;
  [[nodiscard]] VectorX nodal_displacements() const; // 3 a node, m
  /// What drives the fronts of its cut in the last solution, at places `spacing` m apart; `toughness`, J/m2, of the
  /// body at rest. Throws as solvers::front_states().
  [[nodiscard]] std::vector<solvers::FrontState> front_states(const std::function<double(const Vector3&)>& toughness,
                                                              double spacing) const;
  /// The last solution as a loop wants it that asks for the force at other poses of the tool: displacements = base +
  /// compliance * forces, exact at this pose, the compliance that of small motions about it. `wanted`: free nodes of
  /// the surface; those that touch the tool join them.
  void condense(const std::vector<int>& wanted, solvers::ContactPatch& patch, solvers::ContactState& state);
  /// Finds what condense() onto these nodes needs of the body at rest.
  void prepare_to_condense(const std::vector<int>& wanted);
  [[nodiscard]] int candidates() const { return static_cast<int>(candidates_.size()); }
  [[nodiscard]] int held() const { return held_nodes(body_.problem().prescribed); }

 private:
  /// Points of the organ's surface as sums over functions, in compressed rows.
  struct Skin {
    std::vector<Vector3> rest; // m
    std::vector<int> start{0}, functions;
    std::vector<double> values;
  };
  [[nodiscard]] MatrixX patterns_of(const solvers::BladePatch& patch, double half_width) const;
  [[nodiscard]] std::vector<solvers::UnilateralMean> edges_of(const PressedEdge& edge) const;
  [[nodiscard]] FiniteStep step_of(const solvers::EquilibriumStatus& status,
                                   const std::optional<topology::ToolPose>& tool,
                                   const std::optional<topology::ToolPose>& pose) const;
  [[nodiscard]] const std::vector<solvers::ContactShare>& free_shares() const { // without the blade
    return edge_ ? edge_->shares : equilibrium_.contact_shares();
  }
  FiniteStep solve_step(double time, const std::optional<topology::ToolPose>& pose);
  void lay_skin();
  [[nodiscard]] std::vector<int> places_among_candidates(const std::vector<int>& nodes) const;
  [[nodiscard]] double deepest(const topology::ToolPose& pose) const;
  void summarise_contact(FiniteStep& step) const;
  [[nodiscard]] VectorX state_from(const BodyModel& before) const;
  void set_candidates(std::vector<int> nodes);
  [[nodiscard]] Vector3 force_along_surface() const;
  [[nodiscard]] std::vector<solvers::ContactShare> shares_from(const FiniteModel& before, const VectorX& start) const;

  std::function<solvers::FibreFrame(const Vector3&)> fibres_;
  solvers::FiniteBody body_;
  solvers::Equilibrium equilibrium_;
  std::vector<int> candidates_;            // free nodes of the surface; of a grasper those that it holds
  std::vector<Vector3> rest_;              // m, of each the middle of its share
  std::optional<double> time_;             // s, of the last solution
  std::optional<topology::ToolPose> pose_; // of the tool then
  bool has_settled_ = false;               // under the loads, before the first step
  bool is_prestrained_ = false;
  solvers::FiniteLips pairs_; // for their gaps
  std::optional<FiniteStep> last_;
  std::optional<PressedEdge> edge_; // empty: there is no blade
  bool shows_pressed_ = false;
  std::optional<topology::ToolShape> tool_;
  Skin skin_;
};

} // namespace spherecut::app
