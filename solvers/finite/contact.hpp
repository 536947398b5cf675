// Frictionless contact of a rigid tool with the deformed surface. Each candidate node stands for its share of the
// surface, whose middle must not lie within the tool: an augmented Lagrangian [Alart and Curnier 1991],
//
//   E = sum_c (<l_c - k_c g_c>^2 - l_c^2) / (2 k_c),   g_c the distance of the tool, l_c the force known so far,
//
// whose minimum has forces <l_c - k_c g_c> along the tool's normals.
#pragma once

#include "solvers/finite/active_constraints.hpp"
#include "topology/tool/tool.hpp"

namespace spherecut::solvers {

class FiniteContact {
 public:
  /// `stiffness`: k_c over E a_c / h. Throws InputError for a tool that topology::check refuses, and for a node that is
  /// not on the surface.
  FiniteContact(const FiniteBody& body, topology::ToolShape tool, const std::vector<int>& candidates,
                double stiffness = 20);

  [[nodiscard]] const topology::ToolShape& tool() const { return tool_; }
  [[nodiscard]] const std::vector<int>& candidates() const { return nodes_; }
  /// Of every candidate: the middle of its share at rest, m, and the mean over it.
  [[nodiscard]] const std::vector<Vector3>& places() const { return rest_; }
  [[nodiscard]] const std::vector<DisplacementMean>& means() const { return means_; }
  void set_pose(const topology::ToolPose& pose) { pose_ = pose; }
  /// The tool is nowhere: nothing touches.
  void release();
  [[nodiscard]] const topology::ToolPose& pose() const { return pose_; }

  /// Adds the slope of the energy to `forces` and returns the energy, J. Remembers what touches.
  double add(const VectorX& coefficients, VectorX& forces);
  /// The forces at the last call become those that are known.
  void accept_forces();
  [[nodiscard]] std::vector<double> known_forces() const { return known_; }
  void set_known_forces(const std::vector<double>& forces) { known_ = forces; }

  /// At the last call of add(): what the tool gets, N, and N m about its point; the largest depth of a middle in the
  /// tool, or gap of one that bears a force, over the spacing there; how many shares touch; norm of the nodal forces.
  [[nodiscard]] Vector3 tool_force() const;
  [[nodiscard]] Vector3 tool_torque() const;
  [[nodiscard]] double deepest() const { return deepest_; }
  [[nodiscard]] int touching() const { return static_cast<int>(active_.size()); }
  [[nodiscard]] double force_norm() const { return force_norm_; }
  /// Force on the body of every candidate, N.
  [[nodiscard]] std::vector<Vector3> forces() const;

  /// Adds the shares in touch, their normals carried back by `maps` (may be empty); their keys are from 0 on.
  void append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const;

 private:
  struct Active {
    int candidate;
    Vector3 normal; // out of the tool
    Vector3 place;  // m, of the share's middle
    double force;   // N
  };
  const FiniteBody& body_;
  topology::ToolShape tool_;
  topology::ToolPose pose_;
  std::vector<int> nodes_;
  std::vector<DisplacementMean> means_;
  std::vector<Vector3> rest_;     // m, middles of the shares on the surface
  std::vector<double> stiffness_; // N/m
  std::vector<double> known_;     // N
  std::vector<Active> active_;
  double deepest_ = 0, force_norm_ = 0;
};

} // namespace spherecut::solvers
