// Unilateral contact of a rigid tool with the nodes of a candidate patch, on the condensed compliance of the body.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "topology/tool/tool.hpp"

#include <optional>

namespace spherecut::solvers {

/// Boussinesq coupling of a local half-space domain: the far boundary moves as it would under the tool's total force.
struct HalfSpaceCoupling {
  Vector3 origin = Vector3::Zero();   // point on the surface of the half-space where the force acts
  Vector3 inward = -Vector3::UnitZ(); // unit normal into the half-space
};

/// The body seen from a patch of candidate contact nodes: u_patch = u0 + compliance * f.
struct ContactPatch {
  std::vector<int> nodes;       // m candidates
  std::vector<Vector3> rest;    // their rest positions, m
  std::vector<double> spacings; // m
  std::vector<Vector3> normals; // outward surface normals
  /// m, how far the surface of a candidate's share reaches beyond its point towards the tool: its gap is less by that.
  /// Empty: 0.
  std::vector<double> lifts;
  MatrixX compliance;           // 3m x 3m, m/N
  VectorX base_displacement;    // 3m, m: displacement without tool
  std::vector<Field> responses; // 3m fields for unit forces (with the far field of the coupling included), or fewer
  Field base;                   // field without tool
  /// Of a patch that was condensed: patches of one number have equal nodes, compliance and base displacement. 0: not
  /// known.
  std::uint64_t number = 0;
};

inline double lift_of(const ContactPatch& patch, int candidate) {
  return patch.lifts.empty() ? 0 : patch.lifts[static_cast<std::size_t>(candidate)];
}

/// Whether the patch has the fields of all its unit forces.
inline bool has_fields(const ContactPatch& patch) {
  return patch.responses.size() == 3 * patch.nodes.size();
}

/// Condenses the discretisation onto the candidates [De 2001, Eq. 5 and after, in compliance form].
ContactPatch condense(const Discretisation& body, const std::vector<int>& candidates,
                      const std::optional<HalfSpaceCoupling>& coupling = std::nullopt);

/// The same without the fields of the unit forces, which most of the time goes into: for a body that the next cut
/// changes before many a press. deform() then takes a solution each; extend_responses() makes the fields by and by.
ContactPatch condense_without_fields(const Discretisation& body, const std::vector<int>& candidates);

/// Fields of the next `nodes` candidates of a patch that lacks some.
void extend_responses(const Discretisation& body, int nodes, ContactPatch& patch);

enum class ContactCondition { frictionless, frictional, bonded };

struct ContactOptions {
  ContactCondition condition = ContactCondition::frictionless;
  double friction = 0;         // frictional: Coulomb's coefficient
  int maximum_iterations = 60; // re-linearisations of the tool's surface per sub-step
  double gap_tolerance = 1e-9; // m
};

/// What friction leaves behind of a contact on other nodes than those of the next patch: how much of its limit the
/// force along the tool's surface uses, where, and the tool's pose.
struct GripMemory {
  topology::ToolPose pose;
  std::vector<Vector3> rest;  // m, nodes that were in contact
  std::vector<Vector3> share; // force along the surface over its limit, at most 1 long
};

/// Outcome of pressing the tool into the patch.
struct ContactState {
  std::vector<Vector3> nodal_forces; // N on the body, one per candidate
  std::vector<char> active;          // candidates in contact
  VectorX displacement;              // 3m, m: of the candidates
  std::vector<Vector3> along;        // N, frictional: part of the nodal forces that acts along the tool's surface
  std::vector<Vector3> bond;         // m, displacement at which an active node sticks to the tool at `pose`
  std::optional<GripMemory> memory; // set where a contact goes on with other nodes: the rest of the state is then empty
  topology::ToolPose pose;          // of the tool in this state
  Vector3 tool_force = Vector3::Zero(); // N, force of the body on the tool
  /// N m, of the same nodal forces about `pose.point`, each where its node is now: rest position and displacement. Of
  /// prescribe(), which has no tool, about the origin.
  Vector3 tool_torque = Vector3::Zero();
  Vector3 centre = Vector3::Zero(); // m, rest position of the contact: mean weighted by normal force
  double contact_radius = 0;        // m, outermost active node's distance from the centre plus half its spacing
  double largest_penetration = 0;   // m, left over at convergence
  double friction_work = 0;         // J, taken by friction on the way from the state before
  int active_nodes = 0;
  int iterations = 0;
  bool converged = true;
};

/// `state` of `patch` on other candidates of the same body, ascending: what both have keeps its force, bond and place,
/// the others are free. To go on from, by press(): the sums over the patch are not made again. Throws InputError when
/// the state is not the patch's.
ContactState among(const ContactPatch& patch, const ContactState& state, const std::vector<int>& nodes);

/// Finds the active set and the forces: no penetration, no tension. Frictionless: forces along the tool's normals.
/// Frictional: besides, forces along the tool's surface of at most `friction` times the normal force; below that limit
/// a node keeps its place on the tool, at it the node slips against the force. Bonded: a node that has been touched
/// moves with the tool. The tool advances from `previous` (or, without one, from where it is clear of the patch along
/// its axis) in sub-steps shorter than its tip radius, so that deep presses find the right side; with friction, which
/// remembers its way, of a tenth of that radius at most. Where `previous` is but a memory, the contact it tells of is
/// first set up on these nodes. Throws InputError on a tool or pose that topology::check refuses, options out of their
/// range, and a `previous` of another patch.
ContactState press(const ContactPatch& patch, const topology::ToolShape& tool, const topology::ToolPose& pose,
                   const ContactOptions& options = {}, const ContactState* previous = nullptr);

/// Torque of the body on the tool about another point than the tool's, N m: it changes by (pose.point - point) x force.
Vector3 torque_about(const ContactState& state, const Vector3& point);

/// What friction needs to go on with other nodes than those of this patch; nothing without contact.
std::optional<GripMemory> remember(const ContactPatch& patch, const ContactState& state, double friction);

/// Forces on the nodes of the patch, N, that take back displacements of them, m: 3 rows a node, a column a case. None
/// along an axis that the body itself is held at a node.
MatrixX forces_against(const ContactPatch& patch, const MatrixX& displacements);

/// Nodes of the patch with given displacements, m (bonded cap): solves for their forces. Throws InputError unless there
/// is a finite one for every node.
ContactState prescribe(const ContactPatch& patch, const std::vector<Vector3>& displacements);

/// Throws InputError when the state's forces are not the patch's.
void require_forces(const ContactPatch& patch, const ContactState& state);

/// Field of the body for given nodal forces on the patch, by its fields, or by a solution where it lacks them. Throws
/// InputError when the state is not the patch's.
Field deform(const Discretisation& body, const ContactPatch& patch, const ContactState& state);
/// Of a patch with all its fields; throws InputError besides where it lacks some.
Field deform(const ContactPatch& patch, const ContactState& state);

} // namespace spherecut::solvers
