// Notation: c candidate node with rest position x_c, u its displacement, f its force; C the 3m x 3m compliance, so that
// u = u0 + C f. The tool's surface is linearised at x_c + u_c: gap g_c and outward normal n_c. With f_c = lambda_c n_c
//
//   w = q + N^T C N lambda >= 0,  lambda >= 0,  lambda . w = 0,   q_c = g_c + n_c . (u0_c - u_c),
//
// and the linearisation is repeated until u stands still.
#include "solvers/contact_solver.hpp"

#include "solvers/half_space.hpp"
#include "solvers/linear_complementarity.hpp"
#include "solvers/tool_gap.hpp"
#include "topology/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

int size_of(const ContactPatch& patch) {
  return static_cast<int>(patch.nodes.size());
}

VectorX displacement_of(const ContactPatch& patch, const std::vector<Vector3>& forces) {
  VectorX stacked(3 * size_of(patch));
  for (int c = 0; c < size_of(patch); ++c)
    stacked.segment<3>(3 * c) = forces[c];
  return patch.base_displacement + patch.compliance * stacked;
}

void summarise(const ContactPatch& patch, ContactState& state) {
  state.tool_force.setZero();
  state.centre.setZero();
  state.active_nodes = 0;
  state.contact_radius = 0;
  double weight = 0;
  for (int c = 0; c < size_of(patch); ++c) {
    state.tool_force -= state.nodal_forces[c];
    if (!state.active[c])
      continue;
    ++state.active_nodes;
    const double force = state.nodal_forces[c].norm();
    weight += force;
    state.centre += force * patch.rest[c];
  }
  if (weight > 0)
    state.centre /= weight;
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
  state.bond.assign(count, Vector3::Zero());
  state.displacement = patch.base_displacement;
  state.pose = pose;
  return state;
}

/// Nodes with prescribed displacements `values` on `held`, the others free of force.
void hold(const ContactPatch& patch, const std::vector<int>& held, const std::vector<Vector3>& values,
          ContactState& state) {
  const auto count = static_cast<Eigen::Index>(held.size());
  MatrixX compliance(3 * count, 3 * count);
  VectorX right(3 * count);
  for (Eigen::Index a = 0; a < count; ++a) {
    right.segment<3>(3 * a) = values[static_cast<std::size_t>(a)] - patch.base_displacement.segment<3>(3 * held[a]);
    for (Eigen::Index b = 0; b < count; ++b)
      compliance.block<3, 3>(3 * a, 3 * b) = patch.compliance.block<3, 3>(3 * held[a], 3 * held[b]);
  }
  const VectorX forces = compliance.partialPivLu().solve(right);
  std::fill(state.nodal_forces.begin(), state.nodal_forces.end(), Vector3::Zero());
  std::fill(state.active.begin(), state.active.end(), 0);
  for (Eigen::Index a = 0; a < count; ++a) {
    state.nodal_forces[held[a]] = forces.segment<3>(3 * a);
    state.active[held[a]] = 1;
  }
  state.displacement = displacement_of(patch, state.nodal_forces);
}

void press_frictionless(const ContactPatch& patch, const PressingTool& tool, const ContactOptions& options,
                        ContactState& state) {
  const int count = size_of(patch);
  MatrixX condensed(count, count);
  VectorX gaps(count);
  std::vector<Vector3> normals(count);
  state.converged = false;
  double relaxation = 1;
  VectorX last_step;
  for (int iteration = 0; iteration < options.maximum_iterations; ++iteration) {
    ++state.iterations;
    for (int c = 0; c < count; ++c) {
      const Vector3 u = state.displacement.segment<3>(3 * c);
      const Gap gap = contact_gap(tool, patch.rest[c] + u);
      normals[c] = gap.normal;
      gaps[c] = gap.distance + gap.normal.dot(patch.base_displacement.segment<3>(3 * c) - u);
    }
    for (int c = 0; c < count; ++c)
      for (int d = 0; d < count; ++d)
        condensed(c, d) = normals[c].dot(patch.compliance.block<3, 3>(3 * c, 3 * d) * normals[d]);
    const ComplementaritySolution solution =
        solve_complementarity(condensed, gaps, state.active, 0.1 * options.gap_tolerance);
    for (int c = 0; c < count; ++c)
      state.nodal_forces[c] = solution.forces[c] * normals[c];
    state.active = solution.active;
    const VectorX displacement = displacement_of(patch, state.nodal_forces);
    const VectorX step = displacement - state.displacement;
    if (step.lpNorm<Eigen::Infinity>() < options.gap_tolerance && solution.converged) {
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
      const Gap gap = contact_gap(tool, patch.rest[c] + u);
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

} // namespace

ContactPatch condense(const Discretisation& body, const std::vector<int>& candidates,
                      const std::optional<HalfSpaceCoupling>& coupling) {
  const Problem& problem = body.problem();
  if (candidates.empty())
    throw InputError("no candidate contact nodes: the tool's patch holds no surface node");
  for (int node : candidates) {
    if (node < 0 || node >= problem.nodes.size())
      throw InputError(fmt::format("candidate node {} does not exist; there are {}", node, problem.nodes.size()));
    for (const Prescribed& entry : problem.prescribed)
      if (entry.node == node)
        throw InputError(fmt::format("candidate node {} is fixed; the tool cannot press on the fixed region", node));
  }
  ContactPatch patch;
  patch.nodes = candidates;
  for (int node : candidates) {
    patch.rest.push_back(body.contact_point(node));
    patch.normals.push_back(problem.nodes.normals[node]);
    patch.spacings.push_back(problem.nodes.spacings[node]);
  }
  patch.base = body.solve();
  patch.responses = body.force_responses(candidates);
  if (coupling) {
    // The far boundary moves as the half-space would under the tool's force: u_far = sum_a F_a B_a, F the sum of all
    // nodal forces, so every unit response carries the field of its own far boundary.
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vector3> values;
      for (const Vector3& point : body.constraint_points())
        values.push_back(
            half_space_displacement(problem.material, Vector3::Unit(axis), coupling->origin, coupling->inward, point));
      const Field far = body.prescribed_response(values);
      for (std::size_t c = 0; c < candidates.size(); ++c)
        patch.responses[3 * c + axis].add(1, far);
    }
  }
  patch.base_displacement = body.contact_displacements(candidates, {patch.base}).col(0);
  patch.compliance = body.contact_displacements(candidates, patch.responses);
  return patch;
}

ContactState press(const ContactPatch& patch, const topology::ToolShape& tool, const topology::ToolPose& pose,
                   const ContactOptions& options, const ContactState* previous) {
  topology::ToolPose from = pose;
  if (previous != nullptr) {
    from = previous->pose;
  } else {
    double deepest = 0;
    for (int c = 0; c < size_of(patch); ++c)
      deepest =
          std::max(deepest, (patch.rest[c] + patch.base_displacement.segment<3>(3 * c) - pose.point).dot(pose.axis));
    from.point += deepest * pose.axis;
  }
  ContactState state = previous != nullptr ? *previous : resting(patch, from);
  state.iterations = 0;
  const double stride = 0.5 * topology::tip_radius(tool);
  const int steps = std::max(1, static_cast<int>(std::ceil((pose.point - from.point).norm() / stride)));
  for (int step = 1; step <= steps; ++step) {
    const double t = static_cast<double>(step) / steps;
    topology::ToolPose at = pose;
    if (step < steps) {
      at.point = from.point + t * (pose.point - from.point);
      at.axis = (from.axis + t * (pose.axis - from.axis)).normalized();
    }
    if (options.condition == ContactCondition::frictionless)
      press_frictionless(patch, pressing(tool, at, patch.rest, patch.normals), options, state);
    else
      press_bonded(patch, pressing(tool, at, patch.rest, patch.normals), options, state);
    state.pose = at;
  }
  state.largest_penetration = 0;
  const PressingTool pressed = pressing(tool, pose, patch.rest, patch.normals);
  for (int c = 0; c < size_of(patch); ++c)
    state.largest_penetration =
        std::max(state.largest_penetration,
                 -contact_gap(pressed, patch.rest[c] + state.displacement.segment<3>(3 * c)).distance);
  summarise(patch, state);
  return state;
}

ContactState prescribe(const ContactPatch& patch, const std::vector<Vector3>& displacements) {
  if (displacements.size() != patch.nodes.size())
    throw InputError(fmt::format("{} displacements for {} candidate nodes", displacements.size(), patch.nodes.size()));
  ContactState state = resting(patch, {});
  std::vector<int> held(patch.nodes.size());
  for (int c = 0; c < size_of(patch); ++c)
    held[c] = c;
  hold(patch, held, displacements, state);
  state.iterations = 1;
  summarise(patch, state);
  return state;
}

Field deform(const ContactPatch& patch, const ContactState& state) {
  Field field = patch.base;
  for (int c = 0; c < size_of(patch); ++c)
    for (int axis = 0; axis < 3; ++axis)
      if (state.nodal_forces[c][axis] != 0)
        field.add(state.nodal_forces[c][axis], patch.responses[3 * c + axis]);
  return field;
}

} // namespace spherecut::solvers
