// What the simulation thread hands to the haptic thread after a solve: the contact condensed onto the candidate nodes
// under the tool, from which the force at another pose of the tool follows without the body.
#pragma once

#include "solvers/contact/solver.hpp"
#include "src/blade/grip.hpp"
#include "topology/tool/contact.hpp"

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>

namespace spherecut::app {

/// Candidates of a snapshot. Of a larger patch those nearest to the contact are handed over.
inline constexpr int most_candidates = 128;

/// Candidates and the body condensed onto them, u = base + compliance * f, with closed lips held. With the method
/// `collocation` the compliance is not symmetric; what is handed over is its symmetric part, because that derives from
/// a potential, so that no closed loop of the tool at constant contact can give energy to the hand. It does not change
/// once it is made: solves of one body on one choice of candidates share it, and the haptic thread, which reads it at
/// every tick, keeps it in its caches from solve to solve.
struct CondensedContact {
  std::uint64_t number = 0;       // its own: no two have the same
  std::vector<Vector3> rest;      // m
  std::vector<Vector3> normals;   // outward, of the surface at rest
  std::vector<Vector3> base;      // m, displacement without tool
  std::vector<double> compliance; // m/N, column-major, 3 rows a candidate
  double asymmetry = 0;           // |C - C^T| / |C + C^T| before it was made symmetric
  std::uint64_t patch = 0;        // number of the patch of which these are all candidates; 0: not known
};

/// The condensed contact and the state of the solve. Every array is allocated once, for most_candidates; only the first
/// `count` entries count. The condensed contact is given up by the thread that fills the next solve in, never by the
/// one that reads.
struct ContactSnapshot {
  ContactSnapshot();

  std::uint64_t sequence = 0;       // 1, 2, ...: number of the solve; 0: none yet
  std::uint64_t pose_tick = 0;      // tick of the device pose that was solved
  double time = 0;                  // s, of that tick
  std::uint16_t mode = 0;           // DeviceState::mode of that tick
  bool without_tool = false;        // of the scenario: HandMode::usual holds the blade
  topology::ToolPose pose;          // of the tool in the solve
  Vector3 force = Vector3::Zero();  // N, of the body on tool or blade in the hand, of the solve as it is
  Vector3 torque = Vector3::Zero(); // N m, of the same about the tool's point, or the origin of the blade's frame
  topology::SurfaceContact contact; // deepest point on the surface at rest
  solvers::ContactCondition condition = solvers::ContactCondition::frictionless;
  double friction = 0; // coefficient, frictional

  int count = 0;                     // candidates; 0: the tool is far
  std::vector<Vector3> displacement; // m, in the solve
  std::vector<Vector3> forces;       // N on the body, in the solve
  std::vector<Vector3> along;        // N, frictional: part of the forces that acts along the tool's surface
  std::vector<Vector3> bond;         // m, displacement at which an active node sticks to the tool
  std::vector<char> active;          // in contact
  std::vector<double> lifts;         // m, as ContactPatch::lifts
  double rest_sum = 0;               // of all entries: equal sums mean the same candidates
  double reach = 0;                  // m, of the candidates about the contact's point
  std::shared_ptr<const CondensedContact> condensed; // null: no candidates

  BladeGrip blade; // of a blade that the tissue resists, in the hand; `pose.point` is then that of its frame
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity(); // of that frame, then

  bool resprinkled = false;   // the nodes have followed the tool since the last snapshot
  int cut_triangles = 0;      // added to the cut since the last snapshot
  int degradation = 0;        // level of coarsening (see simulation.hpp)
  int nodes = 0;              // of the body
  std::uint64_t topology = 0; // hash of the places of its nodes, the area of the cut and the surface with it
  double solve_seconds = 0;   // wall clock, from pose to snapshot
};

/// Numbers it and lets nobody change it any more.
std::shared_ptr<const CondensedContact> numbered(CondensedContact condensed);

/// Copies the state of a patch; `candidates` beyond most_candidates are left out, those farthest from the contact
/// first. Where the condensed contact is as `last` (null: none), bit by bit, that is shared.
void fill(const solvers::ContactPatch& patch, const solvers::ContactState& state,
          const topology::SurfaceContact& contact, solvers::ContactCondition condition,
          const std::shared_ptr<const CondensedContact>& last, ContactSnapshot& snapshot);

/// No candidates: the tool is far.
void clear(ContactSnapshot& snapshot);

} // namespace spherecut::app
