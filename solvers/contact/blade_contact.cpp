// Notation: f forces and w displacements of the entries, w = b + C f; x advance of the edge. For the contacts and the
// pairs
//
//   w_contact - x >= 0,  w_pair >= 0,  f >= 0,  f . (w - x) = 0,
//
// and the drag is given. At fixed x the potential energy is that of the body without blade plus f C f / 2 over contacts
// and pairs, since the body without blade is at its minimum.
#include "solvers/contact/blade_contact.hpp"

#include "solvers/algebra/linear_complementarity.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double contact_tolerance = 1e-12; // m
constexpr double share_tolerance = 1e-9;
constexpr int stroke_parts = 8; // looked at before the share is refined

// Gauss points on (0, 1) and their weights.
constexpr std::array<double, 3> radial{0.1127016653792583, 0.5, 0.8872983346207417};
constexpr std::array<double, 3> radial_weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
constexpr std::array<double, 2> lengthwise{-0.2886751345948129, 0.2886751345948129}; // of the length, from the middle
constexpr int around = 6;                                                            // directions in the half disc

ForcePattern pair_pattern(const Discretisation& body, const LipPair& pair) {
  const NodeCloud& nodes = body.problem().nodes;
  return {{nodes.positions[pair.plus], nodes.positions[pair.minus]}, {pair.normal, -pair.normal}};
}

Eigen::Index count(const BladePatch& patch) {
  return std::ssize(patch.contacts);
}

/// Entries that are in unilateral contact: all but the drag.
Eigen::Index unilateral(const BladePatch& patch) {
  return std::ssize(patch.contacts) + std::ssize(patch.pairs);
}

double quadratic(const MatrixX& matrix, const VectorX& vector) {
  return 0.5 * vector.dot(matrix * vector);
}

} // namespace

double edge_half_width(const Material& material, double edge_radius, double toughness) {
  if (!(edge_radius > 0) || !std::isfinite(edge_radius))
    throw InputError(fmt::format("the radius of a blade's edge is {} m; it must be positive and finite", edge_radius));
  if (!(toughness > 0) || !std::isfinite(toughness))
    throw InputError(fmt::format("the toughness is {} J/m2; it must be positive and finite", toughness));
  const double plane_modulus = material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
  return std::sqrt(4 * edge_radius * toughness / (std::numbers::pi * plane_modulus));
}

Vector3 EdgeContact::ahead() const {
  if (edge.isZero(0))
    return push;
  const Vector3 across = normal.cross(edge).normalized();
  return across.dot(push) < 0 ? Vector3(-across) : across;
}

ForcePattern edge_pattern(const EdgeContact& contact, double half_width, const topology::Domain& domain) {
  ForcePattern pattern;
  const Vector3 ahead = contact.ahead(), along = ahead.cross(contact.normal).normalized();
  double total = 0;
  std::vector<double> weights;
  for (std::size_t r = 0; r < radial.size(); ++r)
    for (int k = 0; k < around; ++k)
      for (const double share : lengthwise) {
        const double angle = std::numbers::pi * ((k + 0.5) / around - 0.5);
        const Vector3 x = contact.point + share * contact.length * along +
                          radial[r] * half_width * (std::cos(angle) * ahead + std::sin(angle) * contact.normal);
        if (domain.signed_distance(x) > 0)
          continue;
        pattern.points.push_back(x);
        weights.push_back(radial_weight[r] * radial[r] * (1 - radial[r] * radial[r]));
        total += weights.back();
      }
  if (pattern.points.empty())
    throw InputError(fmt::format("the edge of the blade at ({:.4g}, {:.4g}, {:.4g}) m has no tissue ahead of it",
                                 contact.point.x(), contact.point.y(), contact.point.z()));
  for (const double weight : weights)
    pattern.forces.emplace_back(weight / total * contact.push);
  return pattern;
}

ForcePattern drag_pattern(const std::vector<FlankPoint>& flanks, double shear, const Vector3& way, double spacing) {
  ForcePattern pattern;
  for (const FlankPoint& flank : flanks)
    for (const double side : {1.0, -1.0}) {
      pattern.points.emplace_back(flank.point + side * lip_offset * spacing * flank.normal);
      pattern.forces.emplace_back(shear * flank.area * way);
    }
  return pattern;
}

namespace {

/// Entry of `known` for every one of a patch, -1 where it has none.
std::vector<Eigen::Index> entries_in(const BladePatch& known, const BladePatch& patch) {
  std::vector<Eigen::Index> entries;
  const auto add = [&](const auto& of_known, Eigen::Index first, const auto& is_same) {
    const auto found = std::find_if(of_known.begin(), of_known.end(), is_same);
    entries.push_back(found == of_known.end() ? -1 : first + (found - of_known.begin()));
  };
  for (const EdgeContact& contact : patch.contacts)
    add(known.contacts, 0, [&](const EdgeContact& other) { return other == contact; });
  for (const LipPair& pair : patch.pairs)
    add(known.pairs, count(known), [&](const LipPair& other) {
      return other.plus == pair.plus && other.minus == pair.minus && other.normal == pair.normal;
    });
  if (patch.dragged) {
    const bool is_same =
        known.dragged && known.flanks.points == patch.flanks.points && known.flanks.forces == patch.flanks.forces;
    entries.push_back(is_same ? unilateral(known) : -1);
  }
  return entries;
}

/// Torque of the drag, sum (x + u) x g over its points x with forces g: (u x g) . e = u . (g x e) for every axis e.
/// `same` (may be null): a patch whose entries are those of this one.
void condense_drag_torque(const Discretisation& body, const Field& base, const BladePatch* same, BladePatch& patch) {
  std::vector<ForcePattern> turns(3, {patch.flanks.points, {}});
  for (std::size_t k = 0; k < patch.flanks.points.size(); ++k) {
    const Vector3& force = patch.flanks.forces[k];
    patch.drag_torque += patch.flanks.points[k].cross(force);
    for (int axis = 0; axis < 3; ++axis)
      turns[static_cast<std::size_t>(axis)].forces.emplace_back(force.cross(Vector3::Unit(axis)));
  }
  patch.drag_torque += body.pattern_displacements(turns, {base}).col(0);
  patch.drag_torques = same != nullptr ? same->drag_torques : body.pattern_displacements(turns, patch.responses);
}

/// Adds to every field what keeps the shares of a patch where they are: forces there, whose columns are returned.
MatrixX keep_in_place(const Discretisation& body, const ContactPatch& held, std::vector<Field>& fields) {
  MatrixX forces = forces_against(held, body.contact_displacements(held.nodes, fields));
  const std::vector<Field> back = body.case_responses(held.nodes, forces);
  for (std::size_t k = 0; k < fields.size(); ++k)
    fields[k].add(1, back[k]);
  return forces;
}

} // namespace

BladePatch condense_blade(const Discretisation& body, const Field& base, const std::vector<EdgeContact>& contacts,
                          double half_width, const std::vector<LipPair>& pairs, const ForcePattern& drag,
                          const BladePatch* known, const ContactPatch* held) {
  if (contacts.empty())
    throw InputError("a blade without contacts has nothing to condense");
  BladePatch patch;
  patch.contacts = contacts;
  patch.pairs = pairs;
  patch.dragged = !drag.points.empty();
  std::vector<ForcePattern> patterns;
  patterns.reserve(contacts.size() + pairs.size() + 1);
  for (const EdgeContact& contact : contacts)
    patterns.push_back(edge_pattern(contact, half_width, *body.problem().domain));
  for (const LipPair& pair : pairs)
    patterns.push_back(pair_pattern(body, pair));
  if (patch.dragged) {
    patterns.push_back(drag);
    patch.flanks = drag;
    for (const Vector3& force : drag.forces)
      patch.drag += force;
  }
  const BladePatch none;
  const BladePatch& before = known == nullptr ? none : *known;
  const std::vector<Eigen::Index> entries = entries_in(before, patch);
  std::vector<ForcePattern> unknown;
  bool is_same = entries.size() == before.responses.size();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    is_same = is_same && entries[i] == static_cast<Eigen::Index>(i);
    if (entries[i] < 0)
      unknown.push_back(patterns[i]);
  }
  std::vector<Field> found = unknown.empty() ? std::vector<Field>{} : body.pattern_responses(unknown);
  const bool is_held = held != nullptr && !held->nodes.empty();
  const MatrixX holding = is_held && !found.empty() ? keep_in_place(body, *held, found) : MatrixX{};
  if (is_held)
    patch.held_forces.resize(3 * std::ssize(held->nodes), std::ssize(entries));
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const Eigen::Index entry = entries[i], own = static_cast<Eigen::Index>(i);
    if (is_held)
      patch.held_forces.col(own) = entry < 0 ? holding.col(next) : before.held_forces.col(entry);
    if (entry < 0)
      patch.responses.push_back(std::move(found[static_cast<std::size_t>(next++)]));
    else
      patch.responses.push_back(before.responses[static_cast<std::size_t>(entry)]);
  }
  if (is_same) {
    patch.compliance = before.compliance;
  } else {
    const MatrixX compliance = body.pattern_displacements(patterns, patch.responses);
    patch.compliance = 0.5 * (compliance + compliance.transpose());
  }
  patch.base = body.pattern_displacements(patterns, {base}).col(0);
  patch.free = patch.base;
  if (patch.dragged)
    condense_drag_torque(body, base, is_same ? &before : nullptr, patch);
  if (!patch.compliance.allFinite())
    throw NumericalError(fmt::format("the compliance under {} contacts of a blade is not finite", contacts.size()));
  return patch;
}

BladeState push_blade(const BladePatch& patch, const VectorX& advance, double drag) {
  const Eigen::Index m = count(patch), n = unilateral(patch), all = patch.base.size();
  if (advance.size() != m)
    throw InputError(fmt::format("{} advances for {} contacts of a blade", advance.size(), m));
  if (patch.free.size() != all)
    throw InputError(fmt::format("{} displacements without blade for {} entries", patch.free.size(), all));
  BladeState state;
  state.advance = advance;
  state.forces = VectorX::Zero(all);
  if (patch.dragged)
    state.forces[n] = drag;
  const VectorX free = patch.base + patch.compliance * state.forces; // without edge and lips
  const MatrixX touching = patch.compliance.topLeftCorner(n, n);
  VectorX gap = free.head(n);
  gap.head(m) -= advance;
  const ComplementaritySolution solution = solve_complementarity(touching, gap, {}, contact_tolerance);
  state.forces.head(n) = solution.forces;
  state.converged = solution.converged;
  state.displacements = patch.base + patch.compliance * state.forces;
  state.driving = quadratic(touching, solution.forces);
  if (patch.energy != 0 && !solution.forces.head(m).isZero(0))
    state.driving += patch.energy;
  if (n > m) { // lips that the body's own loads press together hold energy without the blade as well
    const ComplementaritySolution lips =
        solve_complementarity(touching.bottomRightCorner(n - m, n - m), free.segment(m, n - m), {}, contact_tolerance);
    state.driving -= quadratic(touching.bottomRightCorner(n - m, n - m), lips.forces);
  }
  state.stored = state.driving;
  if (patch.dragged)
    state.stored += drag * (state.displacements[n] - patch.free[n]) - 0.5 * drag * drag * patch.compliance(n, n);
  for (Eigen::Index c = 0; c < m; ++c)
    state.edge_force -= state.forces[c] * patch.contacts[static_cast<std::size_t>(c)].push;
  state.blade_force = state.edge_force - drag * patch.drag;
  if (!state.forces.allFinite() || !state.displacements.allFinite())
    throw NumericalError(
        fmt::format("the forces on {} pieces of the blade's edge and {} lip pairs are not finite; it is "
                    "{:g} m past where it met the tissue",
                    m, n - m, m > 0 ? advance.maxCoeff() : 0.0));
  return state;
}

BladeTorque blade_torque(const BladePatch& patch, const BladeState& state, const std::vector<Vector3>& places,
                         const Vector3& about) {
  if (std::ssize(places) != count(patch))
    throw InputError(fmt::format("{} places for {} contacts of a blade", places.size(), count(patch)));
  BladeTorque torque;
  for (std::size_t c = 0; c < places.size(); ++c)
    torque.edge -= state.forces[static_cast<Eigen::Index>(c)] * (places[c] - about).cross(patch.contacts[c].push);
  torque.blade = torque.edge;
  if (patch.dragged) {
    const Vector3 of_drag = patch.drag_torque + patch.drag_torques * state.forces - about.cross(patch.drag);
    torque.blade -= state.forces[unilateral(patch)] * of_drag;
  }
  return torque;
}

Field deform(const BladePatch& patch, const BladeState& state, const Field& base) {
  Field field = base;
  for (Eigen::Index k = 0; k < state.forces.size(); ++k)
    if (state.forces[k] != 0)
      field.add(state.forces[k], patch.responses[static_cast<std::size_t>(k)]);
  return field;
}

double energy_release(const BladePatch& patch, const BladeState& state, const VectorX& motion, const MatrixX& slope) {
  const Eigen::Index m = count(patch);
  double swept = 0;
  for (Eigen::Index c = 0; c < m; ++c)
    swept += motion[c] * patch.contacts[static_cast<std::size_t>(c)].swept_width();
  if (!(swept > 0))
    throw InputError(fmt::format("the edge sweeps an area of {} m2; it must be positive", swept));
  double power = state.forces.head(m).dot(motion);
  if (slope.size() > 0)
    power += quadratic(slope, state.forces.head(m));
  return power / swept;
}

std::optional<double> cutting_share(const BladePatch& now, const BladeStroke& stroke, const BladePatch& cut,
                                    const BladeStroke& cut_stroke, double needed, double drag) {
  const auto enough = [&](double share) {
    const double kept = cut.contacts.empty() ? 0 : push_blade(cut, cut_stroke.at(share), drag).driving;
    return push_blade(now, stroke.at(share), drag).driving - kept >= needed;
  };
  if (enough(0))
    return 0;
  // A cut into stiffer material releases the most somewhere on the way and less beyond.
  int part = 1;
  while (part <= stroke_parts && !enough(static_cast<double>(part) / stroke_parts))
    ++part;
  if (part > stroke_parts)
    return std::nullopt;
  double low = (part - 1.0) / stroke_parts, high = static_cast<double>(part) / stroke_parts;
  while (high - low > share_tolerance) {
    const double middle = 0.5 * (low + high);
    (enough(middle) ? high : low) = middle;
  }
  return high;
}

void BladeLedger::move(const BladePatch& patch, const BladeState& from, const BladeState& to, const VectorX& motion,
                       double slide) {
  const Eigen::Index m = count(patch), n = unilateral(patch);
  const VectorX forces = 0.5 * (from.forces.head(m) + to.forces.head(m));
  work += forces.dot(motion);
  excess += forces.dot(motion - (to.advance - from.advance));
  if (patch.dragged) {
    const double amplitude = 0.5 * (from.forces[n] + to.forces[n]);
    const double blade = amplitude * patch.drag.norm() * slide;
    work += blade;
    friction += blade - amplitude * (to.displacements[n] - from.displacements[n]);
  }
  stored = to.stored;
}

void BladeLedger::cut(const BladeState& before, const BladeState& after, double toughness, double sharpness,
                      double area) {
  const double needed = toughness / sharpness * area;
  surface += toughness * area;
  crushing += needed - toughness * area;
  excess += before.driving - after.driving - needed;
  // What the drag's own elastic energy loses goes into sliding.
  friction += (before.stored - before.driving) - (after.stored - after.driving);
  stored = after.stored;
}

double BladeLedger::imbalance() const {
  return work > 0 ? std::abs(work - surface - crushing - friction - excess - stored) / work : 0;
}

} // namespace spherecut::solvers
