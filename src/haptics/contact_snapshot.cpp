#include "src/haptics/contact_snapshot.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numeric>

namespace spherecut::app {

ContactSnapshot::ContactSnapshot()
    : displacement(most_candidates), forces(most_candidates), along(most_candidates), bond(most_candidates),
      active(most_candidates), lifts(most_candidates) {}

std::shared_ptr<const CondensedContact> numbered(CondensedContact condensed) {
  static std::atomic<std::uint64_t> made = 0;
  condensed.number = ++made;
  return std::make_shared<const CondensedContact>(std::move(condensed));
}

void clear(ContactSnapshot& snapshot) {
  snapshot.count = 0;
  snapshot.force.setZero();
  snapshot.torque.setZero();
  snapshot.blade = {};
  snapshot.reach = 0;
  snapshot.rest_sum = 0;
  snapshot.condensed.reset();
}

namespace {

/// Of the chosen candidates. The symmetric part is made three columns at a time, and nothing of it is kept before one
/// differs from `last`.
std::shared_ptr<const CondensedContact> condensed_contact(const solvers::ContactPatch& patch,
                                                          const std::vector<int>& chosen,
                                                          const std::shared_ptr<const CondensedContact>& last) {
  const bool whole = patch.number != 0 && chosen.size() == patch.nodes.size();
  if (whole && last != nullptr && last->patch == patch.number)
    return last;
  const std::size_t rows = 3 * chosen.size();
  CondensedContact made;
  made.patch = whole ? patch.number : 0;
  for (const int c : chosen) {
    made.rest.push_back(patch.rest[c]);
    made.normals.push_back(patch.normals[c]);
    made.base.emplace_back(patch.base_displacement.segment<3>(3 * c));
  }
  bool same = last != nullptr && last->rest == made.rest && last->normals == made.normals && last->base == made.base;
  std::array<double, static_cast<std::size_t>(9 * most_candidates)> columns;
  double skew = 0;
  double sum = 0;
  for (std::size_t l = 0; l < chosen.size(); ++l) {
    const int d = 3 * chosen[l];
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const int c = 3 * chosen[k];
      const Matrix3 here = patch.compliance.block<3, 3>(c, d);
      const Matrix3 there = patch.compliance.block<3, 3>(d, c).transpose();
      skew += (here - there).squaredNorm();
      sum += (here + there).squaredNorm();
      const Matrix3 mean = 0.5 * (here + there);
      for (int j = 0; j < 3; ++j)
        std::copy_n(mean.col(j).data(), 3, &columns[static_cast<std::size_t>(j) * rows + 3 * k]);
    }
    const std::size_t done = 3 * l * rows;
    if (same && !std::equal(columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(3 * rows),
                            last->compliance.begin() + static_cast<std::ptrdiff_t>(done))) {
      same = false;
      made.compliance.assign(last->compliance.begin(), last->compliance.begin() + static_cast<std::ptrdiff_t>(done));
    }
    if (!same) {
      made.compliance.resize(rows * rows);
      std::copy_n(columns.begin(), 3 * rows, made.compliance.begin() + static_cast<std::ptrdiff_t>(done));
    }
  }
  if (same)
    return last;
  made.asymmetry = sum > 0 ? std::sqrt(skew / sum) : 0;
  return numbered(std::move(made));
}

} // namespace

void fill(const solvers::ContactPatch& patch, const solvers::ContactState& state,
          const topology::SurfaceContact& contact, solvers::ContactCondition condition,
          const std::shared_ptr<const CondensedContact>& last, ContactSnapshot& snapshot) {
  std::vector<int> chosen(patch.nodes.size());
  std::iota(chosen.begin(), chosen.end(), 0);
  if (std::ssize(chosen) > most_candidates) {
    const auto key = [&](int c) {
      return state.active[static_cast<std::size_t>(c)] != 0
                 ? 0.0
                 : (patch.rest[static_cast<std::size_t>(c)] - contact.point).squaredNorm();
    };
    std::stable_sort(chosen.begin(), chosen.end(), [&](int a, int b) { return key(a) < key(b); });
    chosen.resize(most_candidates);
    std::sort(chosen.begin(), chosen.end());
  }
  snapshot.blade = {};
  snapshot.count = static_cast<int>(chosen.size());
  snapshot.contact = contact;
  snapshot.condition = condition;
  snapshot.pose = state.pose;
  snapshot.force = state.tool_force;
  snapshot.torque = state.tool_torque;
  snapshot.reach = 0;
  snapshot.rest_sum = 0;
  for (int k = 0; k < snapshot.count; ++k) {
    const int c = chosen[static_cast<std::size_t>(k)];
    snapshot.rest_sum += patch.rest[c].dot(Vector3(1, 1.7, 2.9)) * (1 + k);
    snapshot.displacement[k] = state.displacement.segment<3>(3 * c);
    snapshot.forces[k] = state.nodal_forces[c];
    snapshot.along[k] = state.along.empty() ? Vector3::Zero() : state.along[c];
    snapshot.bond[k] = state.bond.empty() ? Vector3::Zero() : state.bond[c];
    snapshot.active[k] = state.active[c];
    snapshot.lifts[k] = solvers::lift_of(patch, c);
    snapshot.reach = std::max(snapshot.reach, (patch.rest[c] - contact.point).norm());
  }
  snapshot.condensed = condensed_contact(patch, chosen, last);
}

} // namespace spherecut::app
