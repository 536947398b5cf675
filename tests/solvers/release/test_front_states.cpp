// What drives a front at finite strain, and the state that a body with a longer cut begins from.
#include "solvers/elasticity/rotation.hpp"
#include "solvers/finite/transfer.hpp"
#include "solvers/release/front_states.hpp"
#include "tests/solvers/release/cut_strip.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using tests::LoadedStrip;
using tests::pulled_strip;

namespace {

double tough(const Vector3&) {
  return 2;
}

VectorX turned(const LoadedStrip& strip, const Matrix3& rotation) {
  VectorX result = strip.coefficients;
  for (int i = 0; i < strip.body->size(); ++i) {
    const Vector3& x = strip.body->problem().nodes.positions[i];
    result.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        rotation * (x + strip.coefficients.segment<3>(3 * static_cast<Eigen::Index>(i))) - x;
  }
  return result;
}

} // namespace

TEST_CASE("At 0.1 % strain the states of a front are those of small strain") {
  constexpr double nu = 0.3, tip = 0.01, depth = 0.3;
  for (const double slide : {0.0, 0.0005, -0.001}) {
    const LoadedStrip strip = pulled_strip(tests::graded_strip(tip, depth), nu, 1.001, slide);
    const std::vector<FrontState> states = front_states(*strip.body, strip.coefficients, tough, depth);
    Problem problem = strip.body->problem();
    problem.prescribed_field = [slide](const Vector3& x) { return Vector3(slide * x.y(), 0.001 * x.y(), 0); };
    const auto small = discretise(std::move(problem), {});
    const std::vector<FrontState> wanted = front_states(*small, small->solve(), tough, depth);
    REQUIRE(states.size() == wanted.size());
    REQUIRE(states.size() == 1); // in the middle
    for (std::size_t k = 0; k < states.size(); ++k) {
      INFO("slide " << slide << ": " << states[k].intensities.transpose() << ", small strain "
                    << wanted[k].intensities.transpose());
      CHECK((states[k].frame.point - wanted[k].frame.point).norm() < 1e-12);
      CHECK(states[k].release == Approx(wanted[k].release).epsilon(0.04));
      CHECK(states[k].toughness == 2);
      CHECK((states[k].intensities - wanted[k].intensities).norm() < 0.06 * wanted[k].intensities.norm());
      CHECK(states[k].angle == Approx(wanted[k].angle).margin(5 * std::numbers::pi / 180));
    }
  }
}

TEST_CASE("A front that turns with its body is driven as before") {
  const LoadedStrip strip = pulled_strip(tests::cut_strip(0.01), 0.49, 1.3, 0.2);
  const std::vector<FrontState> before = front_states(*strip.body, strip.coefficients, tough, 0.1);
  const Matrix3 rotation(Eigen::AngleAxisd(2 * std::numbers::pi / 3, Vector3(0.3, -0.5, 1).normalized()));
  const std::vector<FrontState> after = front_states(*strip.body, turned(strip, rotation), tough, 0.1);
  REQUIRE(before.size() == 2);
  REQUIRE(after.size() == 2);
  for (std::size_t k = 0; k < before.size(); ++k) {
    INFO(before[k].intensities.transpose() << ", turned " << after[k].intensities.transpose());
    CHECK(before[k].release > 0);
    CHECK(std::abs(before[k].intensities[1]) > 0.1 * before[k].intensities[0]); // both modes are there
    CHECK((after[k].intensities - before[k].intensities).norm() < 1e-3 * before[k].intensities.norm());
  }
}

TEST_CASE("The rotation between two faces is halfway, also where they have turned from one another") {
  const Vector3 axis = Vector3(1, 2, -0.5).normalized();
  const auto turn = [&](double degrees) -> Matrix3 {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis).toRotationMatrix();
  };
  const Matrix3 stretch = Vector3(2, 0.7, 0.9).asDiagonal();
  for (const double apart : {0.0, 40.0, 150.0, 170.0})
    CHECK((rotation_between(turn(10) * stretch, turn(10 + apart) * stretch) - turn(10 + 0.5 * apart)).norm() < 1e-9);
  const Matrix3 mirrored = Vector3(-2, 0.5, 1).asDiagonal();
  CHECK(rotation_of(mirrored).determinant() == Approx(1));
}

TEST_CASE("A body with a longer cut begins from the strain of the one before, and nothing of it is inverted") {
  const LoadedStrip before = pulled_strip(tests::graded_strip(0.01, 0.3), 0.45, 1.4, 0.2);
  const FiniteBody after(experiments::finite_block(tests::graded_strip(0.06, 0.3)), experiments::neo_hookean(1, 0.45));
  VectorX start(3 * static_cast<Eigen::Index>(after.size()));
  for (int i = 0; i < after.size(); ++i)
    start.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        before.body->at(after.problem().nodes.positions[i], before.coefficients).displacement;
  const auto given = [&](const Vector3& x) -> Matrix3 { return before.body->at(x, before.coefficients).deformation; };
  const std::vector<char> all(static_cast<std::size_t>(after.size()), 1);
  const auto error_of = [&](const VectorX& coefficients) {
    double sum = 0, volume = 0;
    const PointTable& table = after.points();
    for (std::size_t p = 0; p < table.positions.size(); ++p) {
      const double weight = table.weights[p / point_lanes].value[p % point_lanes];
      if (weight > 0) {
        const Vector3& x = table.positions[p];
        sum += weight * (after.at(x, coefficients).deformation - given(x)).squaredNorm();
        volume += weight;
      }
    }
    return std::sqrt(sum / volume);
  };
  const VectorX found = nearest_state(after, start, all, given);
  FiniteForces forces;
  after.evaluate(found, forces);
  INFO("displacements alone " << error_of(start) << ", nearest " << error_of(found));
  CHECK(error_of(found) < 0.7 * error_of(start));
  CHECK(forces.least_jacobian > 0.1);
}

TEST_CASE("The nearest state to a homogeneous one is that, whatever its nodes have been") {
  const FiniteBody body(experiments::finite_block(tests::cut_strip(0.01)), experiments::neo_hookean(1, 0.3));
  Matrix3 deformation;
  deformation << 0, -1.2, 0, 0.9, 0.1, 0, 0, 0, 1.1;
  VectorX start(3 * static_cast<Eigen::Index>(body.size())), wanted = start;
  std::vector<char> free(static_cast<std::size_t>(body.size()), 0);
  for (int i = 0; i < body.size(); ++i) {
    const Vector3& x = body.problem().nodes.positions[i];
    wanted.segment<3>(3 * static_cast<Eigen::Index>(i)) = deformation * x - x;
    free[i] = x.norm() < 0.5 ? 1 : 0;
  }
  start = wanted;
  for (int i = 0; i < body.size(); ++i)
    if (free[i] != 0)
      start.segment<3>(3 * static_cast<Eigen::Index>(i)) += Vector3(std::sin(7.0 * i), std::cos(3.0 * i), 0.2);
  const VectorX found = nearest_state(body, start, free, [&](const Vector3&) { return deformation; });
  CHECK((found - wanted).cwiseAbs().maxCoeff() < 1e-5); // gradients are consistent to rounding, shape functions are not
  for (int i = 0; i < body.size(); ++i)
    if (free[i] == 0)
      CHECK(found.segment<3>(3 * static_cast<Eigen::Index>(i)) == start.segment<3>(3 * static_cast<Eigen::Index>(i)));
}
