// Cholesky factors of dense matrices, definite and semidefinite.
#include "solvers/algebra/dense_cholesky.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

MatrixX random_rows(int rows, int columns) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  return MatrixX::NullaryExpr(rows, columns, [&] { return normal(random); });
}

VectorX solution_by(const MatrixX& lower, const VectorX& right) {
  const VectorX half = lower.triangularView<Eigen::Lower>().solve(right);
  return lower.transpose().triangularView<Eigen::Upper>().solve(half);
}

} // namespace

TEST_CASE("The semidefinite factor of a definite matrix is its Cholesky factor") {
  const MatrixX rows = random_rows(12, 7), matrix = rows.transpose() * rows;
  MatrixX lower = matrix, plain = matrix;
  CHECK(factor_lower_semidefinite(lower, matrix.diagonal()) == -1);
  CHECK(factor_lower(plain) == -1);
  CHECK((lower - plain).norm() == 0);
  CHECK((lower * lower.transpose() - matrix).norm() < 1e-13 * matrix.norm());
}

TEST_CASE("Of unknowns that repeat one another the faintest stays zero, and the solution is one all the same") {
  MatrixX rows = random_rows(12, 7);
  rows.col(3) = 1e-5 * (rows.col(0) - 2 * rows.col(1));
  rows.col(6) = rows.col(2);
  rows.col(2) *= 1e-3; // before the one that it repeats
  const MatrixX matrix = rows.transpose() * rows;
  MatrixX lower = matrix;
  bool any_left_out = false;
  CHECK(factor_lower_semidefinite(lower, matrix.diagonal(), &any_left_out) == -1);
  CHECK(any_left_out);
  MatrixX fewer = matrix.topLeftCorner(3, 3); // without what the third repeats
  CHECK(factor_lower_semidefinite(fewer, matrix.diagonal().head(3), &any_left_out) == -1);
  CHECK_FALSE(any_left_out);
  const VectorX right = matrix * VectorX::LinSpaced(7, 1, 2), x = solution_by(lower, right);
  CHECK((matrix * x - right).norm() < 1e-11 * right.norm());
  CHECK(std::abs(x[3]) < 1e-9);
  CHECK(std::abs(x[2]) < 1e-9);
  // Load on what has no energy is left over at the faint unknowns alone.
  VectorX off = VectorX::Zero(7);
  off[3] = 1;
  CHECK((matrix * solution_by(lower, right + off) - right).norm() < 1e-9 * right.norm());
}

TEST_CASE("An unknown without energy is left out, and the matrix is semidefinite all the same") {
  MatrixX rows = random_rows(9, 5);
  rows.col(2).setZero();
  const MatrixX matrix = rows.transpose() * rows;
  MatrixX lower = matrix;
  bool any_left_out = false;
  CHECK(factor_lower_semidefinite(lower, matrix.diagonal(), &any_left_out) == -1);
  CHECK(any_left_out);
  const VectorX right = matrix * VectorX::LinSpaced(5, 1, 2), x = solution_by(lower, right);
  CHECK((matrix * x - right).norm() < 1e-11 * right.norm());
  CHECK(x[2] == 0);
}

TEST_CASE("A matrix that is not semidefinite is told by its column") {
  MatrixX matrix = MatrixX::Identity(4, 4);
  matrix(2, 2) = -0.5;
  MatrixX lower = matrix;
  CHECK(factor_lower_semidefinite(lower, VectorX::Ones(4)) == 2);
  CHECK(factor_lower(matrix) == 2);
}
