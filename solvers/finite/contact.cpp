#include "solvers/finite/contact.hpp"

#include "solvers/contact/friction.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr double overtaken = 1e-6; // spacings deep in a tool that bonds: such a share is held

topology::ToolPose between(const topology::ToolPose& from, const topology::ToolPose& to, double part) {
  const Vector3 axis = (1 - part) * from.axis + part * to.axis;
  return {(1 - part) * from.point + part * to.point, axis.norm() > 1e-6 ? Vector3(axis.normalized()) : to.axis};
}

/// Where x is that stays until the tool meets it on its way and goes along from then on: at the first place of the
/// tool's surface that comes to it, be it an edge's that has gone by.
Vector3 taken_along(const topology::ToolShape& tool, const topology::ToolPose& from, const topology::ToolPose& to,
                    const Vector3& x) {
  if (topology::tool_distance(tool, to, x) >= 0)
    return x;
  if (topology::tool_distance(tool, from, x) <= 0)
    return x + tool_motion(from, to, x);
  double clear = 0, met = 1;
  for (int halving = 0; halving < 50; ++halving) {
    const double middle = 0.5 * (clear + met);
    (topology::tool_distance(tool, between(from, to, middle), x) > 0 ? clear : met) = middle;
  }
  return x + tool_motion(between(from, to, met), to, x);
}

} // namespace

FiniteContact::FiniteContact(const FiniteBody& body, topology::ToolShape tool, const std::vector<int>& candidates,
                             const FiniteContactOptions& options)
    : body_(body), tool_(std::move(tool)), options_(options), nodes_(candidates), known_(candidates.size()),
      limits_(candidates.size(), 0), planes_(candidates.size(), Vector3::UnitZ()),
      places_(candidates.size(), Vector3::Zero()), gaps_(candidates.size(), {0, Vector3::UnitZ()}) {
  topology::check(tool_);
  if (!(options.stiffness > 0) || !std::isfinite(options.stiffness))
    throw InputError(fmt::format("contact stiffness {}: it must be positive", options.stiffness));
  if (!(options.friction >= 0) || !std::isfinite(options.friction))
    throw InputError(fmt::format("a coefficient of friction of {:g}; allowed: 0 or more", options.friction));
  for (const int node : nodes_) {
    means_.push_back(body_.contact_mean(node));
    const DisplacementMean& mean = means_.back();
    const bool on_skin = body_.problem().nodes.kinds[node] != NodeKind::lip;
    rest_.push_back(on_skin ? body_.problem().domain->closest_surface_point(mean.centroid) : mean.centroid);
    const double h = body_.problem().nodes.spacings[node];
    stiffness_.push_back(options.stiffness * body_.problem().material.young_modulus * std::max(mean.area / h, h));
  }
}

topology::ToolPose FiniteContact::clear_pose(const topology::ToolPose& pose, const VectorX& coefficients) const {
  double deepest = 0;
  for (std::size_t c = 0; c < nodes_.size(); ++c)
    deepest = std::max(deepest, (place(static_cast<int>(c), coefficients) - pose.point).dot(pose.axis));
  return {pose.point + deepest * pose.axis, pose.axis};
}

void FiniteContact::release() {
  active_.clear();
  deepest_ = force_norm_ = friction_work_ = 0;
}

void FiniteContact::begin_step(const std::optional<topology::ToolPose>& from, const topology::ToolPose& to,
                               std::vector<ContactShare> shares, const VectorX& coefficients) {
  known_ = std::move(shares);
  from_ = from;
  pose_ = to;
  if (!bonds() && !rubs())
    return;
  const Eigen::Quaterniond turn =
      from ? Eigen::Quaterniond::FromTwoVectors(from->axis, to.axis) : Eigen::Quaterniond::Identity();
  for (std::size_t c = 0; c < nodes_.size(); ++c) {
    ContactShare& share = known_[c];
    if (share.touches) {
      if (from)
        share.anchor += tool_motion(*from, to, share.anchor);
      share.along = turn * share.along;
    } else if (rubs()) {
      share.anchor = place(static_cast<int>(c), coefficients);
      if (from)
        share.anchor = taken_along(tool_, *from, to, share.anchor);
    }
    if (rubs()) {
      planes_[c] = topology::tool_normal(tool_, to, share.anchor);
      limits_[c] = options_.friction * share.pressing;
    }
  }
}

double FiniteContact::add_grip(std::size_t c, Active& active) const {
  const ContactShare& share = known_[c];
  const double k = stiffness_[c], before = 0.5 * share.along.squaredNorm() / k;
  const Vector3 way = places_[c] - share.anchor;
  if (bonds()) {
    active.along = share.along - k * way;
    return 0.5 * active.along.squaredNorm() / k - before;
  }
  const double limit = limits_[c];
  const Vector3 wanted = along_surface(share.along - k * way, planes_[c]);
  const double size = wanted.norm();
  if (size <= limit) {
    active.along = wanted;
    return 0.5 * size * size / k - before;
  }
  active.along = limit / size * wanted;
  active.looseness = limit > 0 ? size / limit : 0;
  return limit * (size - 0.5 * limit) / k - before;
}

double FiniteContact::add(const VectorX& coefficients, VectorX& forces) {
  double energy = 0;
  active_.clear();
  deepest_ = 0;
  VectorX own = VectorX::Zero(forces.size());
  for (std::size_t c = 0; c < nodes_.size(); ++c) {
    const ContactShare& share = known_[c];
    const double k = stiffness_[c], h = body_.problem().nodes.spacings[nodes_[c]];
    places_[c] = place(static_cast<int>(c), coefficients);
    Active active{static_cast<int>(c), Vector3::Zero(), 0, Vector3::Zero(), 1};
    if (bonds() && share.touches) {
      energy += add_grip(c, active);
      deepest_ = std::max(deepest_, (places_[c] - share.anchor).norm() / h);
    } else {
      gaps_[c] = topology::tool_distance_and_normal(tool_, pose_, places_[c]);
      deepest_ = std::max(deepest_, -gaps_[c].distance / h);
      if (bonds())
        continue;
      active.normal = gaps_[c].normal;
      active.pressing = std::max(0.0, share.pressing - k * gaps_[c].distance);
      energy += 0.5 * (active.pressing * active.pressing - share.pressing * share.pressing) / k;
      if (active.pressing > 0)
        deepest_ = std::max(deepest_, gaps_[c].distance / h); // a force across a gap
      if (rubs())
        energy += add_grip(c, active);
      if (!(active.pressing > 0) && active.along.isZero(0))
        continue;
    }
    active_.push_back(active);
    const Vector3 force = active.pressing * active.normal + active.along;
    for (std::size_t k_of = 0; k_of < means_[c].nodes.size(); ++k_of)
      own.segment<3>(3 * means_[c].nodes[k_of]) -= means_[c].weights[k_of] * force;
  }
  force_norm_ = own.norm();
  forces += own;
  return energy;
}

bool FiniteContact::renew() {
  bool caught = false;
  if (rubs()) {
    std::fill(limits_.begin(), limits_.end(), 0.0);
    for (const Active& active : active_) {
      limits_[active.candidate] = options_.friction * active.pressing;
      planes_[active.candidate] = active.normal;
    }
  }
  for (std::size_t c = 0; bonds() && c < nodes_.size(); ++c) {
    ContactShare& share = known_[c];
    if (share.touches || gaps_[c].distance > -overtaken * body_.problem().nodes.spacings[nodes_[c]])
      continue;
    share.touches = caught = true;
    share.anchor = from_ ? taken_along(tool_, *from_, pose_, places_[c])
                         : Vector3(places_[c] - gaps_[c].distance * gaps_[c].normal);
  }
  return caught;
}

void FiniteContact::accept_forces() {
  for (ContactShare& share : known_) {
    share.pressing = 0;
    share.along.setZero();
  }
  for (const Active& active : active_) {
    known_[active.candidate].pressing = active.pressing;
    known_[active.candidate].along = active.along;
  }
}

std::vector<ContactShare> FiniteContact::end_step() {
  accept_forces();
  friction_work_ = 0;
  std::vector<ContactShare> shares = known_;
  if (!rubs())
    return shares;
  for (ContactShare& share : shares)
    share.touches = false;
  for (const Active& active : active_) {
    ContactShare& share = shares[active.candidate];
    const Vector3& x = places_[active.candidate];
    share.touches = active.pressing > 0;
    if (!slips(active.along, limits_[active.candidate])) {
      share.anchor += active.normal.dot(x - share.anchor) * active.normal;
      continue;
    }
    friction_work_ -= active.along.dot(x - share.anchor);
    share.anchor = x;
  }
  return shares;
}

std::vector<ContactShare> FiniteContact::held(const VectorX& coefficients) const {
  std::vector<ContactShare> shares(nodes_.size());
  for (std::size_t c = 0; c < nodes_.size(); ++c) {
    shares[c].anchor = place(static_cast<int>(c), coefficients);
    shares[c].touches = true;
  }
  return shares;
}

Vector3 FiniteContact::tool_force() const {
  Vector3 sum = Vector3::Zero();
  for (const Active& active : active_)
    sum -= active.pressing * active.normal + active.along;
  return sum;
}

Vector3 FiniteContact::tool_torque() const {
  Vector3 sum = Vector3::Zero();
  for (const Active& active : active_)
    sum -= (places_[active.candidate] - pose_.point).cross(active.pressing * active.normal + active.along);
  return sum;
}

Vector3 FiniteContact::friction_force() const {
  Vector3 sum = Vector3::Zero();
  for (const Active& active : active_)
    if (!bonds())
      sum -= active.along;
  return sum;
}

double FiniteContact::unsettled() const {
  if (!bonds() && !rubs())
    return 0;
  VectorX change = VectorX::Zero(3 * static_cast<Eigen::Index>(body_.functions()));
  std::vector<Vector3> now(nodes_.size(), Vector3::Zero());
  for (const Active& active : active_)
    now[active.candidate] = active.along;
  for (std::size_t c = 0; c < nodes_.size(); ++c)
    for (std::size_t k = 0; k < means_[c].nodes.size(); ++k)
      change.segment<3>(3 * means_[c].nodes[k]) += means_[c].weights[k] * (now[c] - known_[c].along);
  return change.norm();
}

std::vector<Vector3> FiniteContact::forces() const {
  std::vector<Vector3> result(nodes_.size(), Vector3::Zero());
  for (const Active& active : active_)
    result[active.candidate] = active.pressing * active.normal + active.along;
  return result;
}

// A share that slips gives way along its slip, and across it as far as its force turns.
void FiniteContact::append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const {
  for (const Active& active : active_) {
    const int c = active.candidate;
    const auto add = [&](const Vector3& direction, double stiffness) {
      constraints.push_back({.key = c,
                             .mean = &means_[c],
                             .direction = maps.empty() ? direction : Vector3(maps[nodes_[c]].transpose() * direction),
                             .stiffness = stiffness});
    };
    if (bonds()) {
      for (int axis = 0; axis < 3; ++axis)
        add(Vector3::Unit(axis), stiffness_[c]);
      continue;
    }
    if (active.pressing > 0)
      add(active.normal, stiffness_[c]);
    if (!rubs() || !(limits_[c] > 0))
      continue;
    const bool sticks = active.looseness <= 1;
    const Vector3 first = sticks ? planes_[c].unitOrthogonal() : active.along.normalized();
    add(planes_[c].cross(first), stiffness_[c] / active.looseness);
    if (sticks)
      add(first, stiffness_[c]);
  }
}

} // namespace spherecut::solvers
