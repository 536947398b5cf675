// Equilibria of a body at finite strain, step by step along a path of prescribed displacements, loads and tool poses.
//
// Quasi-Newton: L-BFGS preconditioned by the factor of the stress-free stiffness, or of the tangent at a state that has
// been where that pays, carried by nodal Piola maps that are fixed during a solve, with the memory of steps kept from
// solve to solve. A line search on the energy refuses states
// that are inverted. Start: the last two states extrapolated, or the response of the rest operator. A step that does
// not converge is halved; where that does not help, Newton's method takes over.
#pragma once

#include "solvers/finite/contact.hpp"
#include "solvers/finite/lips.hpp"
#include "solvers/finite/step_memory.hpp"

#include <optional>
#include <utility>

namespace spherecut::solvers {

enum class FiniteMethod { quasi_newton, newton };
std::string_view to_string(FiniteMethod method);
/// Throws InputError naming the value and the two allowed names: quasi_newton, newton.
FiniteMethod finite_method_from_string(std::string_view name);

struct EquilibriumOptions {
  FiniteMethod method = FiniteMethod::quasi_newton;
  /// Norm of the unbalanced forces over that of the forces that act: of loads, pre-strain, held surface and tool, and
  /// that of a tool with friction, or bonded, at the end of the step before: it may pass through zero, or let go.
  double tolerance = 1e-3;
  int maximum_iterations = 100; // of one step; then it is halved
  int halvings = 6;             // of a step, before Newton's method is asked
  int memory = 20;              // steps that are remembered
  double least_jacobian = 0.01; // the line search stops short of it
  double penetration = 1e-3;    // of the tool into the middles of shares, and of lips into each other, in spacings
  /// Change of the forces along the tool's surface by a last round, over the tool's forces; not below the tolerance.
  double unsettled = 1e-3;
  bool fall_back = true; // whether Newton's method is asked at all
  /// Iterations beyond `few_iterations` a step, summed over steps, after which the tangent at the present state
  /// preconditions in place of that at rest: what assembling and factoring it takes, in iterations. 0: never.
  int worth_of_tangent = 30;
  int few_iterations = 4;
};

/// What the body is to be in equilibrium with.
struct FiniteLoading {
  std::vector<Vector3> prescribed;          // m, one per entry of the problem; empty: those of the problem
  double load_factor = 1;                   // of the problem's loads
  std::optional<topology::ToolPose> tool{}; // needs a contact; empty: no tool
  VectorX forces{};                         // N, 3 a node, dead, beside those of the loads; empty: none
  double tolerance = 0;                     // in place of that of the options; 0: that it is
  VectorX advances{};                       // m, of each edge (set_edges()); empty: they are where they were
};

struct EquilibriumStatus {
  bool converged = false;
  int iterations = 0, evaluations = 0, line_searches = 0; // line searches: of more than one evaluation
  int steps = 0, halvings = 0, factorisations = 0, newton_steps = 0;
  double residual = 0;                   // unbalanced over acting forces
  double least_jacobian = 1;             // of all points
  double energy = 0;                     // J, strain energy
  int touching = 0;                      // shares that touch the tool
  int closed = 0;                        // pairs of lips that touch each other
  int pressing = 0;                      // edges that press
  double penetration = 0;                // in spacings, of the tool or of lips, or of what is bonded off its place
  Vector3 tool_force = Vector3::Zero();  // N, of the body on the tool
  Vector3 tool_torque = Vector3::Zero(); // N m, of the same about the tool's point
  Vector3 friction = Vector3::Zero();    // N, the part of tool_force that friction exerts along the tool's surface
  double friction_work = 0;              // J, taken by friction on the way
};

class Equilibrium {
 public:
  /// The body outlives it, and is used by one of these at a time. `before`: of a body with a shorter cut, whose cut
  /// appends.
  explicit Equilibrium(const FiniteBody& body, const EquilibriumOptions& options = {}, const CutLineage& before = {});
  [[nodiscard]] const CutLineage& lineage() const { return rest_.lineage(); }

  /// The tool that presses, and the nodes that it may touch; as FiniteContact. With friction, or bonded, what happens
  /// depends on the way: a solve then goes there in strides of a tenth, or half, of the tool's tip radius, and where
  /// the tool was nowhere it comes back along its axis from where it is clear of all candidates.
  void set_contact(const topology::ToolShape& tool, const std::vector<int>& candidates,
                   const FiniteContactOptions& options = {});
  /// A tool at that pose holds the shares of these nodes from now on, in place of any other tool: they move with it as
  /// with a rigid body.
  void take_hold(const topology::ToolShape& tool, const topology::ToolPose& pose, const std::vector<int>& nodes);
  /// There is no tool any more.
  void let_go();
  /// Faces of a cut that do not go through each other; as FiniteLips.
  void set_lips(std::vector<LipPair> pairs);

  /// Pieces of the edge of a blade, in place of those before, and the forces that they are taken to bear at first, N:
  /// each keeps its mean, along its direction, beyond its advance (FiniteLoading::advances). None: there is no blade.
  void set_edges(std::vector<UnilateralMean> edges, std::vector<double> forces = {});
  [[nodiscard]] const UnilateralMeans* edges() const { return edges_ ? &*edges_ : nullptr; }

  /// Goes from the present state to equilibrium with the loading. Throws NumericalError in words when there is none to
  /// be found (with residual, least J, the part of the step reached and the condition of the rest operator), InputError
  /// for a loading that does not fit the body, and what a law of functions throws: the state is then what it was
  /// before.
  EquilibriumStatus solve(const FiniteLoading& loading);

  [[nodiscard]] const VectorX& coefficients() const { return state_.coefficients; } // m, 3 a node
  /// Begins from these, as from a state with that part of the loads and the tool there (empty: nowhere), to which a
  /// halved step goes back. Nothing is remembered of the way, nor of forces of contact, but `shares`, one a candidate
  /// (empty: nothing touches).
  void set_coefficients(const VectorX& coefficients, double load_factor = 0,
                        const std::optional<topology::ToolPose>& tool = std::nullopt,
                        std::vector<ContactShare> shares = {});
  /// Of every candidate of the contact, as the last solve has left them.
  [[nodiscard]] const std::vector<ContactShare>& contact_shares() const { return state_.shares; }
  /// Force of the constraint of every prescribed entry on the body, N.
  [[nodiscard]] const std::vector<Vector3>& constraint_forces() const { return reactions_; }
  [[nodiscard]] const FiniteContact* contact() const { return contact_ ? &*contact_ : nullptr; }
  /// Displacements of the middles of candidates' shares to small forces on them in the present state, the tool taken
  /// away, faces of cuts that touch held together: the response of the rest operator, carried by the deformation.
  /// `chosen`: places in contact()->candidates(). 3 rows and columns each, symmetric, m/N. Throws InputError without a
  /// contact.
  [[nodiscard]] MatrixX contact_compliance(const std::vector<int>& chosen);
  /// Displacements that small nodal forces, N, 3 a node, cause in the present state, tool and lips as they touch, edges
  /// taken away: a column each, m. By the rest operator, as contact_compliance().
  [[nodiscard]] MatrixX responses(const MatrixX& forces);
  [[nodiscard]] const FiniteLips* lips() const { return lips_ ? &*lips_ : nullptr; }

 private:
  struct State {
    VectorX coefficients;
    std::vector<Vector3> prescribed;
    double load_factor = 0;
    std::optional<topology::ToolPose> tool;
    std::vector<ContactShare> shares; // of the contact
    std::vector<double> lip_forces, edge_forces;
    VectorX forces, advances; // as those of the loading
    double gripped = 0;       // N, norm of the nodal forces of a tool that is not without friction
  };
  struct CarriedTangent { // at a state that has been
    CarriedTangent(RestOperator tangent, std::vector<Matrix3> maps_back)
        : matrix(std::move(tangent)), back(std::move(maps_back)) {}
    RestOperator matrix;
    std::vector<Matrix3> back; // inverse of the maps from the stress-free body to that state, a node each
  };
  struct Trial { // an evaluation
    VectorX coefficients, residual;
    double energy = 0, acting = 0, strain_energy = 0, least_jacobian = 0;
    std::vector<Vector3> reactions;
    bool usable = false;
  };
  [[nodiscard]] State target_of(const FiniteLoading& loading) const;
  [[nodiscard]] State between(const State& from, const State& to, double part) const;
  [[nodiscard]] bool minds_way() const; // the contact does: it rubs or bonds
  [[nodiscard]] int strides(const State& target) const;
  /// Maps that carry the body of the preconditioner to a state, given those of its nodes from rest.
  [[nodiscard]] std::vector<Matrix3> carrying(std::vector<Matrix3> maps) const;
  [[nodiscard]] const RestOperator& preconditioner() const { return tangent_ ? tangent_->matrix : rest_; }
  void renew_preconditioner(const EquilibriumStatus& status);
  void set_tangent(std::unique_ptr<CarriedTangent> tangent);
  /// Whether a solve has taken all that it may by this method.
  [[nodiscard]] bool is_spent(FiniteMethod method, const EquilibriumStatus& status) const;
  bool go(const State& target, int halvings, EquilibriumStatus& status);
  bool step(const State& target, FiniteMethod method, EquilibriumStatus& status);
  bool begin_step(const State& target, Trial& now, EquilibriumStatus& status);
  bool settle(const State& target, FiniteMethod method, Trial& now, EquilibriumStatus& status);
  void accept_step(const State& target, const Trial& now, EquilibriumStatus& status);
  /// Iterates with the forces of contact known so far, until what is unbalanced is `tolerance` of what acts.
  bool iterate(const State& target, FiniteMethod method, double tolerance, Trial& now, EquilibriumStatus& status);
  void evaluate(const VectorX& coefficients, const State& target, Trial& trial, EquilibriumStatus& status);
  [[nodiscard]] double extrapolation(const State& target) const;
  [[nodiscard]] VectorX predict(const State& target);
  [[nodiscard]] VectorX precondition(const VectorX& residual);
  [[nodiscard]] std::vector<ActiveConstraint> active_constraints(const std::vector<Matrix3>& maps,
                                                                 bool with_edges = true) const;
  /// What nodal forces move the body by, with these maps that carry the preconditioner's and these constraints.
  [[nodiscard]] VectorX answer_of(const VectorX& forces, const std::vector<Matrix3>& maps,
                                  const std::vector<ActiveConstraint>& constraints);
  /// Keys of the constraints that were active at the last evaluation.
  [[nodiscard]] std::vector<int> touching() const;
  /// Deepest that the tool lies in the body or lips in each other at the last evaluation, spacings.
  [[nodiscard]] double deepest(const State& target) const;
  /// Whether the forces along the tool's surface are those of the places found.
  [[nodiscard]] bool is_settled(const State& target, const Trial& now) const;
  [[nodiscard]] VectorX newton_direction(const Trial& now, EquilibriumStatus& status);
  [[nodiscard]] VectorX motion(const State& from, const State& to) const;

  const FiniteBody& body_;
  EquilibriumOptions options_;
  RestOperator rest_;
  std::optional<FiniteContact> contact_;
  std::optional<FiniteLips> lips_;
  std::optional<UnilateralMeans> edges_;
  std::unique_ptr<CarriedTangent> tangent_; // null: the rest operator preconditions
  int excess_ = 0;                          // iterations beyond the few of a step since that was chosen
  ConstraintResponses responses_;           // of the preconditioner
  struct RestCompliance {                   // between candidates' shares, of the preconditioner as it is
    std::vector<int> chosen;
    MatrixX matrix; // m/N
  };
  RestCompliance rest_compliance_;
  StepMemory memory_;
  State state_, before_;
  bool has_before_ = false;
  std::vector<Matrix3> maps_; // from the stress-free state, a node each
  FiniteForces forces_;
  std::vector<Vector3> reactions_;
  double least_seen_ = 1, last_residual_ = 0, last_unsettled_ = 0;
  double tolerance_ = 0;        // of this solve
  double prestrain_forces_ = 0; // N, norm of those that the pre-strain of the body at rest exerts
};

} // namespace spherecut::solvers
