// The force model `tangent`: the contact problem of the last solve, on its condensed compliance, solved again at every
// tick with the tool where it is now.
#pragma once

#include "src/haptics/blade_model.hpp"

#include "solvers/contact/tool_gap.hpp"

#include <array>
#include <span>

namespace spherecut::app {

/// While the body behind the snapshot stands, this is the solve itself in fewer rounds, warm from the last tick: onset,
/// spreading, sliding and loss of contact are followed, friction too (solvers/contact/friction.hpp); a bonded contact
/// goes with the tool and catches what the tool overtakes. A blade in the hand follows the condensed contact of its
/// edge (blade_model.hpp). Rounds and pivots have a fixed budget; what is left over continues in the next tick.
class TangentModel : public ForceModel {
 public:
  explicit TangentModel(const topology::ToolShape& tool);
  bool solved(const ContactSnapshot& snapshot) noexcept override;
  ModelForce at(const topology::ToolPose& pose, const Eigen::Quaterniond& orientation, double time) noexcept override;
  void fetch() const noexcept override;

 private:
  template <typename T>
  using PerCandidate = std::array<T, most_candidates>;

  ModelForce press(const topology::ToolPose& pose) noexcept;
  ModelForce follow(const topology::ToolPose& pose) noexcept;
  void linearise(const solvers::PressingTool& tool) noexcept;
  [[nodiscard]] bool pivot(int& pivots) noexcept;
  void add_forces(const topology::ToolPose& pose, bool frictional, ModelForce& result) const noexcept;
  [[nodiscard]] solvers::Gap gap_of(const solvers::PressingTool& tool, int c, const Vector3& u) const noexcept;
  [[nodiscard]] bool solve_active() noexcept;
  void displace() noexcept;
  void drag_along() noexcept;
  [[nodiscard]] bool rub() noexcept;
  void settle_bonds() noexcept;
  [[nodiscard]] double stiffness_along(const Vector3& force) noexcept;
  void expect(const Vector3& motion) noexcept;
  void look_around(const solvers::PressingTool& tool) noexcept;
  [[nodiscard]] bool catch_node(int candidate) noexcept;
  [[nodiscard]] std::span<const Vector3> rest() const;
  [[nodiscard]] std::span<const Vector3> normals() const;

  const topology::ToolShape& tool_;
  BladeModel blade_;
  const ContactSnapshot* snapshot_ = nullptr;
  const CondensedContact* condensed_ = nullptr; // of it
  std::uint64_t condensed_number_ = 0;          // 0: none
  topology::ToolPose pose_;                     // of the last tick
  Vector3 front_ = Vector3::Zero();             // of the tool, when candidates were last looked at
  PerCandidate<Vector3> displacement_;          // m, of the candidates
  PerCandidate<Vector3> moved_;                 // m, the same for the forces of this round
  PerCandidate<Vector3> normal_;                // of the tool
  PerCandidate<double> gap_;                    // m, linearised, at the displacement without tool
  PerCandidate<double> pressure_;               // N along the normal
  PerCandidate<char> active_;
  PerCandidate<char> wrong_;         // candidates that change sides in a pivot
  PerCandidate<Vector3> step_;       // m, of the last round
  PerCandidate<Vector3> start_;      // m, displacement_ when the last tick began
  PerCandidate<Vector3> change_;     // m, what the last tick added to it
  Vector3 motion_ = Vector3::Zero(); // m, of the tool in the last tick
  bool changes_ = false;             // those are of this body
  PerCandidate<Vector3> bare_;       // m, displacement without the tool's pressure: under its friction alone
  PerCandidate<Vector3> along_;      // N, friction, along the tool's surface
  PerCandidate<Vector3> slip_;       // m, from where a candidate stuck to the tool
  PerCandidate<double> limit_;       // N, of friction
  PerCandidate<Vector3> bond_;       // m, displacement at which it sticks to the tool, when the tool was at pose_
  PerCandidate<Vector3> bond_force_; // N
  PerCandidate<int> chosen_;         // active candidates, in the order of the factor's rows
  int chosen_count_ = 0;
  PerCandidate<int> near_; // looked at in this tick
  int near_count_ = 0;
  PerCandidate<char> fresh_;       // whose response_ is that to normal_
  PerCandidate<double> clearance_; // m, gap when last looked at, plus travelled_ then
  double travelled_ = 0;           // m, of tool and surface towards one another, at most
  int count_ = 0;                  // of the last snapshot, and its sum
  double rest_sum_ = 0;
  std::vector<double> factor_;   // Cholesky factor of the active block: by columns; bonded: by rows
  std::vector<double> right_;    // right-hand sides of it
  std::vector<double> share_;    // m, of one candidate's friction in the displacements
  std::vector<double> response_; // displacement of all candidates to a force on one, m per N, or m
};

} // namespace spherecut::app
