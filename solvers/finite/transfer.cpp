#include "solvers/finite/transfer.hpp"

#include "solvers/points/point_kernels.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/SparseCholesky>
#include <fmt/format.h>

namespace spherecut::solvers {
namespace {

constexpr int most_rounds = 4;
constexpr double more = 100; // times the weight of a point with too low a J counts in the next round: some, beside a
                             // front, weigh next to nothing

/// The given deformation gradients at the points of a table, each evaluated when it is first asked for.
class GivenGradients {
 public:
  GivenGradients(const PointTable& table, const std::function<Matrix3(const Vector3&)>& given)
      : table_(table), given_(given), known_(table.positions.size(), 0), values_(table.positions.size()) {}
  const Matrix3& at(std::size_t point) {
    if (known_[point] == 0) {
      values_[point] = given_(table_.positions[point]);
      known_[point] = 1;
    }
    return values_[point];
  }

 private:
  const PointTable& table_;
  const std::function<Matrix3(const Vector3&)>& given_;
  std::vector<char> known_;
  std::vector<Matrix3> values_;
};

/// One least-squares fit; `emphasis`: of every point, times its weight.
VectorX fitted(const FiniteBody& body, VectorX coefficients, const std::vector<char>& free,
               const std::vector<double>& emphasis, GivenGradients& given) {
  std::vector<int> place(free.size(), -1); // of a free node among them
  int count = 0;
  for (std::size_t i = 0; i < free.size(); ++i)
    if (free[i] != 0)
      place[i] = count++;
  if (count == 0)
    return coefficients;
  const PointTable& table = body.points();
  std::vector<Eigen::Triplet<double>> entries;
  MatrixX right = MatrixX::Zero(count, 3);
  std::vector<int> slots; // of the group, that are free
  for (int group = 0; group < table.groups(); ++group) {
    const std::span<const int> nodes = table.nodes_of(group);
    slots.clear();
    for (int k = 0; k < std::ssize(nodes); ++k)
      if (place[nodes[k]] >= 0)
        slots.push_back(k);
    if (slots.empty())
      continue;
    LaneValues f[9];
    deformation_gradients(nodes.data(), static_cast<int>(nodes.size()), table.gradients_of(group), coefficients.data(),
                          f);
    for (int lane = 0; lane < table.count[group]; ++lane) {
      const std::size_t point = static_cast<std::size_t>(point_lanes) * group + lane;
      const double weight = emphasis[point] * table.weights[group].value[lane];
      Matrix3 left = given.at(point);
      for (int k = 0; k < 9; ++k)
        left.data()[k] -= f[k].value[lane];
      for (const int k : slots) {
        const Vector3 gradient = table.gradient(table.start[group] + k, lane);
        right.row(place[nodes[k]]) += weight * (left * gradient).transpose();
        for (const int l : slots)
          if (place[nodes[l]] <= place[nodes[k]])
            entries.emplace_back(place[nodes[k]], place[nodes[l]],
                                 weight * gradient.dot(table.gradient(table.start[group] + l, lane)));
      }
    }
  }
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  // What a rigid motion of free nodes alone would leave undetermined stays where it is.
  constexpr double held = 1e-9;
  for (int i = 0; i < count; ++i)
    matrix.coeffRef(i, i) *= 1 + held;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
  const MatrixX change = factor.info() == Eigen::Success ? MatrixX(factor.solve(right)) : MatrixX{};
  if (change.rows() != count || !change.allFinite())
    throw NumericalError(
        fmt::format("state of a body on other nodes: {} free nodes do not reach enough points", count));
  for (std::size_t i = 0; i < free.size(); ++i)
    if (place[i] >= 0)
      coefficients.segment<3>(3 * static_cast<Eigen::Index>(i)) += change.row(place[i]).transpose();
  return coefficients;
}

/// Points with a lower J count for more, and the nodes that reach them are free. False: there is no such point.
bool stress_inverted(const FiniteBody& body, const VectorX& coefficients, double least_jacobian,
                     std::vector<char>& free, std::vector<double>& emphasis) {
  const PointTable& table = body.points();
  bool has_found = false;
  for_each_deformation(table, coefficients, [&](int group, int lane, const Matrix3& deformation) {
    if (deformation.determinant() >= least_jacobian)
      return;
    has_found = true;
    emphasis[static_cast<std::size_t>(point_lanes) * group + lane] *= more;
    for (const int node : table.nodes_of(group))
      free[node] = 1;
  });
  return has_found;
}

} // namespace

VectorX nearest_state(const FiniteBody& body, VectorX coefficients, std::vector<char> free,
                      const std::function<Matrix3(const Vector3&)>& given, double least_jacobian) {
  std::vector<double> emphasis(body.points().positions.size(), 1);
  GivenGradients gradients(body.points(), given);
  coefficients = fitted(body, std::move(coefficients), free, emphasis, gradients);
  for (int round = 0; round < most_rounds && stress_inverted(body, coefficients, least_jacobian, free, emphasis);
       ++round)
    coefficients = fitted(body, std::move(coefficients), free, emphasis, gradients);
  return coefficients;
}

} // namespace spherecut::solvers
