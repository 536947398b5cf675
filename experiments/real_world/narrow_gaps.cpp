#include "experiments/real_world/situations.hpp"

#include "experiments/support/slit_block.hpp"
#include "solvers/body/elastic_body.hpp"
#include "topology/incision/gap_walls.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::real_world {

namespace {

constexpr SlitBlock shape;
constexpr double leg = shape.leg, depth = shape.depth, base = shape.base, height = shape.height;

struct Pulled {
  double force;   // N, that moves the top of the left leg by 1 mm away from the slit
  double dragged; // m, of the top of the right one along
};

/// `slit` 0: the same slit as a cut. `blind`: without what parts the sides of the gap.
Pulled pull(double slit, double spacing, solvers::Method method, int seed, bool blind = false) {
  SlitBlock block = shape;
  block.slit = slit;
  solvers::Problem problem;
  problem.domain = topology::make_organ_domain(block.surface());
  solvers::SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = spacing;
  options.random_seed = static_cast<std::uint64_t>(seed);
  options.ring_ahead = solvers::wants_ring_ahead(method);
  if (slit == 0) {
    topology::SurfaceMesh sheet;
    sheet.vertices = {{leg, -0.01, base}, {leg, depth + 0.01, base}, {leg, depth + 0.01, 0.06}, {leg, -0.01, 0.06}};
    sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
    problem.incision = options.incision =
        std::make_shared<const topology::Incision>(std::vector{sheet}, problem.domain);
  } else if (!blind) {
    problem.opaque = options.walls = topology::gap_walls(problem.domain, [spacing](const Vector3&) { return spacing; });
  }
  problem.nodes = solvers::sprinkle(*problem.domain, options).nodes;
  problem.material = {10e3, 0.3};
  const auto value_at = [](const Vector3& x) -> Vector3 {
    return x.z() < 1e-3 ? Vector3(0, 0, 0) : Vector3(-1e-3, 0, 0);
  };
  problem.prescribed_field = value_at;
  problem.prescribed_region = [](const Vector3& x, const Vector3& normal) {
    return x.z() < 1e-6 || (x.z() > height - 1e-6 && x.x() < leg && normal.z() > 0.5);
  };
  const auto is_on_top = [](const Vector3& x) { return x.z() > height - 1e-6; };
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (const Vector3& x = problem.nodes.positions[i]; x.z() < 1e-6 || (is_on_top(x) && x.x() < leg + 1e-9))
      problem.prescribed.push_back({i, {true, true, true}, value_at(x)});
  solvers::DiscretisationOptions how;
  how.method = method;
  how.estimate_condition = false;
  const auto body = solvers::discretise(problem, how);
  const solvers::Field field = body->solve();
  const std::vector<Vector3> forces = body->constraint_forces(field);
  const VectorX moved = body->nodal_displacements(field);
  Pulled pulled{0, 0};
  for (std::size_t k = 0; k < forces.size(); ++k)
    if (is_on_top(problem.nodes.positions[problem.prescribed[k].node]))
      pulled.force -= forces[k].x();
  int count = 0;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (const Vector3& x = problem.nodes.positions[i]; is_on_top(x) && x.x() > leg + slit + 1e-3) {
      pulled.dragged += moved[3 * i];
      ++count;
    }
  pulled.dragged = std::abs(pulled.dragged) / std::max(count, 1);
  return pulled;
}

/// Means over node sets, so that the scatter of one set (galerkin 1 %, collocation 4 %) does not decide.
Pulled mean_pull(const ExperimentContext& context, double slit, double spacing, solvers::Method method) {
  const int sets = context.quick ? 1 : 3;
  Pulled mean{0, 0};
  for (int seed = 1; seed <= sets; ++seed) {
    const Pulled pulled = pull(slit, spacing, method, seed);
    mean.force += pulled.force / sets;
    mean.dragged += pulled.dragged / sets;
  }
  return mean;
}

} // namespace

std::vector<Check> narrow_gaps(const ExperimentContext& context) {
  std::vector<Check> checks;
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    const bool is_galerkin = method == solvers::Method::galerkin;
    // With 8 mm there are two and a half through a leg.
    const std::vector<double> spacings =
        !context.quick && is_galerkin ? std::vector{0.008, 0.006, 0.005, 0.004} : std::vector{0.006};
    double worst = 0, dragged = 0;
    for (const double spacing : spacings) {
      const Pulled cut = mean_pull(context, 0, spacing, method);
      context.say(fmt::format("{}, {} mm: cut {:.5g} N, dragged {:.3g} mm", solvers::to_string(method), 1e3 * spacing,
                              cut.force, 1e3 * cut.dragged));
      for (const double slit : {1e-4, 5e-4, 1e-3, 2e-3, 4e-3, 6e-3}) {
        const Pulled pulled = mean_pull(context, slit, spacing, method);
        const double ratio = pulled.force / cut.force;
        context.say(fmt::format("  slit {} mm: {:.5g} N, {:.2f} % off, dragged {:.3g} mm", 1e3 * slit, pulled.force,
                                100 * (ratio - 1), 1e3 * pulled.dragged));
        if (slit < 3e-3 || is_galerkin) { // wider ones: see the page
          worst = std::max(worst, std::abs(ratio - 1));
        }
        if (slit < 3e-3)
          dragged = std::max(dragged, pulled.dragged);
      }
    }
    checks.push_back(
        {fmt::format("slit_force_{}", solvers::to_string(method)), worst, "<=", context.quick ? 0.05 : 0.03});
    checks.push_back({fmt::format("slit_dragged_{}_mm", solvers::to_string(method)), 1e3 * dragged, "<=", 0.1});
  }
  const Pulled blind = pull(1e-3, 0.006, solvers::Method::galerkin, 1, true),
               seeing = pull(1e-3, 0.006, solvers::Method::galerkin, 1);
  context.say(
      fmt::format("slit of 1 mm that spheres see through: {:.5g} N in place of {:.5g} N", blind.force, seeing.force));
  const auto liver = topology::make_organ_domain(topology::make_liver(20000));
  const bool liver_is_whole = topology::gap_walls(liver, [](const Vector3&) { return 0.008; }) == nullptr;
  checks.push_back({"liver_without_gaps", liver_is_whole ? 1.0 : 0.0, ">=", 1});
  return checks;
}

} // namespace spherecut::experiments::real_world
