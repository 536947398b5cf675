#include "solvers/fracture/tear_seed.hpp"

#include "solvers/fracture/local_values.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double worth_a_look = 0.5; // of the strength: stress at a node below which its ball is not looked at

/// Corners of an icosahedron and the middles of its faces, unit vectors.
const std::vector<Vector3>& corners() {
  static const std::vector<Vector3> points = [] {
    std::vector<Vector3> all;
    for (const double a : {1.0, -1.0})
      for (const double b : {std::numbers::phi, -std::numbers::phi})
        for (const Vector3& x : {Vector3(0, a, b), Vector3(a, b, 0), Vector3(b, 0, a)})
          all.push_back(x.normalized());
    return all;
  }();
  return points;
}
const std::vector<Vector3>& faces() {
  static const std::vector<Vector3> points = [] {
    std::vector<Vector3> all;
    for (const double a : {1.0, -1.0})
      for (const double b : {1.0, -1.0}) {
        for (const double c : {1.0, -1.0})
          all.push_back(Vector3(a, b, c).normalized());
        const double p = a * std::numbers::phi, q = b / std::numbers::phi;
        for (const Vector3& x : {Vector3(0, q, p), Vector3(q, p, 0), Vector3(p, 0, q)})
          all.push_back(x.normalized());
      }
    return all;
  }();
  return points;
}

PrincipalStress principal(const Matrix3& stress) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(stress);
  return {solver.eigenvalues()[2], solver.eigenvectors().col(2)};
}

} // namespace

double averaging_length(const Material& material, double toughness, double strength) {
  return 2 * plane_strain_modulus(material) * toughness / (std::numbers::pi * strength * strength);
}

double seed_radius(const Material& material, double toughness, double strength) {
  return 3 * std::numbers::pi * plane_strain_modulus(material) * toughness / (8 * strength * strength);
}

PrincipalStress averaged_stress(const Discretisation& body, const Field& field, const Vector3& x, double radius) {
  if (!(radius > 0) || !std::isfinite(radius))
    throw InputError(fmt::format("tearing: stress averaged over a ball of {} m; it must be positive", radius));
  const Problem& problem = body.problem();
  Matrix3 sum = Matrix3::Zero();
  double weights = 0;
  const auto add = [&](const Vector3& at, double weight) {
    if (problem.domain->signed_distance(at) > 0 || (problem.incision != nullptr && problem.incision->blocks(x, at)))
      return;
    try {
      sum += weight * body.at(at, field).stress;
      weights += weight;
    } catch (const InputError&) { // no support there
    }
  };
  // Shells about their own parts of the ball's volume.
  add(x, std::pow(0.25, 3));
  for (const Vector3& direction : corners())
    add(x + 0.45 * radius * direction, (std::pow(0.6, 3) - std::pow(0.25, 3)) / 12);
  for (const Vector3& direction : faces())
    add(x + 0.7 * radius * direction, (std::pow(0.82, 3) - std::pow(0.6, 3)) / 20);
  for (const Vector3& direction : corners())
    add(x + 0.92 * radius * direction, (1 - std::pow(0.82, 3)) / 12);
  return weights > 0 ? principal(sum / weights) : PrincipalStress{};
}

WeakPlace weakest_place(const Discretisation& body, const Field& field, double radius, double strength,
                        const std::function<bool(int node)>& counts) {
  WeakPlace weakest;
  const NodeCloud& nodes = body.problem().nodes;
  for (int i = 0; i < nodes.size(); ++i) {
    if (!counts(i) || principal(body.at(nodes.positions[i], field).stress).stress < worth_a_look * strength)
      continue;
    const PrincipalStress here = averaged_stress(body, field, nodes.positions[i], radius);
    if (here.stress >= strength && (weakest.node < 0 || here.stress > weakest.stress.stress))
      weakest = {i, here};
  }
  return weakest;
}

} // namespace spherecut::solvers
