// Collocation with the pressure as an unknown: its account of work, its conditioning and its residual.
#include "solvers/body/discretisation.hpp"
#include "tests/support/bodies.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using solvers::discretise;
using solvers::Field;
using solvers::Method;
using solvers::Problem;
using tests::held_box;
using tests::options_for;

namespace {

/// A cube whose whole surface moves as u = strain x, the strain that its material has without stress.
Problem swollen_cube(double nu, const Matrix3& strain) {
  Problem problem = held_box({0, 0, 0}, {1, 1, 1}, 0.25, 0.1, {1000, nu, 0});
  problem.prescribed.clear();
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.kinds[i] != solvers::NodeKind::interior)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  problem.prescribed_region = {};
  problem.prescribed_field = [strain](const Vector3& x) -> Vector3 { return strain * x; };
  problem.loads.initial_strain = strain;
  return problem;
}

double condition(double young_modulus, double length) {
  const auto body = discretise(held_box({0, 0, 0}, {length, length, length}, length / 4, 0.1, {young_modulus, 0.45, 0}),
                               options_for(Method::collocation));
  return body->report().condition_estimate;
}

} // namespace

TEST_CASE("An initial strain does the whole work of its stress, with and without a pressure unknown",
          "[collocation][mixed]") {
  Matrix3 strain;
  strain << -0.05, 0.004, 0, 0.004, -0.03, 0.002, 0, 0.002, -0.06;
  for (const Method method : {Method::collocation, Method::galerkin})
    for (const double nu : {0.3, 0.41, 0.45, 0.49}) {
      INFO(solvers::to_string(method) << " nu " << nu);
      const Problem problem = swollen_cube(nu, strain);
      const auto body = discretise(problem, options_for(method));
      const double lambda = problem.material.lame_lambda(), mu = problem.material.shear_modulus();
      const double exact = lambda * strain.trace() * strain.trace() + 2 * mu * strain.squaredNorm();
      Field field = body->solve();
      CHECK(body->load_work(field) == Approx(exact).epsilon(1e-5));
      field.add(1, field); // twice the loads on twice the displacements
      CHECK(body->load_work(field) == Approx(4 * exact).epsilon(1e-5));
    }
}

TEST_CASE("The condition of the mixed form depends neither on the unit of stress nor on that of length",
          "[collocation][mixed]") {
  const double wanted = condition(1, 1);
  CHECK(wanted < 1e6);
  for (const double young_modulus : {1e-3, 1e4, 1e10, 1e12})
    CHECK(condition(young_modulus, 1) == Approx(wanted).epsilon(1e-3));
  for (const double length : {1e-3, 1e2})
    CHECK(condition(5000, length) == Approx(wanted).epsilon(1e-3));
}

TEST_CASE("The residual of the mixed form tells a pressure that does not belong to its field", "[collocation][mixed]") {
  Matrix3 strain;
  strain << -0.05, 0.004, 0, 0.004, -0.03, 0.002, 0, 0.002, -0.06;
  Problem problem = swollen_cube(0.45, strain);
  problem.prescribed_field = [](const Vector3& x) -> Vector3 { return {0.1 * x.y(), 0, 0.02 * x.z()}; };
  const auto body = discretise(problem, options_for(Method::collocation));
  Field field = body->solve();
  CHECK(body->residual(field) < 1e-11);
  field.pressure.array() += 10; // forces inside the body do not change
  CHECK(body->residual(field) > 1e-3);
}
