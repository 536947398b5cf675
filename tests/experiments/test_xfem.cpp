// Elements of the ledger that are enriched at a cut.
#include "experiments/remeshing_ledger/xfem_cells.hpp"
#include "tests/support/finite_differences.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::experiments;
using namespace spherecut::experiments::ledger;

TEST_CASE("Functions of a crack's front have the gradients given, and the first alone jumps, by twice the root") {
  const Scenario penny = growing_penny(2);
  const FrontDistance front(penny, 1);
  const Vector3& n = penny.frame.normal;
  for (const Vector2& p : {Vector2(0.8, 0.31), Vector2(-0.3, -1.2), Vector2(0.1, 0.75)})
    for (double height : {0.2, -0.15}) {
      const Vector3 x = penny.in_space(p) + height * n;
      const FrontFunctions at_x = front_values(front.at(x), n);
      for (std::size_t k = 0; k < front_functions; ++k)
        for (int d = 0; d < 3; ++d) {
          const Vector3 step = 1e-6 * Vector3::Unit(d);
          const double difference =
              (front_values(front.at(x + step), n).value[k] - front_values(front.at(x - step), n).value[k]) / 2e-6;
          CHECK(at_x.gradient[k][d] == Approx(difference).margin(1e-7));
        }
    }
  const Vector3 behind = penny.in_space({0.6, 0.2});
  const double distance = -front.at(behind).ahead;
  REQUIRE(distance > 0.1);
  const FrontFunctions above = front_values(front.at(behind + 1e-12 * n), n),
                       below = front_values(front.at(behind - 1e-12 * n), n);
  CHECK(above.value[0] - below.value[0] == Approx(2 * std::sqrt(distance)));
  for (std::size_t k = 1; k < front_functions; ++k)
    CHECK(above.value[k] - below.value[k] == Approx(0).margin(1e-9));
}

#ifdef SPHERECUT_HAS_GETFEM
TEST_CASE("Points of a cut tetrahedron lie off the cut and share its volume between both sides") {
  LevelSetCells cells;
  cells.corners = {{0.1, 0, 0}, {1, 0.1, 0}, {0, 1.1, 0.1}, {0.1, 0.2, 0.9}};
  cells.cells = {{0, 1, 2, 3}};
  cells.primary = {-0.3, -0.2, -0.25, 0.35};
  for (const bool singular : {false, true}) {
    cells.secondary = singular ? std::vector{-0.2, 0.3, 0.1, 0.05} : std::vector{-1.0, -1.0, -1.0, -1.0};
    const CellRule rule = level_set_rules(cells, 5, singular).front();
    const auto& c = cells.corners;
    const double volume = (c[1] - c[0]).cross(c[2] - c[0]).dot(c[3] - c[0]) / 6;
    // Above is a tetrahedron about the last corner, cut off at these shares of its edges.
    double share = 1;
    for (int k = 0; k < 3; ++k)
      share *= cells.primary[3] / (cells.primary[3] - cells.primary[static_cast<std::size_t>(k)]);
    double whole = 0, above = 0;
    for (std::size_t q = 0; q < rule.weight.size(); ++q) {
      double height = 0;
      for (std::size_t k = 0; k < 4; ++k)
        height += rule.place[q][k] * cells.primary[k];
      CHECK(std::abs(height) > 1e-9);
      whole += rule.weight[q];
      above += height > 0 ? rule.weight[q] : 0;
    }
    CHECK(whole == Approx(volume).epsilon(1e-6));
    CHECK(above == Approx(share * volume).epsilon(1e-6));
  }
}
#endif
