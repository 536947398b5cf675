// Notation: c candidate node with rest position x_c, u its displacement, f its force; C the 3m x 3m compliance, so that
// u = u0 + C f. The tool's surface is linearised at x_c + u_c: gap g_c and outward normal n_c. With f_c = lambda_c n_c
//
//   w = q + N^T C N lambda >= 0,  lambda >= 0,  lambda . w = 0,   q_c = g_c + n_c . (u0_c - u_c),
//
// and the linearisation is repeated until u stands still. With friction f_c = lambda_c n_c + t_c, where the forces t_c
// along the surface are relaxed for the lambda of the round (friction.hpp) and C t counts as part of u0.
#include "solvers/contact/solver.hpp"

#include "solvers/algebra/linear_complementarity.hpp"
#include "solvers/contact/friction.hpp"
#include "solvers/contact/half_space.hpp"
#include "solvers/contact/tool_gap.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::solvers {

void require_forces(const ContactPatch& patch, const ContactState& state) {
  if (state.nodal_forces.size() != patch.nodes.size())
    throw InputError(fmt::format("a contact's forces on {} candidates for a patch of {}: they are another patch's",
                                 state.nodal_forces.size(), patch.nodes.size()));
}

namespace {

int size_of(const ContactPatch& patch) {
  return static_cast<int>(patch.nodes.size());
}

void require_own(const ContactPatch& patch, const ContactState& state) {
  const std::size_t count = patch.nodes.size();
  require_forces(patch, state);
  if (state.active.size() != count || state.along.size() != count || state.bond.size() != count ||
      state.displacement.size() != 3 * std::ssize(patch.nodes))
    throw InputError(fmt::format("a contact's state on {} candidates for a patch of {}: it is another patch's; among() "
                                 "takes it to other candidates",
                                 state.nodal_forces.size(), count));
}

/// Gap between the tool and the surface of a candidate that has moved by u.
Gap gap_of(const PressingTool& tool, const ContactPatch& patch, int c, const Vector3& u, double hold = 0) {
  Gap gap = contact_gap(tool, patch.rest[c] + u, hold);
  gap.distance -= lift_of(patch, c);
  return gap;
}

VectorX displacement_of(const ContactPatch& patch, const std::vector<Vector3>& forces) {
  VectorX stacked(3 * size_of(patch));
  for (int c = 0; c < size_of(patch); ++c)
    stacked.segment<3>(3 * c) = forces[c];
  return patch.base_displacement + patch.compliance * stacked;
}

/// The same where few forces are not zero: of those columns alone.
VectorX displacement_of_few(const ContactPatch& patch, const std::vector<Vector3>& forces) {
  VectorX displacement = patch.base_displacement;
  for (int c = 0; c < size_of(patch); ++c)
    if (!forces[c].isZero(0))
      displacement += patch.compliance.middleCols<3>(3 * c).lazyProduct(forces[c]);
  return displacement;
}

/// N^T C N, column by column.
void condense_along(const std::vector<Vector3>& normals, const MatrixX& compliance, VectorX& column,
                    MatrixX& condensed) {
  for (Eigen::Index d = 0; d < std::ssize(normals); ++d) {
    column.noalias() = compliance.middleCols<3>(3 * d).lazyProduct(normals[d]);
    for (Eigen::Index c = 0; c < std::ssize(normals); ++c)
      condensed(c, d) = normals[c].dot(column.segment<3>(3 * c));
  }
}

void summarise(const ContactPatch& patch, ContactState& state) {
  state.tool_force.setZero();
  state.tool_torque.setZero();
  state.centre.setZero();
  state.active_nodes = 0;
  state.contact_radius = 0;
  double weight = 0;
  Vector3 middle = Vector3::Zero(); // of nodes that are held without a force
  for (int c = 0; c < size_of(patch); ++c) {
    state.tool_force -= state.nodal_forces[c];
    if (!state.nodal_forces[c].isZero(0))
      state.tool_torque -=
          (patch.rest[c] + state.displacement.segment<3>(3 * c) - state.pose.point).cross(state.nodal_forces[c]);
    if (!state.active[c])
      continue;
    ++state.active_nodes;
    const double force = state.nodal_forces[c].norm();
    weight += force;
    state.centre += force * patch.rest[c];
    middle += patch.rest[c];
  }
  if (weight > 0)
    state.centre /= weight;
  else if (state.active_nodes > 0)
    state.centre = middle / state.active_nodes;
  for (int c = 0; c < size_of(patch); ++c)
    if (state.active[c])
      state.contact_radius =
          std::max(state.contact_radius, (patch.rest[c] - state.centre).norm() + 0.5 * patch.spacings[c]);
}

ContactState resting(const ContactPatch& patch, const topology::ToolPose& pose) {
  ContactState state;
  const std::size_t count = patch.nodes.size();
  state.nodal_forces.assign(count, Vector3::Zero());
  state.active.assign(count, 0);
  state.along.assign(count, Vector3::Zero());
  state.bond.assign(count, Vector3::Zero());
  state.displacement = patch.base_displacement;
  state.pose = pose;
  return state;
}

/// Rows of these candidates but those along axes that the body itself is held at: no force moves it there.
std::vector<Eigen::Index> movable_rows(const ContactPatch& patch, const std::vector<int>& candidates) {
  constexpr double rigid = 1e-9; // of the softest entry's compliance
  double softest = 0;
  for (const int c : candidates)
    softest = std::max(softest, patch.compliance.diagonal().segment<3>(3 * c).maxCoeff());
  std::vector<Eigen::Index> rows;
  for (const int c : candidates)
    for (int axis = 0; axis < 3; ++axis)
      if (const Eigen::Index row = 3 * c + axis; patch.compliance(row, row) > rigid * softest)
        rows.push_back(row);
  return rows;
}

/// Nodes with prescribed displacements `values` on `held`, the others free of force; none along an axis that the body
/// itself is held at.
void hold(const ContactPatch& patch, const std::vector<int>& held, const std::vector<Vector3>& values,
          ContactState& state) {
  const std::vector<Eigen::Index> rows = movable_rows(patch, held);
  std::vector<double> way;
  for (const Eigen::Index row : rows) {
    const auto a = std::find(held.begin(), held.end(), static_cast<int>(row / 3)) - held.begin();
    way.push_back(values[static_cast<std::size_t>(a)][row % 3] - patch.base_displacement[row]);
  }
  const MatrixX compliance = patch.compliance(rows, rows);
  const VectorX forces = compliance.partialPivLu().solve(Eigen::Map<const VectorX>(way.data(), std::ssize(way)));
  std::fill(state.nodal_forces.begin(), state.nodal_forces.end(), Vector3::Zero());
  std::fill(state.active.begin(), state.active.end(), 0);
  for (Eigen::Index k = 0; k < std::ssize(rows); ++k)
    state.nodal_forces[static_cast<std::size_t>(rows[k] / 3)][rows[k] % 3] = forces[k];
  for (const int c : held)
    state.active[c] = 1;
  state.displacement = displacement_of(patch, state.nodal_forces);
}

/// Rounds of the linearised contact until the displacements stand still. `tangential(normals, pressures, active,
/// displacement)` may change the forces along the surface after each round of pressures, and says whether they stand.
template <typename Tangential>
void press_normally(const ContactPatch& patch, const PressingTool& tool, const ContactOptions& options,
                    const std::vector<Vector3>& along, ContactState& state, Tangential&& tangential) {
  // At the rim of a leaning punch a node can alternate between end face and flank, neither of which keeps it: from this
  // round on what the flank holds stays with it.
  constexpr int undecided = 16;
  const int count = size_of(patch);
  MatrixX condensed(count, count);
  VectorX gaps(count), column(3 * count);
  std::vector<Vector3> normals(count);
  state.converged = false;
  double relaxation = 1;
  VectorX last_step;
  for (int iteration = 0; iteration < options.maximum_iterations; ++iteration) {
    interruption_point();
    ++state.iterations;
    const VectorX base = displacement_of_few(patch, along);
    for (int c = 0; c < count; ++c) {
      const Vector3 u = state.displacement.segment<3>(3 * c);
      const Gap gap = gap_of(tool, patch, c, u, iteration < undecided ? 0 : flank_hold);
      normals[c] = gap.normal;
      gaps[c] = gap.distance + gap.normal.dot(base.segment<3>(3 * c) - u);
    }
    condense_along(normals, patch.compliance, column, condensed);
    const ComplementaritySolution solution =
        solve_complementarity(condensed, gaps, state.active, 0.1 * options.gap_tolerance);
    state.active = solution.active;
    const bool stands = tangential(normals, solution.forces, state);
    for (int c = 0; c < count; ++c)
      state.nodal_forces[c] = solution.forces[c] * normals[c] + along[c];
    const VectorX displacement = displacement_of_few(patch, state.nodal_forces);
    const VectorX step = displacement - state.displacement;
    if (step.lpNorm<Eigen::Infinity>() < options.gap_tolerance && solution.converged && stands) {
      state.displacement = displacement;
      state.converged = true;
      break;
    }
    // Aitken's factor from the last two steps: shorter where the linearisations alternate, longer where they creep, as
    // they do on the flanks of a deep ball, whose normals turn as the nodes slide outwards.
    if (last_step.size() > 0) {
      const VectorX turn = step - last_step;
      if (turn.squaredNorm() > 0)
        relaxation = std::clamp(-relaxation * last_step.dot(turn) / turn.squaredNorm(), 0.25, 4.0);
    }
    last_step = step;
    state.displacement += relaxation * step;
  }
}

void press_frictionless(const ContactPatch& patch, const PressingTool& tool, const ContactOptions& options,
                        ContactState& state) {
  press_normally(patch, tool, options, std::vector<Vector3>(patch.nodes.size(), Vector3::Zero()), state,
                 [](const std::vector<Vector3>&, const VectorX&, const ContactState&) { return true; });
}

/// Where nodes stick to the tool, taken along from the state's pose to the tool's. A node that was free sticks where
/// the tool meets it: at the share of the way at which its gap is used up.
void carry_bonds(const ContactPatch& patch, const PressingTool& before, const PressingTool& tool, ContactState& state) {
  for (int c = 0; c < size_of(patch); ++c) {
    double rest_of_way = 1;
    if (!state.active[c]) {
      state.bond[c] = state.displacement.segment<3>(3 * c);
      const double start = gap_of(before, patch, c, state.bond[c]).distance;
      const double end = gap_of(tool, patch, c, state.bond[c]).distance;
      rest_of_way = start > end ? std::clamp(-end / (start - end), 0.0, 1.0) : 0;
    }
    state.bond[c] += rest_of_way * tool_motion(before.pose, tool.pose, patch.rest[c] + state.bond[c]);
  }
}

void press_frictional(const ContactPatch& patch, const PressingTool& tool, const ContactOptions& options,
                      ContactState& state) {
  constexpr int rounds = 20; // of friction for the pressures of one linearisation
  const int count = size_of(patch);
  const PressingTool before = pressing(tool.shape, state.pose, patch.rest, patch.normals);
  carry_bonds(patch, before, tool, state);
  std::vector<Vector3>& along = state.along;
  std::vector<Vector3> slip(count, Vector3::Zero());
  std::vector<double> limits(count, 0);
  std::vector<Vector3> last_normals;
  std::vector<int> touching;
  press_normally(patch, tool, options, along, state,
                 [&](const std::vector<Vector3>& normals, const VectorX& pressures, const ContactState& now) {
                   touching.clear();
                   for (int c = 0; c < count; ++c)
                     if (now.active[c])
                       touching.push_back(c);
                     else
                       along[c].setZero();
                   std::vector<Vector3> forces = along;
                   for (const int c : touching) {
                     forces[c] += pressures[c] * normals[c];
                     limits[c] = options.friction * std::max(pressures[c], 0.0);
                   }
                   const VectorX displacement = displacement_of(patch, forces);
                   for (const int c : touching)
                     slip[c] = displacement.segment<3>(3 * c) - state.bond[c];
                   const SlidingContact contact{touching, patch.compliance.data(),
                                                static_cast<std::size_t>(patch.compliance.rows()), normals, limits};
                   last_normals = normals;
                   double moved = 0;
                   for (int round = 0; round < rounds; ++round) {
                     moved = relax_friction(contact, slip, along);
                     if (moved < 0.1 * options.gap_tolerance)
                       break;
                   }
                   return moved < options.gap_tolerance;
                 });
  // What has slipped sticks from here on; what has not keeps its place along the surface.
  for (int c = 0; c < count; ++c) {
    const Vector3 u = state.displacement.segment<3>(3 * c);
    if (state.active[c] && !slips(along[c], limits[c])) {
      state.bond[c] += last_normals[c].dot(u - state.bond[c]) * last_normals[c];
      continue;
    }
    if (state.active[c])
      state.friction_work -= along[c].dot(u - state.bond[c]);
    state.bond[c] = u;
  }
}

/// The contact that a memory tells of, on the nodes of this patch: pressures as they come out here, and along the
/// surface the remembered share of the limit, from the nearest nodes of then. So a node set that changes does not let
/// go of what sticks, and what slipped goes on slipping with the same force.
ContactState recalled(const ContactPatch& patch, const topology::ToolShape& shape, const ContactOptions& options,
                      const GripMemory& memory) {
  ContactState state = resting(patch, memory.pose);
  const int count = size_of(patch);
  std::vector<Vector3> shares(count, Vector3::Zero());
  for (int c = 0; c < count; ++c) {
    double weights = 0;
    for (std::size_t k = 0; k < memory.rest.size(); ++k) {
      const double distance = (patch.rest[c] - memory.rest[k]).squaredNorm() / (patch.spacings[c] * patch.spacings[c]);
      const double weight = 1 / (distance * distance + 1e-12);
      weights += weight;
      shares[c] += weight * memory.share[k];
    }
    if (weights > 0)
      shares[c] /= weights;
  }
  std::vector<Vector3>& along = state.along;
  press_normally(patch, pressing(shape, memory.pose, patch.rest, patch.normals), options, along, state,
                 [&](const std::vector<Vector3>& normals, const VectorX& pressures, const ContactState& now) {
                   double change = 0;
                   double largest = 0;
                   for (int c = 0; c < count; ++c) {
                     const double limit = now.active[c] ? options.friction * std::max(pressures[c], 0.0) : 0;
                     const Vector3 force = limit * along_surface(shares[c], normals[c]);
                     change = std::max(change, (force - along[c]).norm());
                     largest = std::max(largest, limit);
                     along[c] = force;
                   }
                   return change <= 1e-6 * largest;
                 });
  for (int c = 0; c < count; ++c)
    state.bond[c] = state.displacement.segment<3>(3 * c);
  return state;
}

void press_bonded(const ContactPatch& patch, const PressingTool& tool, const ContactOptions& options,
                  ContactState& state) {
  // A node caught by the tool keeps its place on it; a free node that the tool has overtaken is caught where it is.
  const int count = size_of(patch);
  std::vector<char> caught = state.active;
  for (int c = 0; c < count; ++c)
    if (caught[c])
      state.bond[c] += tool.pose.point - state.pose.point;
  for (int round = 0; round <= count; ++round) {
    ++state.iterations;
    std::vector<int> held;
    std::vector<Vector3> values;
    for (int c = 0; c < count; ++c)
      if (caught[c]) {
        held.push_back(c);
        values.push_back(state.bond[c]);
      }
    hold(patch, held, values, state);
    bool grew = false;
    for (int c = 0; c < count; ++c) {
      if (caught[c])
        continue;
      const Vector3 u = state.displacement.segment<3>(3 * c);
      const Gap gap = gap_of(tool, patch, c, u);
      if (gap.distance < -options.gap_tolerance) {
        caught[c] = 1;
        state.bond[c] = u - gap.distance * gap.normal;
        grew = true;
      }
    }
    if (!grew)
      return;
  }
}

/// A patch with all but its compliance and fields.
ContactPatch bare_patch(const Discretisation& body, const std::vector<int>& candidates) {
  const Problem& problem = body.problem();
  if (candidates.empty())
    throw InputError("no candidate contact nodes: the tool's patch holds no surface node");
  for (int node : candidates) {
    if (node < 0 || node >= problem.nodes.size())
      throw InputError(fmt::format("candidate node {} does not exist; there are {}", node, problem.nodes.size()));
    std::array<bool, 3> held{};
    for (const Prescribed& entry : problem.prescribed)
      for (std::size_t c = 0; c < 3 && entry.node == node; ++c)
        held[c] |= entry.components[c];
    if (held[0] && held[1] && held[2])
      throw InputError(fmt::format("candidate node {} is fixed; the tool cannot press on the fixed region", node));
  }
  ContactPatch patch;
  patch.nodes = candidates;
  for (int node : candidates) {
    patch.rest.push_back(body.contact_point(node));
    patch.normals.push_back(problem.nodes.normals[node]);
    patch.spacings.push_back(problem.nodes.spacings[node]);
  }
  static std::atomic<std::uint64_t> condensed = 0;
  patch.number = ++condensed;
  patch.base = body.solve();
  patch.base_displacement = body.contact_displacements(candidates, {patch.base}).col(0);
  return patch;
}

} // namespace

ContactPatch condense_without_fields(const Discretisation& body, const std::vector<int>& candidates) {
  ContactPatch patch = bare_patch(body, candidates);
  patch.compliance = body.contact_compliance(candidates);
  return patch;
}

void extend_responses(const Discretisation& body, int nodes, ContactPatch& patch) {
  const auto first = patch.nodes.begin() + std::ssize(patch.responses) / 3;
  const auto last = first + std::min<std::ptrdiff_t>(nodes, patch.nodes.end() - first);
  for (Field& field : body.force_responses({first, last}))
    patch.responses.push_back(std::move(field));
}

ContactPatch condense(const Discretisation& body, const std::vector<int>& candidates,
                      const std::optional<HalfSpaceCoupling>& coupling) {
  ContactPatch patch = bare_patch(body, candidates);
  patch.responses = body.force_responses(candidates);
  if (coupling) {
    // The far boundary moves as the half-space would under the tool's force: u_far = sum_a F_a B_a, F the sum of all
    // nodal forces, so every unit response carries the field of its own far boundary.
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vector3> values;
      for (const Vector3& point : body.constraint_points())
        values.push_back(half_space_displacement(body.problem().material, Vector3::Unit(axis), coupling->origin,
                                                 coupling->inward, point));
      const Field far = body.prescribed_response(values);
      for (std::size_t c = 0; c < candidates.size(); ++c)
        patch.responses[3 * c + axis].add(1, far);
    }
  }
  patch.compliance = body.contact_displacements(candidates, patch.responses);
  return patch;
}

ContactState among(const ContactPatch& patch, const ContactState& state, const std::vector<int>& nodes) {
  require_own(patch, state);
  ContactState result = state;
  const std::size_t count = nodes.size();
  result.nodal_forces.assign(count, Vector3::Zero());
  result.active.assign(count, 0);
  result.along.assign(count, Vector3::Zero());
  result.bond.assign(count, Vector3::Zero());
  result.displacement = VectorX::Zero(3 * static_cast<Eigen::Index>(count));
  for (std::size_t k = 0; k < count; ++k) {
    const auto known = std::find(patch.nodes.begin(), patch.nodes.end(), nodes[k]);
    if (known == patch.nodes.end())
      continue;
    const auto c = known - patch.nodes.begin();
    const auto at = static_cast<std::size_t>(c);
    result.nodal_forces[k] = state.nodal_forces[at];
    result.active[k] = state.active[at];
    result.along[k] = state.along[at];
    result.bond[k] = state.bond[at];
    result.displacement.segment<3>(3 * static_cast<Eigen::Index>(k)) = state.displacement.segment<3>(3 * c);
  }
  return result;
}

ContactState press(const ContactPatch& patch, const topology::ToolShape& tool, const topology::ToolPose& pose,
                   const ContactOptions& options, const ContactState* previous) {
  const bool frictional = options.condition == ContactCondition::frictional;
  topology::check(tool);
  topology::check(pose);
  if (options.maximum_iterations < 1 || !(options.gap_tolerance > 0) || !std::isfinite(options.gap_tolerance))
    throw InputError(fmt::format("{} iterations to a tolerance of {:g} m; allowed: both above 0",
                                 options.maximum_iterations, options.gap_tolerance));
  if (!(options.friction >= 0) || !std::isfinite(options.friction))
    throw InputError(fmt::format("a coefficient of friction of {:g}; allowed: 0 or more", options.friction));
  topology::ToolPose from = pose;
  ContactState state;
  if (previous != nullptr && previous->memory) {
    state = recalled(patch, tool, options, *previous->memory);
    from = state.pose;
  } else if (previous != nullptr) {
    require_own(patch, *previous);
    state = *previous;
    from = state.pose;
  } else {
    double deepest = 0;
    for (int c = 0; c < size_of(patch); ++c)
      deepest =
          std::max(deepest, (patch.rest[c] + patch.base_displacement.segment<3>(3 * c) - pose.point).dot(pose.axis));
    from.point += deepest * pose.axis;
    state = resting(patch, from);
  }
  state.iterations = 0;
  state.friction_work = 0;
  const double stride = (frictional ? 0.1 : 0.5) * topology::tip_radius(tool);
  const int steps = std::max(1, static_cast<int>(std::ceil((pose.point - from.point).norm() / stride)));
  for (int step = 1; step <= steps; ++step) {
    interruption_point();
    const double t = static_cast<double>(step) / steps;
    topology::ToolPose at = pose;
    if (step < steps) {
      at.point = from.point + t * (pose.point - from.point);
      at.axis = (from.axis + t * (pose.axis - from.axis)).normalized();
    }
    const PressingTool now = pressing(tool, at, patch.rest, patch.normals);
    if (options.condition == ContactCondition::frictionless)
      press_frictionless(patch, now, options, state);
    else if (frictional)
      press_frictional(patch, now, options, state);
    else
      press_bonded(patch, now, options, state);
    state.pose = at;
  }
  state.largest_penetration = 0;
  const PressingTool pressed = pressing(tool, pose, patch.rest, patch.normals);
  for (int c = 0; c < size_of(patch); ++c)
    state.largest_penetration =
        std::max(state.largest_penetration,
                 -gap_of(pressed, patch, c, state.displacement.segment<3>(3 * c), flank_hold).distance);
  summarise(patch, state);
  return state;
}

Vector3 torque_about(const ContactState& state, const Vector3& point) {
  return state.tool_torque + (state.pose.point - point).cross(state.tool_force);
}

std::optional<GripMemory> remember(const ContactPatch& patch, const ContactState& state, double friction) {
  if (state.active_nodes == 0)
    return std::nullopt;
  GripMemory memory;
  memory.pose = state.pose;
  for (int c = 0; c < size_of(patch); ++c) {
    if (!state.active[c])
      continue;
    const double limit = friction * (state.nodal_forces[c] - state.along[c]).norm();
    memory.rest.push_back(patch.rest[c]);
    memory.share.push_back(limit > 0 ? Vector3(state.along[c] / limit) : Vector3::Zero());
  }
  return memory;
}

MatrixX forces_against(const ContactPatch& patch, const MatrixX& displacements) {
  std::vector<int> all(patch.nodes.size());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<Eigen::Index> rows = movable_rows(patch, all);
  MatrixX forces = MatrixX::Zero(displacements.rows(), displacements.cols());
  forces(rows, Eigen::all) =
      -MatrixX(patch.compliance(rows, rows)).partialPivLu().solve(displacements(rows, Eigen::all));
  return forces;
}

ContactState prescribe(const ContactPatch& patch, const std::vector<Vector3>& displacements) {
  if (displacements.size() != patch.nodes.size())
    throw InputError(fmt::format("{} displacements for {} candidate nodes", displacements.size(), patch.nodes.size()));
  for (std::size_t c = 0; c < displacements.size(); ++c)
    if (!displacements[c].allFinite())
      throw InputError(fmt::format("the displacement of candidate node {} is ({}, {}, {}) m; it must be finite",
                                   patch.nodes[c], displacements[c].x(), displacements[c].y(), displacements[c].z()));
  ContactState state = resting(patch, {});
  std::vector<int> held(patch.nodes.size());
  for (int c = 0; c < size_of(patch); ++c)
    held[c] = c;
  hold(patch, held, displacements, state);
  state.iterations = 1;
  summarise(patch, state);
  return state;
}

Field deform(const Discretisation& body, const ContactPatch& patch, const ContactState& state) {
  if (has_fields(patch))
    return deform(patch, state);
  require_forces(patch, state);
  Field field = patch.base;
  std::vector<int> nodes;
  std::vector<Vector3> forces;
  for (int c = 0; c < size_of(patch); ++c)
    if (!state.nodal_forces[c].isZero(0)) {
      nodes.push_back(patch.nodes[c]);
      forces.push_back(state.nodal_forces[c]);
    }
  if (!nodes.empty())
    field.add(1, body.force_response(nodes, forces));
  return field;
}

Field deform(const ContactPatch& patch, const ContactState& state) {
  if (!has_fields(patch))
    throw InputError(fmt::format("a patch of {} candidates with {} fields of unit forces; allowed: three each",
                                 patch.nodes.size(), patch.responses.size()));
  require_forces(patch, state);
  Field field = patch.base;
  for (int c = 0; c < size_of(patch); ++c)
    for (int axis = 0; axis < 3; ++axis)
      if (state.nodal_forces[c][axis] != 0)
        field.add(state.nodal_forces[c][axis], patch.responses[3 * c + axis]);
  return field;
}

} // namespace spherecut::solvers
