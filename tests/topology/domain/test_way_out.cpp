#include "topology/domain/way_out.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::topology;

TEST_CASE("The way out of a cylinder is that of the line, from inside and from the surface") {
  const auto cylinder = make_cylinder_domain(0.03, 0.02, 0.002); // its mesh stands within 0.01 mm of it
  const auto way = [&](const Vector3& from, const Vector3& direction) {
    return way_out(*cylinder, from, direction.normalized(), 1.0);
  };
  const Vector3 middle = cylinder->bounds().centre();
  CHECK(way(middle, Vector3::UnitZ()) == Approx(0.01).margin(2e-6));
  CHECK(way(middle, {1, 0, 0}) == Approx(0.03).margin(2e-5));
  CHECK(way(middle, {1, 0, 0.2}) == Approx(0.03 * std::sqrt(1.04)).margin(2e-5));
  CHECK(way(middle - 0.01 * Vector3::UnitZ(), Vector3::UnitZ()) == Approx(0.02).margin(2e-6));
  CHECK(way_out(*cylinder, middle, Vector3::UnitX(), 0.025) == 0.025);
}
