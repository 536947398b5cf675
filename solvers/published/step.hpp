// The real-time step of the paper: a few dozen nodes around the tool tip, placed at contact, collocated and condensed
// to the force on the tool at every call [De 2001, sections 2 and 3]. The same scheme as published.hpp on a cloud that
// changes from call to call.
#pragma once

#include "solvers/algebra/dense_elimination.hpp"
#include "solvers/published/published.hpp"
#include "solvers/shapes/kernel.hpp"

#include <span>

namespace spherecut::solvers {

enum class StepStatus {
  solved,
  wrong_size,      // arrays that do not match the node count, or a tip that is not a node
  unsound_support, // at `node`
  singular,        // the collocation matrix
};

/// Outcome of one step. Newtons by the nodal area of the tip, see published.hpp.
struct PublishedStepResult {
  StepStatus status = StepStatus::wrong_size;
  int node = -1;                       // where a support is not sound
  Vector3 force = Vector3::Zero();     // N, of the tool on the body
  Matrix3 stiffness = Matrix3::Zero(); // N/m, force = stiffness * displacement
  double worst_moment_condition = 0;
  double pivot_ratio = 0; // of the collocation matrix, see EliminationResult
};

/// Workspace for clouds of a fixed number of nodes. step() neither allocates nor locks nor throws.
class PublishedStep {
 public:
  /// Throws InputError for bad material, rho <= 0, or a node count outside 6 to 500.
  PublishedStep(int nodes, const Material& material, double rho = published_support_radius);

  /// Supports, rows, condensation, force for a displacement (m) of the tip's unknown. Nodes with `held` set keep
  /// u_h = 0; the others follow their kind. Radii are rho times the spacings; at a node whose support is not sound they
  /// are tried grown by 1.25 up to four times.
  PublishedStepResult step(const NodeCloud& nodes, std::span<const char> held, int tip,
                           const Vector3& displacement) noexcept;

  /// Nodal unknowns of the last solved step per unit tip displacement along an axis: node i moves by sum over axes of
  /// response(i, axis) * displacement[axis].
  [[nodiscard]] Vector3 response(int node, int axis) const noexcept;

 private:
  struct alignas(64) Block : std::array<double, SphereGrid::lanes> {};

  bool evaluate_node(const Vector3& x) noexcept;
  void write_rows(const NodeCloud& nodes, int node, bool held, int tip) noexcept;
  [[nodiscard]] Matrix3 block(const NodeCloud& nodes, int node, int k) const noexcept;

  int count_, blocks_;
  Material material_;
  double rho_;
  int tip_ = 0;
  std::vector<Block> spheres_; // centres x, y, z and inverse square radii, each in `blocks_` blocks
  std::vector<int> ids_;
  std::vector<double> support_memory_;
  std::vector<int> support_ids_;
  ShapeFunctions shape_;
  DenseSystem system_; // K_bb | -K_ba over the nodes other than the tip
};

} // namespace spherecut::solvers
