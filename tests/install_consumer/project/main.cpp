// A user's program: presses a ball into a block that stands on its base, through the installed headers alone.
#include <solvers/contact_solver.hpp>
#include <src/version.hpp>
#include <topology/domain.hpp>

#include <cmath>
#include <cstdio>

using namespace spherecut;

int main() {
  solvers::Problem problem;
  problem.domain = topology::make_box_domain({-0.02, -0.02, 0}, {0.02, 0.02, 0.02}, 0.004);
  solvers::SprinkleOptions sprinkling;
  sprinkling.spacing.fine = sprinkling.spacing.coarse = 0.006;
  sprinkling.seeds = {{Vector3(0, 0, 0.02), solvers::NodeKind::surface}};
  problem.nodes = solvers::sprinkle(*problem.domain, sprinkling).nodes;
  problem.material = {1e4, 0.3, 1000};
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.positions[i].z() < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  const auto body = solvers::discretise(problem, {});
  const auto patch = solvers::condense(*body, {0});
  const topology::SphereTip ball{0.005};
  const auto state = solvers::press(patch, ball, topology::pose_at(ball, {0, 0, 0.019}));
  std::printf("spherecut %s: %d nodes, %.4f N\n", std::string(app::version()).c_str(), problem.nodes.size(),
              state.tool_force.z());
  return state.tool_force.z() > 1e-3 && std::isfinite(state.tool_force.z()) ? 0 : 1;
}
