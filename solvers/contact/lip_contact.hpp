// Unilateral contact between the two faces of a cut: lips part freely and do not go through one another.
#pragma once

#include "solvers/contact/solver.hpp"

namespace spherecut::solvers {

enum class LipCondition {
  open,         // the faces do not see each other: right only while nothing presses them together
  frictionless, // closed faces slide
  sticking,     // closed faces do not slide: a closed cut is as stiff as the uncut body
};
std::string_view to_string(LipCondition condition);
/// Throws InputError naming the value and the three allowed names.
LipCondition lip_condition_from_string(std::string_view name);

/// Two lip nodes on either face of a cut at one place, or two nodes of the organ's surface that face each other.
struct LipPair {
  int plus = -1, minus = -1;
  Vector3 normal = Vector3::Zero(); // unit, from the material of `minus` into that of `plus`
  double gap = 0;                   // m, between the two at rest, along the normal
  bool slides = false;              // when closed, whatever the lips do
};

/// Pairs every lip node with its partner across the sheet. A lip node without one (its partner lay outside the body)
/// is left out.
std::vector<LipPair> lip_pairs(const NodeCloud& nodes);

/// The body seen from its lips and a tool's candidates. A pair force lambda acts as +lambda on `plus` and -lambda on
/// `minus`; the opening conjugate to it is u_plus - u_minus. Entries come `modes` a pair: the normal component first
/// (positive when open), then, when the lips stick, two tangential ones, which carry nothing in a pair that slides.
struct LipPatch {
  std::vector<LipPair> pairs;
  int modes = 1;
  std::vector<Field> responses; // to unit pair forces; none where the body condenses without fields
  VectorX base_opening;         // m, without tool and pair forces
  MatrixX compliance;           // m/N, opening per pair force
  MatrixX tool_of_lips;         // m/N, displacement of the tool's candidates per pair force, 3m x entries
  MatrixX lips_of_tool;         // m/N, opening per force on the tool's candidates, entries x 3m
};

/// Whether the lips have the fields of all their unit pair forces.
inline bool has_fields(const LipPatch& lips) {
  return std::ssize(lips.responses) == lips.compliance.cols();
}

/// Condenses onto the pairs. `tool` may be null: no tool. Throws InputError for LipCondition::open, NumericalError when
/// the compliance is not finite.
LipPatch condense_lips(const Discretisation& body, const std::vector<LipPair>& pairs, LipCondition condition,
                       const ContactPatch* tool);

struct LipState {
  VectorX forces;           // N, one per entry of the patch
  VectorX openings;         // m
  std::vector<char> closed; // per pair
  int rounds = 0;           // active sets tried
  bool converged = true;
};

/// Closed pairs and their forces when the lips would open by `free_opening` without touching: no normal opening below
/// -tolerance, no pair that pulls; an open pair carries nothing. Sticking pairs are held at zero opening in all three
/// components, that is where the body was cut. `closed` (may be empty) is a guess of the closed pairs.
LipState close_lips(const LipPatch& lips, const VectorX& free_opening, double tolerance,
                    const std::vector<char>& closed = {});

/// Force on the `plus` node of every pair, N; that on `minus` is opposite.
std::vector<Vector3> pair_forces(const LipPatch& lips, const LipState& state);

/// Tool and lips in contact together.
struct CutContactState {
  ContactState tool;
  LipState lips;
};

/// As press() on the uncut body, with the lips' contact found at the same time: the tool meets the body as it is with
/// the closed pairs held together, until neither set changes.
CutContactState press(const ContactPatch& patch, const LipPatch& lips, const topology::ToolShape& tool,
                      const topology::ToolPose& pose, const ContactOptions& options = {},
                      const CutContactState* previous = nullptr);

/// The tool's patch on the body whose closed pairs are held together, without its fields: what the tool feels while no
/// lip opens or closes.
ContactPatch held_patch(const ContactPatch& patch, const LipPatch& lips, const std::vector<char>& closed);

/// Prescribed displacements of the tool's candidates with the lips in contact.
CutContactState prescribe(const ContactPatch& patch, const LipPatch& lips, const std::vector<Vector3>& displacements,
                          double tolerance = 1e-9);

/// Makes the fields of the next `pairs` pairs that have none: cheaper to superpose than a solution each time.
void extend_responses(const Discretisation& body, int pairs, LipPatch& lips);

/// Field of the body for the given state; without a tool `base` is the body's own solution. Where patch or lips have no
/// fields it takes a solution; without the body that is an InputError, as forces of another patch are.
Field deform(const Discretisation& body, const ContactPatch& patch, const LipPatch& lips, const CutContactState& state);
Field deform(const Discretisation& body, const Field& base, const LipPatch& lips, const LipState& state);
Field deform(const ContactPatch& patch, const LipPatch& lips, const CutContactState& state);
Field deform(const Field& base, const LipPatch& lips, const LipState& state);

} // namespace spherecut::solvers
