#include "solvers/finite/contact.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

FiniteContact::FiniteContact(const FiniteBody& body, topology::ToolShape tool, const std::vector<int>& candidates,
                             double stiffness)
    : body_(body), tool_(std::move(tool)), nodes_(candidates), known_(candidates.size(), 0) {
  topology::check(tool_);
  if (!(stiffness > 0) || !std::isfinite(stiffness))
    throw InputError(fmt::format("contact stiffness {}: it must be positive", stiffness));
  for (const int node : nodes_) {
    means_.push_back(body_.contact_mean(node));
    const DisplacementMean& mean = means_.back();
    const bool on_skin = body_.problem().nodes.kinds[node] != NodeKind::lip;
    rest_.push_back(on_skin ? body_.problem().domain->closest_surface_point(mean.centroid) : mean.centroid);
    const double h = body_.problem().nodes.spacings[node];
    stiffness_.push_back(stiffness * body_.problem().material.young_modulus * std::max(mean.area / h, h));
  }
}

double FiniteContact::add(const VectorX& coefficients, VectorX& forces) {
  double energy = 0;
  active_.clear();
  deepest_ = 0;
  VectorX own = VectorX::Zero(forces.size());
  for (std::size_t c = 0; c < nodes_.size(); ++c) {
    const Vector3 x = rest_[c] + means_[c].of(coefficients);
    const topology::DistanceAndNormal gap = topology::tool_distance_and_normal(tool_, pose_, x);
    const double force = known_[c] - stiffness_[c] * gap.distance;
    deepest_ = std::max(deepest_, -gap.distance / body_.problem().nodes.spacings[nodes_[c]]);
    energy -= 0.5 * known_[c] * known_[c] / stiffness_[c];
    if (!(force > 0))
      continue;
    energy += 0.5 * force * force / stiffness_[c];
    deepest_ = std::max(deepest_, gap.distance / body_.problem().nodes.spacings[nodes_[c]]); // a force across a gap
    active_.push_back({static_cast<int>(c), gap.normal, x, force});
    for (std::size_t k = 0; k < means_[c].nodes.size(); ++k)
      own.segment<3>(3 * means_[c].nodes[k]) -= means_[c].weights[k] * force * gap.normal;
  }
  force_norm_ = own.norm();
  forces += own;
  return energy;
}

void FiniteContact::accept_forces() {
  std::fill(known_.begin(), known_.end(), 0.0);
  for (const Active& active : active_)
    known_[active.candidate] = active.force;
}

Vector3 FiniteContact::tool_force() const {
  Vector3 sum = Vector3::Zero();
  for (const Active& active : active_)
    sum -= active.force * active.normal;
  return sum;
}

Vector3 FiniteContact::tool_torque() const {
  Vector3 sum = Vector3::Zero();
  for (const Active& active : active_)
    sum -= active.force * (active.place - pose_.point).cross(active.normal);
  return sum;
}

std::vector<Vector3> FiniteContact::forces() const {
  std::vector<Vector3> result(nodes_.size(), Vector3::Zero());
  for (const Active& active : active_)
    result[active.candidate] = active.force * active.normal;
  return result;
}

void FiniteContact::release() {
  active_.clear();
  deepest_ = force_norm_ = 0;
}

void FiniteContact::append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const {
  for (const Active& active : active_)
    constraints.push_back({.key = active.candidate,
                           .mean = &means_[active.candidate],
                           .direction = maps.empty()
                                            ? active.normal
                                            : Vector3(maps[nodes_[active.candidate]].transpose() * active.normal),
                           .stiffness = stiffness_[active.candidate]});
}

} // namespace spherecut::solvers
