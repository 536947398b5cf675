// Notation: o opening of the pairs, l their forces, f forces on the tool's candidates with displacement u,
//
//   o = o0 + A l + T f,   u = u0 + C f + D l.
//
// For a given set of closed pairs (index a) o_a = 0 gives l_a = -A_aa^-1 (o0 + T f)_a, and the tool meets the body with
//
//   u = [u0 - D_a A_aa^-1 o0_a] + [C - D_a A_aa^-1 T_a] f.
#include "solvers/contact/lip_contact.hpp"

#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace spherecut::solvers {

namespace {

constexpr int most_rounds = 200; // of tool and lips in turn

std::array<Vector3, 3> mode_axes(const Vector3& normal) {
  const Vector3 first = normal.unitOrthogonal();
  return {normal, first, normal.cross(first)};
}

/// Nodes of the pairs: all on the one side, then all on the other.
std::vector<int> nodes_of(const std::vector<LipPair>& pairs) {
  std::vector<int> nodes;
  nodes.reserve(2 * pairs.size());
  for (const LipPair& pair : pairs)
    nodes.push_back(pair.plus);
  for (const LipPair& pair : pairs)
    nodes.push_back(pair.minus);
  return nodes;
}

/// Openings of the pairs in the entries of the patch, from displacements of nodes_of() in columns.
MatrixX openings(const std::vector<LipPair>& pairs, int modes, const MatrixX& displacements) {
  const Eigen::Index half = 3 * std::ssize(pairs);
  const MatrixX apart = displacements.topRows(half) - displacements.bottomRows(half);
  MatrixX result(modes * std::ssize(pairs), displacements.cols());
  for (Eigen::Index p = 0; p < std::ssize(pairs); ++p) {
    const std::array<Vector3, 3> axes = mode_axes(pairs[p].normal);
    for (int m = 0; m < modes; ++m)
      result.row(modes * p + m) = axes[m].transpose() * apart.middleRows<3>(3 * p);
  }
  return result;
}

MatrixX openings(const Discretisation& body, const std::vector<LipPair>& pairs, int modes,
                 const std::vector<Field>& fields) {
  return openings(pairs, modes, body.contact_displacements(nodes_of(pairs), fields));
}

/// A column for every entry of the patch, three rows for every one of nodes_of().
MatrixX unit_pair_forces(const std::vector<LipPair>& pairs, int modes) {
  MatrixX forces = MatrixX::Zero(6 * std::ssize(pairs), modes * std::ssize(pairs));
  for (Eigen::Index p = 0; p < std::ssize(pairs); ++p) {
    const std::array<Vector3, 3> axes = mode_axes(pairs[p].normal);
    for (int m = 0; m < modes; ++m) {
      forces.col(modes * p + m).segment<3>(3 * p) = axes[m];
      forces.col(modes * p + m).segment<3>(3 * (std::ssize(pairs) + p)) = -axes[m];
    }
  }
  return forces;
}

void require_forces(const LipPatch& lips, const LipState& state) {
  if (state.forces.size() != 0 && state.forces.size() != lips.compliance.cols())
    throw InputError(fmt::format("{} pair forces on lips with {} entries: they are another patch's",
                                 state.forces.size(), lips.compliance.cols()));
}

/// Nodes that carry forces, one after the other, and these.
struct NodalForces {
  std::vector<int> nodes;
  std::vector<Vector3> forces; // N

  void add(int node, const Vector3& force) {
    if (force.isZero(0))
      return;
    nodes.push_back(node);
    forces.push_back(force);
  }
  void add(const LipPatch& lips, const LipState& state) {
    require_forces(lips, state);
    if (state.forces.size() == 0) // all open
      return;
    const std::vector<Vector3> of_pairs = pair_forces(lips, state);
    for (std::size_t p = 0; p < lips.pairs.size(); ++p) {
      add(lips.pairs[p].plus, of_pairs[p]);
      add(lips.pairs[p].minus, -of_pairs[p]);
    }
  }
  [[nodiscard]] Field on(const Discretisation& body, Field field) const {
    if (!nodes.empty())
      field.add(1, body.force_response(nodes, forces));
    return field;
  }
};

std::vector<int> closed_entries(const std::vector<char>& closed, const LipPatch& lips) {
  std::vector<int> entries;
  for (int p = 0; p < std::ssize(closed); ++p)
    if (closed[p] != 0)
      for (int m = 0; m < (lips.pairs[p].slides ? 1 : lips.modes); ++m)
        entries.push_back(lips.modes * p + m);
  return entries;
}

VectorX gathered(const VectorX& vector, const std::vector<int>& entries) {
  VectorX result(std::ssize(entries));
  for (Eigen::Index k = 0; k < result.size(); ++k)
    result[k] = vector[entries[k]];
  return result;
}

MatrixX gathered(const MatrixX& matrix, const std::vector<int>& rows, const std::vector<int>& columns) {
  MatrixX result(std::ssize(rows), std::ssize(columns));
  for (Eigen::Index k = 0; k < result.cols(); ++k)
    for (Eigen::Index i = 0; i < result.rows(); ++i)
      result(i, k) = matrix(rows[i], columns[k]);
  return result;
}

std::vector<int> all_of_size(Eigen::Index size) {
  std::vector<int> entries(size);
  std::iota(entries.begin(), entries.end(), 0);
  return entries;
}

/// The set that the forces and openings of a guess ask for; returns how many pairs differ from it.
int wanted_set(const LipPatch& lips, const LipState& state, double tolerance, std::vector<char>& wanted) {
  int changes = 0;
  wanted = state.closed;
  for (int p = 0; p < std::ssize(state.closed); ++p) {
    const bool close =
        state.closed[p] != 0 ? state.forces[lips.modes * p] >= 0 : state.openings[lips.modes * p] < -tolerance;
    changes += close != (state.closed[p] != 0) ? 1 : 0;
    wanted[p] = close ? 1 : 0;
  }
  return changes;
}

/// Forces of the closed pairs that bring their openings to zero.
void hold_closed(const LipPatch& lips, const VectorX& free_opening, LipState& state) {
  const std::vector<int> a = closed_entries(state.closed, lips);
  state.forces = VectorX::Zero(free_opening.size());
  if (!a.empty()) {
    const VectorX held = gathered(lips.compliance, a, a).partialPivLu().solve(-gathered(free_opening, a));
    for (std::size_t k = 0; k < a.size(); ++k)
      state.forces[a[k]] = held[static_cast<Eigen::Index>(k)];
  }
  state.openings = free_opening + lips.compliance * state.forces;
  for (int entry : a)
    state.openings[entry] = 0;
}

/// Moves to the wanted set as a block while that brings the number of wrong pairs down, else by one pair at a time
/// (the last wrong one), which cannot cycle for a P-matrix [Judice and Pires 1994].
class SetSearch {
 public:
  void advance(std::vector<char>& closed, const std::vector<char>& wanted, int changes) {
    if (changes < fewest_) {
      fewest_ = changes;
      patience_ = 8;
    } else if (patience_ > 0) {
      --patience_;
    }
    if (patience_ > 0) {
      closed = wanted;
      return;
    }
    for (std::size_t p = closed.size(); p-- > 0;)
      if (closed[p] != wanted[p]) {
        closed[p] = wanted[p];
        return;
      }
  }

 private:
  int fewest_ = std::numeric_limits<int>::max();
  int patience_ = 8;
};

VectorX stacked(const std::vector<Vector3>& forces) {
  VectorX result(3 * std::ssize(forces));
  for (Eigen::Index c = 0; c < std::ssize(forces); ++c)
    result.segment<3>(3 * c) = forces[c];
  return result;
}

/// Alternates between the tool on a held body and the lips under the tool's forces.
template <typename Tool>
CutContactState settle(const ContactPatch& patch, const LipPatch& lips, double tolerance, std::vector<char> closed,
                       Tool&& tool_on) {
  CutContactState state;
  if (closed.size() != lips.pairs.size())
    closed.assign(lips.pairs.size(), 0);
  SetSearch search;
  std::vector<char> wanted;
  for (int round = 1; round <= most_rounds; ++round) {
    state.tool = tool_on(held_patch(patch, lips, closed));
    state.lips.closed = closed;
    state.lips.rounds = round;
    hold_closed(lips, lips.base_opening + lips.lips_of_tool * stacked(state.tool.nodal_forces), state.lips);
    const int changes = wanted_set(lips, state.lips, tolerance, wanted);
    state.lips.converged = changes == 0;
    if (state.lips.converged)
      break;
    search.advance(closed, wanted, changes);
  }
  return state;
}

} // namespace

ContactPatch held_patch(const ContactPatch& patch, const LipPatch& lips, const std::vector<char>& closed) {
  ContactPatch held;
  held.nodes = patch.nodes;
  held.rest = patch.rest;
  held.spacings = patch.spacings;
  held.normals = patch.normals;
  held.lifts = patch.lifts;
  held.compliance = patch.compliance;
  held.base_displacement = patch.base_displacement;
  const std::vector<int> a = closed_entries(closed, lips);
  if (a.empty()) {
    held.number = patch.number;
    return held;
  }
  const Eigen::PartialPivLU<MatrixX> lu(gathered(lips.compliance, a, a));
  const MatrixX reach = gathered(lips.tool_of_lips, all_of_size(lips.tool_of_lips.rows()), a);
  held.compliance -= reach * lu.solve(gathered(lips.lips_of_tool, a, all_of_size(lips.lips_of_tool.cols())));
  held.base_displacement -= reach * lu.solve(gathered(lips.base_opening, a));
  return held;
}

std::vector<LipPair> lip_pairs(const NodeCloud& nodes) {
  std::vector<int> lips;
  std::vector<Vector3> positions;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] == NodeKind::lip) {
      lips.push_back(i);
      positions.push_back(nodes.positions[i]);
    }
  std::vector<LipPair> pairs;
  if (lips.empty())
    return pairs;
  const topology::PointTree tree(positions);
  std::vector<topology::PointTree::Found> near;
  for (int k = 0; k < std::ssize(lips); ++k) {
    const int i = lips[k];
    near.clear();
    tree.within(positions[k], 4 * lip_offset * nodes.spacings[i], near);
    for (const topology::PointTree::Found& other : near) {
      const int j = lips[other.index];
      // Each node's normal points out of its material, so from `plus` it points to `minus`.
      if (j > i && nodes.normals[i].dot(nodes.normals[j]) < 0)
        pairs.push_back({i, j, (nodes.normals[j] - nodes.normals[i]).normalized()});
    }
  }
  return pairs;
}

LipPatch condense_lips(const Discretisation& body, const std::vector<LipPair>& pairs, LipCondition condition,
                       const ContactPatch* tool) {
  if (condition == LipCondition::open)
    throw InputError("lips that are left open have no contact to condense");
  LipPatch lips;
  lips.pairs = pairs;
  lips.modes = condition == LipCondition::sticking ? 3 : 1;
  const std::vector<int> nodes = nodes_of(pairs);
  lips.base_opening = openings(body, pairs, lips.modes, {tool != nullptr ? tool->base : body.solve()}).col(0);
  for (Eigen::Index p = 0; p < std::ssize(pairs); ++p)
    lips.base_opening[lips.modes * p] += pairs[p].gap;
  if (pairs.empty()) {
    lips.compliance.resize(0, 0);
    lips.tool_of_lips.resize(tool != nullptr ? 3 * std::ssize(tool->nodes) : 0, 0);
    lips.lips_of_tool = lips.tool_of_lips.transpose();
    return lips;
  }
  CaseResponses responses = body.condense_cases(nodes, unit_pair_forces(pairs, lips.modes),
                                                tool != nullptr ? tool->nodes : std::vector<int>{});
  lips.responses = std::move(responses.fields);
  lips.compliance = std::move(responses.among);
  if (tool != nullptr) {
    lips.tool_of_lips = std::move(responses.at);
    // A symmetric body opens its lips under a force on a node as it moves the node under that force between the lips.
    lips.lips_of_tool = has_fields(*tool) ? openings(body, pairs, lips.modes, tool->responses)
                        : body.method() == Method::galerkin
                            ? MatrixX(lips.tool_of_lips.transpose())
                            : openings(pairs, lips.modes, body.compliance_between(nodes, tool->nodes));
  }
  for (Eigen::Index p = 0; p < std::ssize(pairs); ++p)
    if (!lips.compliance.middleRows(lips.modes * p, lips.modes).allFinite()) {
      const Vector3& x = body.problem().nodes.positions[pairs[p].plus];
      throw NumericalError(fmt::format("forces on the faces of the cut give openings that are not finite, first at "
                                       "({:.4g}, {:.4g}, {:.4g}) m; moment matrices' worst condition {:.2g}",
                                       x.x(), x.y(), x.z(), body.report().worst_moment_condition));
    }
  return lips;
}

LipState close_lips(const LipPatch& lips, const VectorX& free_opening, double tolerance,
                    const std::vector<char>& closed) {
  LipState state;
  state.closed = closed.size() == lips.pairs.size() ? closed : std::vector<char>(lips.pairs.size(), 0);
  SetSearch search;
  std::vector<char> wanted;
  const int limit = most_rounds + 4 * static_cast<int>(std::ssize(lips.pairs));
  for (state.rounds = 1; state.rounds <= limit; ++state.rounds) {
    hold_closed(lips, free_opening, state);
    const int changes = wanted_set(lips, state, tolerance, wanted);
    state.converged = changes == 0;
    if (state.converged)
      break;
    search.advance(state.closed, wanted, changes);
  }
  return state;
}

std::vector<Vector3> pair_forces(const LipPatch& lips, const LipState& state) {
  std::vector<Vector3> forces;
  for (int p = 0; p < std::ssize(lips.pairs); ++p) {
    const std::array<Vector3, 3> axes = mode_axes(lips.pairs[p].normal);
    forces.emplace_back(Vector3::Zero());
    for (int m = 0; m < lips.modes; ++m)
      forces.back() += state.forces[lips.modes * p + m] * axes[m];
  }
  return forces;
}

CutContactState press(const ContactPatch& patch, const LipPatch& lips, const topology::ToolShape& tool,
                      const topology::ToolPose& pose, const ContactOptions& options, const CutContactState* previous) {
  return settle(patch, lips, options.gap_tolerance, previous != nullptr ? previous->lips.closed : std::vector<char>{},
                [&](const ContactPatch& held) {
                  return press(held, tool, pose, options, previous != nullptr ? &previous->tool : nullptr);
                });
}

CutContactState prescribe(const ContactPatch& patch, const LipPatch& lips, const std::vector<Vector3>& displacements,
                          double tolerance) {
  return settle(patch, lips, tolerance, {}, [&](const ContactPatch& held) { return prescribe(held, displacements); });
}

void extend_responses(const Discretisation& body, int pairs, LipPatch& lips) {
  const auto first = lips.pairs.begin() + std::ssize(lips.responses) / lips.modes;
  const std::vector<LipPair> next(first, first + std::min<std::ptrdiff_t>(pairs, lips.pairs.end() - first));
  if (next.empty())
    return;
  for (Field& field : body.case_responses(nodes_of(next), unit_pair_forces(next, lips.modes)))
    lips.responses.push_back(std::move(field));
}

Field deform(const Field& base, const LipPatch& lips, const LipState& state) {
  if (!has_fields(lips))
    throw InputError(fmt::format("lips with {} entries and {} fields of unit pair forces; allowed: one each",
                                 lips.compliance.cols(), lips.responses.size()));
  require_forces(lips, state);
  Field field = base;
  for (Eigen::Index k = 0; k < state.forces.size(); ++k)
    if (state.forces[k] != 0)
      field.add(state.forces[k], lips.responses[k]);
  return field;
}

Field deform(const Discretisation& body, const Field& base, const LipPatch& lips, const LipState& state) {
  if (has_fields(lips))
    return deform(base, lips, state);
  NodalForces acting;
  acting.add(lips, state);
  return acting.on(body, base);
}

Field deform(const Discretisation& body, const ContactPatch& patch, const LipPatch& lips,
             const CutContactState& state) {
  if (has_fields(patch) || has_fields(lips))
    return deform(body, deform(body, patch, state.tool), lips, state.lips);
  require_forces(patch, state.tool);
  NodalForces acting; // of both, in one solution
  for (std::size_t c = 0; c < patch.nodes.size(); ++c)
    acting.add(patch.nodes[c], state.tool.nodal_forces[c]);
  acting.add(lips, state.lips);
  return acting.on(body, patch.base);
}

Field deform(const ContactPatch& patch, const LipPatch& lips, const CutContactState& state) {
  return deform(deform(patch, state.tool), lips, state.lips);
}

} // namespace spherecut::solvers
