// Presses a ball into a block that stands on its base, with the solvers alone: nodes, system, contact, field.
#include <spherecut/solvers/contact/solver.hpp>
#include <spherecut/src/base/version.hpp>
#include <spherecut/topology/domain/domain.hpp>

#include <cstdio>
#include <string>

using namespace spherecut;

int main() try {
  solvers::Problem problem;
  problem.domain = topology::make_box_domain({-0.02, -0.02, 0}, {0.02, 0.02, 0.02}, 0.004);
  solvers::SprinkleOptions sprinkling;
  sprinkling.spacing.fine = sprinkling.spacing.coarse = 0.004;
  sprinkling.seeds = {{Vector3(0, 0, 0.02), solvers::NodeKind::surface}};
  problem.nodes = solvers::sprinkle(*problem.domain, sprinkling).nodes;
  problem.material = {1e4, 0.3, 1000}; // Pa, Poisson's ratio, kg/m3
  std::vector<int> candidates;         // surface nodes that the ball may meet
  for (int i = 0; i < problem.nodes.size(); ++i) {
    const Vector3& x = problem.nodes.positions[i];
    if (x.z() < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    else if (problem.nodes.kinds[i] == solvers::NodeKind::surface && x.z() > 0.02 - 1e-9 && x.head<2>().norm() < 0.012)
      candidates.push_back(i);
  }
  const auto body = solvers::discretise(problem, {});
  const auto patch = solvers::condense(*body, candidates);
  const topology::SphereTip ball{0.008};
  solvers::ContactState state;
  for (int step = 1; step <= 4; ++step) // each press goes on from the last
    state = solvers::press(patch, ball, topology::pose_at(ball, {0, 0, 0.02 - 0.0005 * step}), {},
                           step > 1 ? &state : nullptr);
  const auto field = solvers::deform(patch, state);
  const double beneath = body->at({0, 0, 0.0199}, field).displacement.z();
  const double residual = body->residual(field, patch.nodes, state.nodal_forces);
  std::printf("spherecut %s: %d nodes, %d of them in contact, %.4f N, %.2f mm beneath the ball, residual %.1e\n",
              std::string(app::version()).c_str(), problem.nodes.size(), state.active_nodes, state.tool_force.z(),
              1e3 * beneath, residual);
  return state.converged && state.tool_force.z() > 0.05 && beneath < -0.0015 && residual < 1e-8 ? 0 : 1;
} catch (const std::exception& error) { // spherecut::InputError or spherecut::NumericalError
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
