// A penny-shaped cut, tilted, in a block, with a pressure on its faces: how far it opens, and the stress intensity
// along its front against Sneddon's penny in an unbounded body, 2 p sqrt(a / pi). Then the way of a blade.
#include <spherecut/solvers/contact/lip_contact.hpp>
#include <spherecut/solvers/fracture/stress_intensity.hpp>
#include <spherecut/topology/blade/blade.hpp>
#include <spherecut/topology/incision/cut_sheets.hpp>
#include <spherecut/topology/organ/organs.hpp>
#include <spherecut/topology/wound/wound.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

using namespace spherecut;

int main() try {
  const double radius = 0.01, pressure = 100, fine = 0.0035; // m, Pa, m
  solvers::Problem problem;
  problem.domain = topology::make_box_domain({-0.04, -0.04, 0}, {0.04, 0.04, 0.08}, 0.01);
  problem.material = {1e4, 0.3, 1000};
  const auto sheet =
      topology::make_disc_sheet({0.001, -0.002, 0.0405}, Vector3(0.2, 0.1, 1).normalized(), radius, 0.002);
  problem.incision =
      std::make_shared<const topology::Incision>(std::vector<topology::SurfaceMesh>{sheet}, problem.domain);
  solvers::SprinkleOptions sprinkling;
  sprinkling.incision = problem.incision;
  sprinkling.spacing.fine = fine;
  sprinkling.spacing.coarse = 0.01;
  sprinkling.spacing.segments = solvers::front_segments(*problem.incision, fine); // fine along the front
  problem.nodes = solvers::sprinkle(*problem.domain, sprinkling).nodes;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != solvers::NodeKind::lip && problem.nodes.positions[i].z() < 1e-9)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.z() < 1e-9; };
  problem.loads.lip_traction = [=](const Vector3&, const Vector3& normal) -> Vector3 { return -pressure * normal; };
  const auto body = solvers::discretise(problem, {});
  const auto field = body->solve();
  double opening = 0;
  for (const auto& pair : solvers::lip_pairs(problem.nodes))
    opening = std::max(
        opening, (body->contact_displacement(pair.plus, field) - body->contact_displacement(pair.minus, field)).norm());
  double intensity = 0;
  const auto places = solvers::front_samples(*problem.incision, 0.006);
  for (const auto& place : places)
    intensity += solvers::interaction_integral(*body, field, place)[0] / static_cast<double>(places.size());
  const double exact = 2 * pressure * std::sqrt(radius / std::acos(-1));
  std::printf("%d nodes; opens by %.3f mm; K_I = %.2f Pa m^0.5, unbounded %.2f\n", problem.nodes.size(), 1e3 * opening,
              intensity, exact);

  const auto block = topology::make_block(Vector3(-0.04, -0.04, 0), Vector3(0.04, 0.04, 0.03), 0.008);
  topology::SweepOptions sweeping;
  sweeping.edge = 0.004; // m, of the triangles of the sheet
  topology::BladeSweep sweep(topology::Blade{{{0, -0.02, 0}, {0, 0.02, 0}}}, topology::make_organ_domain(block),
                             sweeping);
  topology::IncrementalWound wound(block);
  for (int k = 0; k <= 5; ++k) {
    sweep.move_to({0.1 * k, {0.0013, 0.0017, 0.035 - 0.003 * k}});
    wound.grow(sweep.sheets());
  }
  const double area = sweep.incision()->area();
  std::printf("a blade of 4 cm has cut %.3f cm2; the wound is a closed surface of %zu triangles\n", 1e4 * area,
              wound.wound().surface.triangles.size());
  return std::abs(intensity / exact - 1) < 0.03 && std::abs(area - 0.04 * 0.01) < 1e-9 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
