// Contact of a rigid tool with the deformed surface: without friction, with Coulomb's, or bonded. Each candidate node
// stands for its share of the surface, whose middle x_c must not lie within the tool: an augmented Lagrangian [Alart
// and Curnier 1991],
//
//   E = sum_c (<l_c - k_c g_c>^2 - l_c^2) / (2 k_c),   g_c the distance of the tool, l_c the force known so far,
//
// whose minimum has forces <l_c - k_c g_c> along the tool's normals. Friction adds, for a limit L_c = mu <l_c - k_c
// g_c> that stands during a round of iterations, and s_c the way along the tool's surface from where the share sticks,
//
//   phi(q_c) - |t_c|^2 / (2 k_c),   q_c = t_c - k_c s_c,
//   phi(q) = |q|^2 / (2 k_c) up to |q| = L_c, (L_c |q| - L_c^2 / 2) / k_c beyond,
//
// with forces q_c returned to the disc |t| <= L_c: below the limit the share sticks, at it it slips. After a round
// limits and tangent planes are those of the state found. A bonded share has the whole of x_c less its place on the
// tool in place of s_c, and no limit.
#pragma once

#include "solvers/contact/solver.hpp"
#include "solvers/finite/active_constraints.hpp"
#include "topology/tool/tool.hpp"

#include <optional>

namespace spherecut::solvers {

struct FiniteContactOptions {
  ContactCondition condition = ContactCondition::frictionless;
  double friction = 0;   // frictional: Coulomb's coefficient
  double stiffness = 20; // k_c over E a_c / h
};

/// What a contact keeps of a share from step to step.
struct ContactShare {
  double pressing = 0;              // N, along the tool's normal; bonded: 0
  Vector3 along = Vector3::Zero();  // N on the body, along the tool's surface; bonded: all of the force
  Vector3 anchor = Vector3::Zero(); // m, where it sticks to the tool at the pose of this state
  bool touches = false;             // has an anchor; once bonded, for good
};

class FiniteContact {
 public:
  /// Throws InputError for a tool that topology::check refuses, options out of their range, and a node that is not on
  /// the surface.
  FiniteContact(const FiniteBody& body, topology::ToolShape tool, const std::vector<int>& candidates,
                const FiniteContactOptions& options = {});

  [[nodiscard]] const topology::ToolShape& tool() const { return tool_; }
  [[nodiscard]] const std::vector<int>& candidates() const { return nodes_; }
  [[nodiscard]] const FiniteContactOptions& options() const { return options_; }
  [[nodiscard]] const topology::ToolPose& pose() const { return pose_; }
  /// Middle of a candidate's share, m.
  [[nodiscard]] Vector3 place(int candidate, const VectorX& coefficients) const {
    return rest_[candidate] + means_[candidate].of(coefficients);
  }
  /// Where the tool stands clear of all shares: back along its axis from the pose.
  [[nodiscard]] topology::ToolPose clear_pose(const topology::ToolPose& pose, const VectorX& coefficients) const;
  /// Of every candidate: the middle of its share at rest, m, and the mean over it.
  [[nodiscard]] const std::vector<Vector3>& places() const { return rest_; }
  [[nodiscard]] const std::vector<DisplacementMean>& means() const { return means_; }
  /// The tool is nowhere: nothing touches.
  void release();

  /// The tool goes from one pose (empty: it was nowhere) to another; `shares` and `coefficients` are those at the
  /// first. What sticks goes along with it; what is free would stick where the tool meets it on its way.
  void begin_step(const std::optional<topology::ToolPose>& from, const topology::ToolPose& to,
                  std::vector<ContactShare> shares, const VectorX& coefficients);
  /// Adds the slope of the energy to `forces` and returns the energy, J. Remembers what touches.
  double add(const VectorX& coefficients, VectorX& forces);
  /// Limits of friction and the planes along which it acts become those of the last call of add(); what a bonding tool
  /// had overtaken then is held. True: something is held that was not.
  bool renew();
  /// The forces at the last call of add() become those that are known.
  void accept_forces();
  /// The step ends at the last call of add(): what has slipped sticks where it is.
  [[nodiscard]] std::vector<ContactShare> end_step();
  /// All candidates held where they are at the coefficients, without force.
  [[nodiscard]] std::vector<ContactShare> held(const VectorX& coefficients) const;

  /// At the last call of add(): what the tool gets, N, and N m about its point; the part of that force which acts along
  /// its surface, none of what is bonded; the largest depth of a middle in the tool, or gap of one that bears a force,
  /// over the spacing there; norm of the nodal forces' change from those of the known forces along the surface; how
  /// many shares touch; norm of the nodal forces.
  [[nodiscard]] Vector3 tool_force() const;
  [[nodiscard]] Vector3 tool_torque() const;
  [[nodiscard]] Vector3 friction_force() const;
  [[nodiscard]] double deepest() const { return deepest_; }
  [[nodiscard]] double unsettled() const;
  [[nodiscard]] int touching() const { return static_cast<int>(active_.size()); }
  [[nodiscard]] double force_norm() const { return force_norm_; }
  /// Force on the body of every candidate, N.
  [[nodiscard]] std::vector<Vector3> forces() const;
  /// J, that friction has taken in the step which ended last.
  [[nodiscard]] double friction_work() const { return friction_work_; }

  /// Adds the shares in touch, their directions carried back by `maps` (may be empty); their keys are from 0 on.
  void append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const;

 private:
  struct Active {
    int candidate;
    Vector3 normal;   // out of the tool
    double pressing;  // N, at least 0
    Vector3 along;    // N on the body
    double looseness; // |q| over the limit; at most 1: it sticks
  };
  [[nodiscard]] bool bonds() const { return options_.condition == ContactCondition::bonded; }
  [[nodiscard]] bool rubs() const { return options_.condition == ContactCondition::frictional; }
  /// What a share bears along the tool's surface, or bonded; returns the energy.
  double add_grip(std::size_t c, Active& active) const;

  const FiniteBody& body_;
  topology::ToolShape tool_;
  FiniteContactOptions options_;
  topology::ToolPose pose_;
  std::optional<topology::ToolPose> from_; // where the step has begun
  std::vector<int> nodes_;
  std::vector<DisplacementMean> means_;
  std::vector<Vector3> rest_;       // m, middles of the shares on the surface
  std::vector<double> stiffness_;   // N/m
  std::vector<ContactShare> known_; // forces so far, anchors at the pose
  std::vector<double> limits_;      // N, of friction in this round
  std::vector<Vector3> planes_;     // normals of the tangent planes in this round
  std::vector<Vector3> places_;     // m, at the last call of add()
  std::vector<topology::DistanceAndNormal> gaps_;
  std::vector<Active> active_;
  double deepest_ = 0, force_norm_ = 0, friction_work_ = 0;
};

} // namespace spherecut::solvers
