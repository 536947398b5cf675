// What both finite-sphere discretisations promise: patch test, rigid motions, balance of forces, reciprocity,
// superposition, and clear refusals.
#include "solvers/body/discretisation.hpp"

#include "experiments/support/cube.hpp"
#include "solvers/body/elastic_body.hpp"
#include "tests/support/bodies.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

using namespace spherecut;
using experiments::cube_problem;
using experiments::displacement_error;
using experiments::linear_field;
using experiments::ManufacturedField;
using solvers::discretise;
using solvers::Field;
using solvers::Material;
using solvers::Method;
using solvers::Problem;
using tests::held_box;
using tests::options_for;
using tests::top_nodes;

namespace {

const std::array<Method, 2> both{Method::collocation, Method::galerkin};

Vector3 sum(const std::vector<Vector3>& vectors) {
  Vector3 total = Vector3::Zero();
  for (const Vector3& v : vectors)
    total += v;
  return total;
}

/// A cube in equilibrium, held at its base, with plane waves for the field.
Problem wavy_cube(double nu) {
  return cube_problem(experiments::smooth_field({2, nu, 0}), 4, 0.2, 5);
}

std::unique_ptr<solvers::Discretisation> body_of(const Problem& problem, Method method) {
  return discretise(problem, options_for(method));
}

/// Displacements of `problem` from `factor` times its loads and prescribed values.
Field combined(const Field& a, double factor, const Field& b) {
  Field field = a;
  field.add(factor, b);
  return field;
}

} // namespace

TEST_CASE("Both discretisations pass the patch test at every Poisson ratio") {
  for (double nu : {0.0, 0.3, 0.4, 0.45, 0.49, 0.499})
    for (std::uint64_t seed : {1, 2}) {
      if (nu > 0.49 && seed > 1)
        continue;
      const ManufacturedField field = linear_field({3, nu, 0}, 4);
      const Problem problem = cube_problem(field, 4, 0.25, seed);
      for (Method method : both) {
        if (method == Method::galerkin && nu > 0.49)
          continue;
        const auto body = body_of(problem, method);
        const Field solution = body->solve();
        const bool weak = method == Method::galerkin; // passes to its quadrature, see below
        INFO(solvers::to_string(method) << " nu " << nu);
        CHECK(displacement_error(*body, solution, field) < (weak ? (nu < 0.48 ? 5e-3 : 2e-2) : 1e-10));
        const solvers::PointState state = body->at({0.43, 0.51, 0.62}, solution);
        const double tolerance = weak ? 0.08 : 1e-9;
        CHECK((state.gradient - field.slope).norm() < tolerance * field.slope.norm());
        CHECK((state.strain - 0.5 * (state.gradient + state.gradient.transpose())).norm() < 1e-13);
        CHECK((state.stress - field.stress(Vector3::Zero())).norm() < tolerance * field.stress(Vector3::Zero()).norm());
      }
    }
}

TEST_CASE("The weak form's patch test error is its quadrature's alone") {
  for (double nu : {0.3, 0.49}) {
    const ManufacturedField field = linear_field({3, nu, 0}, 4);
    const Problem problem = cube_problem(field, 4, 0.25, 1);
    std::vector<double> errors;
    for (const auto& [points, size] : {std::pair{2, 0.75}, std::pair{3, 0.75}, std::pair{3, 0.5}}) {
      solvers::DiscretisationOptions options = options_for(Method::galerkin);
      options.quadrature = points;
      options.cell_size = size;
      const auto body = discretise(problem, options);
      errors.push_back(displacement_error(*body, body->solve(), field));
    }
    CHECK(errors[1] < 0.25 * errors[0]);
    CHECK(errors[2] < 0.06 * errors[0]);
    CHECK(errors[2] < 5e-4);
  }
}

TEST_CASE("Symmetry planes held component by component carry uniaxial tension") {
  // u = (e x, -nu e y, -nu e z): three rollers at x, y, z = 0 and a pull on x = 1.
  const Material material{5, 0.3, 0};
  const double strain = 0.01;
  for (Method method : both) {
    Problem problem = cube_problem(linear_field(material), 4, 0.2, 7);
    problem.prescribed_field = nullptr;
    problem.prescribed_region = nullptr;
    problem.prescribed.clear();
    for (int i = 0; i < problem.nodes.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        if (problem.nodes.positions[i][axis] == 0) {
          solvers::Prescribed roller{i, {false, false, false}, Vector3::Zero()};
          roller.components[axis] = true;
          problem.prescribed.push_back(roller);
        }
    problem.loads.body_force = nullptr;
    problem.loads.traction = [&](const Vector3&, const Vector3& normal) {
      return normal.x() > 0.5 ? Vector3(material.young_modulus * strain, 0, 0) : Vector3(0, 0, 0);
    };
    const auto body = body_of(problem, method);
    const Field solution = body->solve();
    const VectorX u = body->nodal_displacements(solution);
    double worst = 0;
    for (int i = 0; i < problem.nodes.size(); ++i) {
      const Vector3& x = problem.nodes.positions[i];
      const Vector3 exact(strain * x.x(), -0.3 * strain * x.y(), -0.3 * strain * x.z());
      worst = std::max(worst, (u.segment<3>(3 * i) - exact).norm() / strain);
    }
    CHECK(worst < (method == Method::collocation ? 1e-10 : 0.02));
    const std::vector<Vector3> forces = body->constraint_forces(solution);
    Vector3 total = Vector3::Zero();
    for (std::size_t k = 0; k < forces.size(); ++k) {
      total += forces[k];
      for (int c = 0; c < 3; ++c)
        if (!problem.prescribed[k].components[c])
          CHECK(forces[k][c] == 0);
    }
    CHECK(total.x() == Approx(-material.young_modulus * strain).epsilon(1e-6));
    CHECK(std::abs(total.y()) < 1e-6 * std::abs(total.x()));
    CHECK(std::abs(total.z()) < 1e-6 * std::abs(total.x()));
  }
}

TEST_CASE("A rigid motion of the held part moves the whole body without force") {
  const Vector3 shift(0.3, -0.2, 0.5), spin(0.1, 0.4, -0.2); // small-strain rotation: u = shift + spin x x
  for (double nu : {0.0, 0.3, 0.49})
    for (Method method : both) {
      const Problem problem = wavy_cube(nu);
      const auto body = body_of(problem, method);
      std::vector<Vector3> values;
      for (const Vector3& point : body->constraint_points())
        values.push_back(shift + spin.cross(point));
      const Field rigid = body->prescribed_response(values);
      const VectorX u = body->nodal_displacements(rigid);
      double worst = 0;
      for (int i = 0; i < problem.nodes.size(); ++i)
        worst = std::max(worst, (u.segment<3>(3 * i) - shift - spin.cross(problem.nodes.positions[i])).norm());
      INFO(solvers::to_string(method) << " nu " << nu);
      CHECK(worst < 1e-9);
      CHECK(body->at({0.4, 0.5, 0.6}, rigid).stress.norm() < 1e-8);
      for (const Vector3& force : body->constraint_forces(rigid))
        CHECK(force.norm() < 1e-8);
    }
}

TEST_CASE("Constraint forces balance the applied loads, and each row is in balance") {
  for (double nu : {0.3, 0.49})
    for (Method method : both) {
      // A block under its own weight: the reaction is rho g V exactly, through the centroid.
      Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.3, 0.6), 0.1, 0.2, {1e4, nu, 1060});
      problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -1060 * 9.81); };
      const auto body = body_of(problem, method);
      const Field solution = body->solve();
      const double weight = 1060 * 9.81 * 0.4 * 0.3 * 0.6;
      const Vector3 reaction = sum(body->constraint_forces(solution));
      const double tolerance = method == Method::collocation ? 1e-10 : 1e-6;
      INFO(solvers::to_string(method) << " nu " << nu);
      CHECK((reaction - Vector3(0, 0, weight)).norm() < tolerance * weight);
      CHECK(body->residual(solution) < tolerance);
      // A pull on one node: its reaction is the opposite force.
      const int node = top_nodes(problem).at(2);
      const std::vector<Field> responses = body->force_responses({node});
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3 force = Vector3::Unit(axis);
        CHECK((sum(body->constraint_forces(responses[axis])) + force).norm() < tolerance);
        CHECK(body->residual(responses[axis], {node}, {force}) < tolerance);
        CHECK(body->residual(responses[axis]) > 1e-3); // the residual does see a force that it is not told of
      }
      // Moments balance too in the weak form; a cell's balance has one moment per row only in the mean.
      Vector3 moment = Vector3::Zero();
      const std::vector<Vector3> points = body->constraint_points(), forces = body->constraint_forces(solution);
      for (std::size_t k = 0; k < forces.size(); ++k)
        moment += (points[k] - Vector3(0.2, 0.15, 0)).cross(forces[k]);
      CHECK(moment.norm() < (method == Method::galerkin ? 2e-3 : 2e-2) * weight * 0.2);
    }
}

TEST_CASE("A column under its own weight shortens as the bar formula says") {
  // nu = 0 makes the problem one-dimensional: u_z = -rho g (L z - z^2 / 2) / E, whatever the base does sideways.
  const Material material{2e4, 0, 1000};
  for (Method method : both) {
    Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.2, 0.2, 0.6), 0.05, 0.2, material);
    problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -9810); };
    const auto body = body_of(problem, method);
    const Field solution = body->solve();
    for (const Vector3& x : {Vector3(0.1, 0.1, 0.3), Vector3(0.07, 0.13, 0.5)}) {
      const solvers::PointState state = body->at(x, solution);
      CHECK(state.displacement.z() == Approx(-9810 / 2e4 * (0.6 * x.z() - 0.5 * x.z() * x.z())).epsilon(0.01));
      CHECK(state.stress(2, 2) == Approx(-9810 * (0.6 - x.z())).epsilon(0.06));
    }
    CHECK(body->at({0.1, 0.1, 0.6}, solution).displacement.z() == Approx(-9810 / 2e4 * 0.18).epsilon(0.01));
  }
}

TEST_CASE("The weak form's compliance is symmetric and positive definite, the cell balance nearly so") {
  for (double nu : {0.3, 0.48}) {
    const Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.5, 0.5, 0.3), 0.1, 0.2, {1, nu, 0});
    const std::vector<int> nodes = top_nodes(problem);
    for (Method method : both) {
      const auto body = body_of(problem, method);
      const std::vector<Field> responses = body->force_responses(nodes);
      const auto size = static_cast<Eigen::Index>(responses.size());
      MatrixX compliance(size, size);
      for (Eigen::Index column = 0; column < size; ++column)
        for (std::size_t c = 0; c < nodes.size(); ++c)
          compliance.block<3, 1>(3 * static_cast<Eigen::Index>(c), column) =
              body->contact_displacement(nodes[c], responses[static_cast<std::size_t>(column)]);
      const double asymmetry = (compliance - compliance.transpose()).norm() / compliance.norm();
      const VectorX values =
          Eigen::SelfAdjointEigenSolver<MatrixX>(0.5 * (compliance + compliance.transpose())).eigenvalues();
      INFO(solvers::to_string(method) << " nu " << nu);
      CHECK(asymmetry < (method == Method::galerkin ? 1e-8 : 0.05));
      CHECK(values.minCoeff() > 0); // passive: no force pattern gives energy back
    }
  }
}

TEST_CASE("Solutions superpose with their loads and prescribed displacements") {
  for (double nu : {0.3, 0.45})
    for (Method method : both) {
      const Problem problem = wavy_cube(nu);
      const auto body = body_of(problem, method);
      const Field whole = body->solve();
      std::vector<Vector3> values, double_values;
      for (std::size_t k = 0; k < problem.prescribed.size(); ++k) {
        values.push_back(whole.prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)));
        double_values.push_back(2 * values.back());
      }
      // The same loads over a base at rest, and the base's displacement alone.
      Problem at_rest = problem;
      at_rest.prescribed_field = [](const Vector3&) { return Vector3::Zero(); };
      const Field loaded = body_of(at_rest, method)->solve();
      const Field moved = body->prescribed_response(values);
      const double size = whole.coefficients.norm();
      INFO(solvers::to_string(method) << " nu " << nu);
      const Field both_parts = combined(loaded, 1, moved);
      CHECK((both_parts.coefficients - whole.coefficients).norm() < 1e-8 * size);
      CHECK((both_parts.prescribed - whole.prescribed).norm() < 1e-12);
      CHECK(both_parts.load_factor == 1);
      if (nu > 0.4 && method == Method::collocation)
        CHECK((both_parts.pressure - whole.pressure).norm() < 1e-8 * whole.pressure.norm());
      const std::vector<Vector3> expected = body->constraint_forces(whole),
                                 forces = body->constraint_forces(both_parts);
      double worst = 0, largest = 0;
      for (std::size_t k = 0; k < forces.size(); ++k) {
        worst = std::max(worst, (forces[k] - expected[k]).norm());
        largest = std::max(largest, expected[k].norm());
      }
      CHECK(worst < 1e-6 * largest);
      CHECK((body->prescribed_response(double_values).coefficients - 2 * moved.coefficients).norm() <
            1e-8 * moved.coefficients.norm());
      const Field none = combined(whole, -1, whole);
      CHECK(none.coefficients.norm() == 0);
      CHECK(none.load_factor == 0);
      CHECK(sum(body->constraint_forces(none)).norm() == 0);
    }
}

TEST_CASE("A smooth field is approximated up to near incompressibility") {
  for (double nu : {0.3, 0.45, 0.49, 0.499}) {
    const ManufacturedField field = experiments::smooth_field({1, nu, 0});
    const Problem problem = cube_problem(field, 6, 0.2, 2);
    for (Method method : both) {
      if (method == Method::galerkin && nu > 0.49)
        continue;
      const auto body = body_of(problem, method);
      const Field solution = body->solve();
      const double error = displacement_error(*body, solution, field);
      INFO(solvers::to_string(method) << " nu " << nu);
      CHECK(error < (method == Method::galerkin && nu < 0.4 ? 0.02 : 0.05));
      CHECK((solution.pressure.size() > 0) == (method == Method::collocation && nu > 0.4));
    }
  }
}

TEST_CASE("Two builds of one problem give the same bits") {
  for (Method method : both) {
    const Problem problem = wavy_cube(0.45);
    const Field first = body_of(problem, method)->solve(), second = body_of(problem, method)->solve();
    CHECK(first.coefficients == second.coefficients);
    CHECK(first.pressure == second.pressure);
  }
}

TEST_CASE("Prescribed displacements hold at the constraint points") {
  for (Method method : both) {
    const Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.4, 0.4), 0.1, 0.2, {1, 0.3, 0});
    const auto body = body_of(problem, method);
    std::vector<Vector3> values(problem.prescribed.size(), Vector3::Zero());
    values.at(12) = Vector3(0.01, -0.02, 0.03);
    const Field field = body->prescribed_response(values);
    const VectorX u = body->nodal_displacements(field);
    if (method == Method::collocation)
      for (std::size_t k = 0; k < values.size(); ++k)
        CHECK((u.segment<3>(3 * problem.prescribed[k].node) - values[k]).norm() < 1e-12);
    CHECK(sum(body->constraint_forces(field)).norm() < 1e-7); // no load: the reactions balance among themselves
    CHECK(body->constraint_forces(field).at(12).dot(values[12]) > 0);
    CHECK(body->constraint_points().size() == values.size());
    values.pop_back();
    CHECK_THROWS_AS(body->prescribed_response(values), InputError);
  }
}

TEST_CASE("Problems that cannot be solved are refused with the reason") {
  const Problem good = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.4, 0.4), 0.1, 0.2, {1, 0.3, 0});
  for (Method method : both) {
    const auto refuses = [&](Problem problem, const char* reason) {
      INFO(solvers::to_string(method) << ": " << reason);
      CHECK_THROWS_AS(body_of(problem, method), InputError);
      CHECK_THROWS_WITH(body_of(problem, method), Catch::Contains(reason));
    };
    Problem problem = good;
    problem.prescribed.clear();
    refuses(problem, "nothing is fixed");
    problem = good;
    for (solvers::Prescribed& entry : problem.prescribed)
      entry.components = {false, false, false};
    refuses(problem, "nothing is fixed");
    problem = good;
    problem.material.poisson_ratio = 0.5;
    refuses(problem, "Poisson's ratio is 0.5");
    problem = good;
    problem.material.young_modulus = 0;
    refuses(problem, "Young's modulus is 0");
    problem = good;
    problem.material.young_modulus = -1;
    refuses(problem, "Young's modulus is -1");
    problem = good;
    problem.nodes = {};
    for (int k = 0; k < 3; ++k)
      problem.nodes.add(good.nodes.positions[k], 0.1, solvers::NodeKind::surface);
    refuses(problem, "3 nodes");
    problem = good;
    problem.prescribed.front().node = good.nodes.size();
    refuses(problem, "does not exist");
    problem = good;
    problem.prescribed.front().value.x() = std::nan("");
    refuses(problem, "not finite");
    problem = good;
    problem.nodes.positions[5].y() = std::nan("");
    refuses(problem, "node 5");
    problem = good;
    problem.nodes.spacings[6] = 0;
    refuses(problem, "node 6");
    problem = good;
    problem.nodes.kinds.pop_back();
    refuses(problem, "kinds");
    problem = good;
    problem.domain = nullptr;
    refuses(problem, "no domain");
    problem = good;
    problem.prescribed.push_back(problem.prescribed.front());
    refuses(problem, "prescribed twice");
  }
}

TEST_CASE("A body held at one point only, or along one axis only, is refused as singular") {
  const Problem good = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.4, 0.4), 0.1, 0.2, {1, 0.3, 0});
  for (Method method : both) {
    INFO(solvers::to_string(method));
    Problem problem = good;
    problem.prescribed_region = nullptr;
    for (solvers::Prescribed& entry : problem.prescribed)
      entry.components = {false, false, true};
    CHECK_THROWS_AS(body_of(problem, method), NumericalError);
    CHECK_THROWS_WITH(body_of(problem, method), Catch::Contains("not held"));
    problem.prescribed = {{0, {true, true, true}, Vector3::Zero()}};
    CHECK_THROWS_AS(body_of(problem, method), NumericalError);
  }
}

TEST_CASE("Nodes that leave a hole are refused by name") {
  Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.5, 0.5, 0.3), 0.1, 0.1, {1, 0.3, 0});
  problem.domain = topology::make_box_domain(Vector3(0, 0, 0), Vector3(0.5, 0.5, 1.2), 0.1);
  for (Method method : both)
    CHECK_THROWS_WITH(body_of(problem, method), Catch::Contains("hole"));
}

TEST_CASE("A node outside the body is refused by name") {
  Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.4, 0.4), 0.1, 0.1, {1, 0.3, 0});
  const int outside = problem.nodes.add({0.2, 0.2, 0.49}, 0.1, solvers::NodeKind::interior);
  problem.nodes.positions[outside].z() = 0.7;
  CHECK_THROWS_WITH(body_of(problem, Method::collocation), Catch::Contains("node " + std::to_string(outside)));
}

TEST_CASE("A point that no support covers has no displacement") {
  const Problem problem = held_box(Vector3(0, 0, 0), Vector3(0.4, 0.4, 0.4), 0.1, 0.2, {1, 0.3, 0});
  for (Method method : both) {
    const auto body = body_of(problem, method);
    CHECK_THROWS_AS(body->at({3, 0, 0}, body->solve()), InputError);
  }
}

TEST_CASE("Methods are told by name") {
  for (Method method : {Method::published, Method::collocation, Method::galerkin})
    CHECK(solvers::method_from_string(solvers::to_string(method)) == method);
  CHECK_THROWS_AS(solvers::method_from_string("element"), InputError);
  CHECK_THROWS_WITH(solvers::method_from_string("element"), Catch::Contains("element"));
}
