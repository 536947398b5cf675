#include "src/haptics/contact_snapshot.hpp"

#include <algorithm>
#include <numeric>

namespace spherecut::app {

ContactSnapshot::ContactSnapshot()
    : rest(most_candidates), normals(most_candidates), base(most_candidates), displacement(most_candidates),
      forces(most_candidates), along(most_candidates), bond(most_candidates), active(most_candidates),
      compliance(static_cast<std::size_t>(3 * most_candidates) * (3 * most_candidates)) {}

void clear(ContactSnapshot& snapshot) {
  snapshot.count = 0;
  snapshot.force.setZero();
  snapshot.blade = {};
  snapshot.asymmetry = 0;
  snapshot.reach = 0;
  snapshot.rest_sum = 0;
  snapshot.compliance_sum = 0;
}

void fill(const solvers::ContactPatch& patch, const solvers::ContactState& state,
          const topology::SurfaceContact& contact, solvers::ContactCondition condition, ContactSnapshot& snapshot) {
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
  snapshot.reach = 0;
  const auto size = 3 * static_cast<std::size_t>(snapshot.count);
  double skew = 0;
  snapshot.rest_sum = 0;
  snapshot.compliance_sum = 0;
  double sum = 0;
  for (int k = 0; k < snapshot.count; ++k) {
    const int c = chosen[static_cast<std::size_t>(k)];
    snapshot.rest[k] = patch.rest[c];
    snapshot.rest_sum += patch.rest[c].dot(Vector3(1, 1.7, 2.9)) * (1 + k);
    snapshot.normals[k] = patch.normals[c];
    snapshot.base[k] = patch.base_displacement.segment<3>(3 * c);
    snapshot.displacement[k] = state.displacement.segment<3>(3 * c);
    snapshot.forces[k] = state.nodal_forces[c];
    snapshot.along[k] = state.along.empty() ? Vector3::Zero() : state.along[c];
    snapshot.bond[k] = state.bond.empty() ? Vector3::Zero() : state.bond[c];
    snapshot.active[k] = state.active[c];
    snapshot.reach = std::max(snapshot.reach, (patch.rest[c] - contact.point).norm());
    for (int l = 0; l < snapshot.count; ++l) {
      const int d = chosen[static_cast<std::size_t>(l)];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const double here = patch.compliance(3 * c + i, 3 * d + j);
          const double there = patch.compliance(3 * d + j, 3 * c + i);
          snapshot.compliance_sum += here * (1 + i + 3 * j + 9 * (k % 7));
          skew += (here - there) * (here - there);
          sum += (here + there) * (here + there);
          snapshot.compliance[static_cast<std::size_t>(3 * l + j) * size + static_cast<std::size_t>(3 * k + i)] =
              0.5 * (here + there);
        }
    }
  }
  snapshot.asymmetry = sum > 0 ? std::sqrt(skew / sum) : 0;
}

} // namespace spherecut::app
