// Notation: r, z cylindrical coordinates; strain (e_rr, e_zz, e_tt = u_r / r, g_rz); B strain per nodal displacement;
// D elastic matrix. Integrals run around the axis: dV = 2 pi r dr dz.
#include "experiments/reference/axisymmetric.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

using Sparse = Eigen::SparseMatrix<double>;
using ElementMatrix = Eigen::Matrix<double, 18, 18>;
using ElementNodes = std::array<int, 9>;

/// Quadratic Lagrange polynomials on {-1, 0, 1} and their derivatives.
struct Quadratic {
  explicit Quadratic(double x)
      : value(0.5 * x * (x - 1), 1 - x * x, 0.5 * x * (x + 1)), slope(x - 0.5, -2 * x, x + 0.5) {}
  Eigen::RowVector3d value, slope;
};

Eigen::Matrix4d elastic_matrix(const solvers::Material& material) {
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  Eigen::Matrix4d D = Eigen::Matrix4d::Zero();
  D.topLeftCorner<3, 3>().setConstant(lambda);
  D.diagonal() << lambda + 2 * mu, lambda + 2 * mu, lambda + 2 * mu, mu;
  return D;
}

ElementNodes element_nodes(const AxisymmetricGrid& grid, int row, int column) {
  ElementNodes nodes{};
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q)
      nodes[3 * p + q] = grid.node(row + p, column + q);
  return nodes;
}

ElementMatrix element_stiffness(const AxisymmetricGrid& grid, const ElementNodes& nodes, const Eigen::Matrix4d& D) {
  Eigen::Matrix<double, 9, 2> X;
  for (int k = 0; k < 9; ++k)
    X.row(k) = grid.nodes[nodes[k]];
  const std::array points{-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, weights{5.0 / 9, 8.0 / 9, 5.0 / 9};
  ElementMatrix K = ElementMatrix::Zero();
  double orientation = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      const Quadratic s(points[a]), t(points[b]);
      Eigen::Matrix<double, 9, 1> N;
      Eigen::Matrix<double, 2, 9> dN;
      for (int p = 0; p < 3; ++p)
        for (int q = 0; q < 3; ++q) {
          N[3 * p + q] = s.value[p] * t.value[q];
          dN(0, 3 * p + q) = s.slope[p] * t.value[q];
          dN(1, 3 * p + q) = s.value[p] * t.slope[q];
        }
      const Eigen::Matrix2d J = dN * X;
      const double determinant = J.determinant(), r = N.dot(X.col(0));
      if (orientation == 0)
        orientation = determinant;
      if (!(determinant * orientation > 0) || !(r > 0))
        throw NumericalError(fmt::format("axisymmetric: element of nodes {} to {} is inverted or crosses the axis "
                                         "(Jacobian {}, radius {} m)",
                                         nodes.front(), nodes.back(), determinant, r));
      const Eigen::Matrix<double, 2, 9> G = J.inverse() * dN;
      Eigen::Matrix<double, 4, 18> B = Eigen::Matrix<double, 4, 18>::Zero();
      for (int k = 0; k < 9; ++k) {
        B(0, 2 * k) = B(3, 2 * k + 1) = G(0, k);
        B(1, 2 * k + 1) = B(3, 2 * k) = G(1, k);
        B(2, 2 * k) = N[k] / r;
      }
      K += (weights[a] * weights[b] * std::abs(determinant) * 2 * std::numbers::pi * r) * B.transpose() * D * B;
    }
  return K;
}

void check(const AxisymmetricGrid& grid) {
  if (grid.rows < 3 || grid.columns < 3 || grid.rows % 2 == 0 || grid.columns % 2 == 0 ||
      grid.rows * grid.columns != std::ssize(grid.nodes))
    throw InputError(
        fmt::format("axisymmetric: grid of {} x {} nodes with {} positions (rows and columns must be odd, at "
                    "least 3, and their product the number of positions)",
                    grid.rows, grid.columns, grid.nodes.size()));
}

std::vector<double> with_midpoints(const std::vector<double>& corners) {
  std::vector<double> all;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (i > 0)
      all.push_back(0.5 * (corners[i - 1] + corners[i]));
    all.push_back(corners[i]);
  }
  return all;
}

} // namespace

AxisymmetricGrid make_grid(const std::vector<double>& rows, const std::vector<double>& columns,
                           const std::function<Vector2(double, double)>& map) {
  const std::vector<double> s = with_midpoints(rows), t = with_midpoints(columns);
  AxisymmetricGrid grid;
  grid.rows = static_cast<int>(s.size());
  grid.columns = static_cast<int>(t.size());
  grid.nodes.reserve(s.size() * t.size());
  for (const double si : s)
    for (const double tj : t)
      grid.nodes.push_back(map(si, tj));
  check(grid);
  return grid;
}

std::vector<double> graded_interval(double dense, double coarse, int n, double exponent) {
  std::vector<double> values;
  for (int k = 0; k <= n; ++k)
    values.push_back(dense + (coarse - dense) * std::pow(static_cast<double>(k) / n, exponent));
  return values;
}

AxisymmetricSolution solve_axisymmetric(const AxisymmetricGrid& grid, const solvers::Material& material,
                                        const std::vector<AxisymmetricSupport>& supports) {
  return solve_axisymmetric(
      grid, [&](const Vector2&) { return material; }, supports);
}

AxisymmetricSolution solve_axisymmetric(const AxisymmetricGrid& grid,
                                        const std::function<solvers::Material(const Vector2& middle)>& material_of,
                                        const std::vector<AxisymmetricSupport>& supports) {
  check(grid);
  const int nodes = static_cast<int>(grid.nodes.size()), unknowns = 2 * nodes;

  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(grid.rows / 2) * (grid.columns / 2) * 324);
  for (int row = 0; row + 2 < grid.rows; row += 2)
    for (int column = 0; column + 2 < grid.columns; column += 2) {
      const ElementNodes element = element_nodes(grid, row, column);
      const solvers::Material material = material_of(grid.nodes[element[4]]);
      material.check();
      const ElementMatrix K = element_stiffness(grid, element, elastic_matrix(material));
      for (int i = 0; i < 18; ++i)
        for (int j = 0; j < 18; ++j)
          entries.emplace_back(2 * element[i / 2] + i % 2, 2 * element[j / 2] + j % 2, K(i, j));
    }
  Sparse K(unknowns, unknowns);
  K.setFromTriplets(entries.begin(), entries.end());

  VectorX u = VectorX::Zero(unknowns);
  std::vector<char> held(unknowns, 0);
  for (int i = 0; i < nodes; ++i)
    held[2 * i] = grid.nodes[i].x() == 0;
  for (const AxisymmetricSupport& support : supports) {
    if (support.node < 0 || support.node >= nodes || support.component < 0 || support.component > 1)
      throw InputError(fmt::format("axisymmetric: support on component {} of node {} (allowed: 0 or 1 of 0 to {})",
                                   support.component, support.node, nodes - 1));
    const int k = 2 * support.node + support.component;
    held[k] = 1;
    u[k] = support.value;
  }

  // K_ff u_f = -K_fh u_h for the free unknowns f and the held ones h.
  std::vector<int> free_index(unknowns, -1), free_unknowns;
  for (int k = 0; k < unknowns; ++k)
    if (held[k] == 0) {
      free_index[k] = static_cast<int>(free_unknowns.size());
      free_unknowns.push_back(k);
    }
  const VectorX load = -(K * u);
  VectorX right(static_cast<Eigen::Index>(free_unknowns.size()));
  entries.clear();
  for (std::size_t i = 0; i < free_unknowns.size(); ++i) {
    right[static_cast<Eigen::Index>(i)] = load[free_unknowns[i]];
    for (Sparse::InnerIterator it(K, free_unknowns[i]); it; ++it)
      if (free_index[it.row()] >= 0)
        entries.emplace_back(free_index[it.row()], static_cast<int>(i), it.value());
  }
  Sparse free_block(right.size(), right.size());
  free_block.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Sparse> factor(free_block);
  const double smallest_pivot = factor.info() == Eigen::Success && right.size() > 0 ? factor.vectorD().minCoeff() : 0;
  if (right.size() > 0 && !(smallest_pivot > 1e-13 * factor.vectorD().maxCoeff()))
    throw NumericalError(
        fmt::format("axisymmetric: singular system of {} unknowns (smallest pivot {}): is the body held "
                    "along the axis?",
                    right.size(), smallest_pivot));
  const VectorX solution = factor.solve(right);
  for (std::size_t i = 0; i < free_unknowns.size(); ++i)
    u[free_unknowns[i]] = solution[static_cast<Eigen::Index>(i)];

  const VectorX force = K * u;
  AxisymmetricSolution result;
  for (int i = 0; i < nodes; ++i) {
    result.displacement.emplace_back(u[2 * i], u[2 * i + 1]);
    result.reaction.emplace_back(held[2 * i] != 0 ? force[2 * i] : 0, held[2 * i + 1] != 0 ? force[2 * i + 1] : 0);
  }
  return result;
}

} // namespace spherecut::experiments
