// Bodies with narrow gaps of their own surface: nothing reaches across.
#include "solvers/body/elastic_body.hpp"
#include "topology/incision/gap_walls.hpp"

#include "experiments/support/slit_block.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using spherecut::experiments::SlitBlock;

namespace {

struct Slit {
  SlitBlock block;
  std::shared_ptr<const topology::Incision> cut; // null: the slit is one of the surface
  Problem problem;

  Slit(double slit, double h, Method method, bool as_cut) {
    block.slit = as_cut ? 0 : slit;
    SprinkleOptions options;
    options.spacing.fine = options.spacing.coarse = h;
    options.ring_ahead = wants_ring_ahead(method);
    const double middle = block.leg;
    if (as_cut) {
      problem.domain = topology::make_organ_domain(SlitBlock::extruded(
          {{0, 0, 0}, {2 * block.leg, 0, 0}, {2 * block.leg, 0, block.height}, {0, 0, block.height}},
          {{0, 1, 2}, {0, 2, 3}}, block.depth));
      topology::SurfaceMesh sheet;
      for (const auto& [y, z] : {std::pair(-0.01, block.base), std::pair(block.depth + 0.01, block.base),
                                 std::pair(block.depth + 0.01, 0.06), std::pair(-0.01, 0.06)})
        sheet.vertices.emplace_back(middle, y, z);
      sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
      problem.incision = options.incision =
          std::make_shared<const topology::Incision>(std::vector{sheet}, problem.domain);
    } else {
      problem.domain = topology::make_organ_domain(block.surface());
      problem.opaque = options.walls = topology::gap_walls(problem.domain, [h](const Vector3&) { return h; });
    }
    problem.nodes = sprinkle(*problem.domain, options).nodes;
    problem.material = {10e3, 0.3};
  }

  /// Force that moves the top of the left leg by 1 mm away from the slit, N.
  double force(Method method) {
    const auto is_held = [top = block.height - 1e-6, leg = block.leg](const Vector3& x, const Vector3& normal) {
      return x.z() < 1e-6 || (x.z() > top && x.x() < leg && normal.z() > 0.5);
    };
    problem.prescribed_region = is_held;
    problem.prescribed_field = [](const Vector3& x) -> Vector3 {
      return x.z() < 1e-3 ? Vector3(0, 0, 0) : Vector3(-0.001, 0, 0);
    };
    for (int i = 0; i < problem.nodes.size(); ++i) {
      const Vector3& x = problem.nodes.positions[i];
      if (x.z() < 1e-6 || (x.z() > block.height - 1e-6 && x.x() < block.leg + 1e-9))
        problem.prescribed.push_back({i, {true, true, true}, problem.prescribed_field(x)});
    }
    DiscretisationOptions options;
    options.method = method;
    options.estimate_condition = false;
    const auto body = discretise(problem, options);
    const std::vector<Vector3> forces = body->constraint_forces(body->solve());
    double sum = 0;
    for (std::size_t k = 0; k < forces.size(); ++k)
      if (problem.nodes.positions[problem.prescribed[k].node].z() > 0.01)
        sum -= forces[k].x();
    return sum;
  }
};

} // namespace

TEST_CASE("Legs on both sides of a slit share no node, and each side of it has its own on the surface", "[gap_walls]") {
  for (const double slit : {1e-4, 1e-3, 6e-3}) {
    const Slit body(slit, 0.006, Method::galerkin, false);
    REQUIRE(body.problem.opaque);
    const SlitBlock& block = body.block;
    const NodeCloud& nodes = body.problem.nodes;
    const Spheres spheres(nodes.positions, nodes.spacings, 2.0, Basis::linear, worst_moment_condition,
                          sight_about_cut(body.problem, Method::galerkin, SightRule::enriched));
    const double right = block.leg + slit, clear = block.base + 3 * 0.006;
    std::array<int, 2> on_side{};
    ShapeFunctions shape;
    int looked_at = 0;
    for (int i = 0; i < nodes.size(); ++i) {
      const Vector3& x = nodes.positions[i];
      on_side[0] += std::abs(x.x() - block.leg) < 1e-9 && x.z() > block.base ? 1 : 0;
      on_side[1] += std::abs(x.x() - right) < 1e-9 && x.z() > block.base ? 1 : 0;
      if (x.z() < clear || x.x() > block.leg + 1e-9)
        continue;
      REQUIRE(evaluate(spheres, x, shape));
      ++looked_at;
      for (const int other : shape.nodes)
        CHECK(nodes.positions[other].x() < block.leg + 1e-9);
    }
    CHECK(looked_at > 30);
    CHECK(on_side[0] > 20); // 0.03 x 0.042 m at one a spacing squared: 35
    CHECK(on_side[1] > 20);
  }
}

TEST_CASE("A slit of the surface takes the force of the same slit as a cut", "[gap_walls]") {
  const Method method = GENERATE(Method::galerkin, Method::collocation);
  constexpr double h = 0.006;
  // Node sets scatter by 1 and by 3 %.
  const double within = method == Method::galerkin ? 0.03 : 0.05;
  const double cut = Slit(0, h, method, true).force(method);
  for (const double slit : {1e-4, 1e-3}) {
    INFO(to_string(method) << ", slit " << slit);
    CHECK(Slit(slit, h, method, false).force(method) == Approx(cut).epsilon(within));
  }
}

TEST_CASE("Bodies with a slit and with a re-entrant corner pass the patch test that leaves their sides free",
          "[gap_walls]") {
  const Method method = GENERATE(Method::galerkin, Method::collocation);
  const bool has_slit = GENERATE(true, false);
  constexpr double h = 0.006, strain = 0.01, ratio = 0.3;
  Problem problem;
  SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = h;
  options.ring_ahead = wants_ring_ahead(method);
  const topology::SurfaceMesh corner =
      SlitBlock::extruded({{0, 0, 0}, {0.05, 0, 0}, {0.05, 0, 0.02}, {0.02, 0, 0.02}, {0.02, 0, 0.05}, {0, 0, 0.05}},
                          {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}, 0.03);
  problem.domain = topology::make_organ_domain(has_slit ? SlitBlock().surface() : corner);
  problem.opaque = options.walls = topology::gap_walls(problem.domain, [](const Vector3&) { return h; });
  CHECK((problem.opaque != nullptr) == has_slit);
  problem.nodes = sprinkle(*problem.domain, options).nodes;
  problem.material = {10e3, ratio};
  // Tension along z; the foot of the L, whose top is held too, is stretched as the rest is.
  problem.prescribed_field = [=](const Vector3& x) -> Vector3 {
    return strain * Vector3(-ratio * x.x(), -ratio * x.y(), x.z());
  };
  const auto is_end = [=](const Vector3& x) {
    return x.z() < 1e-6 || x.z() > 0.05 - 1e-6 || (!has_slit && std::abs(x.z() - 0.02) < 1e-6 && x.x() > 0.02 - 1e-6);
  };
  problem.prescribed_region = [=](const Vector3& x, const Vector3& normal) {
    return is_end(x) && std::abs(normal.z()) > 0.5;
  };
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (const Vector3& x = problem.nodes.positions[i]; is_end(x) && problem.nodes.kinds[i] != NodeKind::interior)
      problem.prescribed.push_back({i, {true, true, true}, problem.prescribed_field(x)});
  DiscretisationOptions how;
  how.method = method;
  how.estimate_condition = false;
  const auto body = discretise(problem, how);
  const VectorX moved = body->nodal_displacements(body->solve());
  double worst = 0;
  for (int i = 0; i < problem.nodes.size(); ++i)
    worst = std::max(worst, (moved.segment<3>(3 * i) - problem.prescribed_field(problem.nodes.positions[i])).norm());
  INFO(to_string(method) << (has_slit ? ", slit: " : ", corner: ") << worst / (strain * 0.05));
  // Of the largest displacement. The same slit as a cut is wrong by 0.020 (galerkin) and 0.011.
  const double within = !has_slit ? 0.02 : method == Method::galerkin ? 0.025 : 0.035;
  CHECK(worst < within * strain * 0.05);
}
