// A block of soft tissue and its condensed top, for tests of contact.
#pragma once

#include "solvers/contact/solver.hpp"
#include "tests/support/bodies.hpp"

namespace spherecut::tests {

struct PressedBlock {
  std::unique_ptr<solvers::Discretisation> body;
  solvers::ContactPatch patch;
};

/// 6 x 6 x 3 cm of E = 5 kPa, nu = 0.45 on its base, made once for each method.
inline const PressedBlock& pressed_block(solvers::Method method) {
  static const auto make = [](solvers::Method which) {
    PressedBlock result;
    const solvers::Problem problem =
        held_box({-0.03, -0.03, -0.03}, {0.03, 0.03, 0}, 0.0075, 0.2, {5e3, 0.45, 1000}, 3);
    result.body = solvers::discretise(problem, options_for(which));
    result.patch = solvers::condense(*result.body, top_nodes(problem));
    return result;
  };
  static const PressedBlock collocation = make(solvers::Method::collocation);
  static const PressedBlock galerkin = make(solvers::Method::galerkin);
  return method == solvers::Method::collocation ? collocation : galerkin;
}

/// Where a candidate of the patch is in the state, m.
inline Vector3 place(const solvers::ContactPatch& patch, const solvers::ContactState& state, std::size_t c) {
  return patch.rest[c] + state.displacement.segment<3>(3 * static_cast<Eigen::Index>(c));
}

} // namespace spherecut::tests
