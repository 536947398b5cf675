#include "solvers/algebra/factorisation.hpp"

#include "solvers/algebra/elimination_order.hpp"
#include "solvers/algebra/parallel.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <array>
#include <catch2/catch.hpp>
#include <numeric>
#include <random>

using namespace spherecut;
using solvers::SparseMatrix;

namespace {

/// Values of a random sparse matrix with `extra` couplings a row and a dominant or weak diagonal.
MatrixX random_matrix(int size, int extra, double diagonal, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> value(-1, 1);
  std::uniform_int_distribution<int> place(0, size - 1);
  MatrixX matrix = MatrixX::Zero(size, size);
  for (int row = 0; row < size; ++row) {
    matrix(row, row) += diagonal;
    for (int k = 0; k < extra; ++k) {
      const int column = place(random);
      matrix(row, column) += value(random);
    }
  }
  return matrix;
}

MatrixX random_right(Eigen::Index rows, Eigen::Index columns) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> value(-1, 1);
  return MatrixX::NullaryExpr(rows, columns, [&]() { return value(random); });
}

SparseMatrix sparse(const MatrixX& matrix) {
  return matrix.sparseView();
}

SparseMatrix lower(const MatrixX& matrix) {
  return MatrixX(matrix.triangularView<Eigen::Lower>()).sparseView();
}

double one_norm(const MatrixX& matrix) {
  return matrix.cwiseAbs().colwise().sum().maxCoeff();
}

std::vector<int> reversed(int size) {
  std::vector<int> order(size);
  std::iota(order.rbegin(), order.rend(), 0);
  return order;
}

} // namespace

TEST_CASE("Cholesky and LU factorisations solve what dense solvers solve") {
  for (int size : {1, 5, 60, 250}) {
    const MatrixX general = random_matrix(size, 4, 3, 21);
    const MatrixX symmetric = general * general.transpose() + MatrixX::Identity(size, size);
    const MatrixX right = random_right(size, 3);
    const Eigen::PartialPivLU<MatrixX> dense(general);
    const MatrixX exact = symmetric.llt().solve(right);
    for (const std::vector<int>& order : {std::vector<int>{}, reversed(size)}) {
      const auto cholesky = solvers::factor_ordered(lower(symmetric));
      CHECK((cholesky->solve(right) - exact).norm() < 1e-10 * exact.norm());
      CHECK((cholesky->solve_transposed(right) - exact).norm() < 1e-10 * exact.norm());
      CHECK(cholesky->nonzeros() >= size);
      const auto lu = solvers::factor_general(sparse(general), order);
      const MatrixX x = dense.solve(right), y = MatrixX(general.transpose()).partialPivLu().solve(right);
      CHECK((lu->solve(right) - x).norm() < 1e-10 * x.norm());
      CHECK((lu->solve_transposed(right) - y).norm() < 1e-10 * y.norm());
      CHECK(lu->nonzeros() >= size);
    }
  }
}

TEST_CASE("Halves of a solution, the second where its last rows are known") {
  for (const int size : {6, 60, 250}) {
    const MatrixX general = random_matrix(size, 4, 3, 21);
    const MatrixX symmetric = general * general.transpose() + MatrixX::Identity(size, size);
    const MatrixX right = random_right(size, 3), exact = symmetric.llt().solve(right);
    const auto cholesky = solvers::factor_ordered(lower(symmetric));
    for (const int known : {0, 1, size / 3, size}) // also in the middle of a supernode
      for (const int columns : {1, 3}) {
        MatrixX x = cholesky->forward(right.leftCols(columns));
        x.bottomRows(known) = exact.leftCols(columns).bottomRows(known);
        cholesky->backward(known, x);
        CHECK((x - exact.leftCols(columns)).norm() < 1e-10 * exact.norm());
      }
  }
}

TEST_CASE("Many right-hand sides at once agree with one at a time") {
  const MatrixX general = random_matrix(130, 4, 3, 11);
  const MatrixX right = random_right(130, 37); // not a multiple of the panel's width
  const auto lu = solvers::factor_general(sparse(general));
  const MatrixX together = lu->solve(right);
  for (Eigen::Index k = 0; k < right.cols(); ++k)
    CHECK((together.col(k) - lu->solve(right.col(k))).norm() < 1e-10 * together.col(k).norm());
  CHECK((general * together - right).norm() < 1e-10 * right.norm());
}

TEST_CASE("Cholesky reads the lower triangle alone") {
  const MatrixX general = random_matrix(40, 4, 3, 2);
  const MatrixX symmetric = general * general.transpose() + MatrixX::Identity(40, 40);
  MatrixX spoiled = symmetric;
  for (int k = 0; k + 1 < 40; ++k)
    spoiled(k, k + 1) += 100;
  const MatrixX right = random_right(40, 1), exact = symmetric.llt().solve(right);
  CHECK((solvers::factor_ordered(sparse(spoiled))->solve(right) - exact).norm() < 1e-10 * exact.norm());
}

TEST_CASE("The 1-norm is the dense one, from all entries or from the lower triangle") {
  const MatrixX general = random_matrix(50, 4, -2, 5);
  const MatrixX symmetric = general + general.transpose();
  CHECK(solvers::one_norm(sparse(general)) == Approx(one_norm(general)));
  CHECK(solvers::one_norm(lower(symmetric), true) == Approx(one_norm(symmetric)));
  // Entries above the diagonal do not belong to the lower triangle, whether they are stored or not.
  CHECK(solvers::one_norm(sparse(symmetric), true) == Approx(one_norm(symmetric)));
}

TEST_CASE("The condition estimate is a lower bound within a factor of three") {
  for (double diagonal : {0.5, 3.0, 10.0})
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
      const MatrixX general = random_matrix(80, 3, diagonal, seed);
      const double exact = one_norm(general) * one_norm(general.inverse());
      const auto lu = solvers::factor_general(sparse(general));
      const double estimate = solvers::condition_estimate(*lu, solvers::one_norm(sparse(general)), 80);
      CHECK(estimate < 1.0001 * exact);
      CHECK(estimate > exact / 3);
    }
  // Badly conditioned: the second difference with natural conditions at one end, condition about 2 n^2.
  const int n = 200;
  MatrixX difference = 2 * MatrixX::Identity(n, n);
  difference.diagonal(1).setConstant(-1);
  difference.diagonal(-1).setConstant(-1);
  difference(n - 1, n - 1) = 1;
  const double exact = one_norm(difference) * one_norm(difference.inverse());
  const auto cholesky = solvers::factor_ordered(lower(difference));
  const double estimate = solvers::condition_estimate(*cholesky, solvers::one_norm(lower(difference), true), n);
  CHECK(estimate == Approx(exact).epsilon(0.01)); // the inverse is positive: the estimate is exact
}

TEST_CASE("Singular and indefinite matrices are refused") {
  MatrixX singular = random_matrix(30, 4, 3, 6);
  singular.row(7).setZero();
  CHECK_THROWS_AS(solvers::factor_general(sparse(singular)), NumericalError);
  const MatrixX indefinite = Eigen::Vector4d(1, 2, -1, 3).asDiagonal();
  CHECK_THROWS_AS(solvers::factor_ordered(lower(indefinite)), NumericalError);
  CHECK_THROWS_WITH(solvers::factor_ordered(lower(indefinite)), Catch::Contains("not positive definite"));
  const MatrixX empty_row = Eigen::Vector4d(1, 2, 0, 3).asDiagonal();
  CHECK_THROWS_AS(solvers::factor_ordered(lower(empty_row)), NumericalError);
}

TEST_CASE("A matrix of 3 x 3 blocks is factored as the same matrix without blocks") {
  const int nodes = 70, size = 3 * nodes;
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  MatrixX blocks = MatrixX::Zero(size, size);
  for (int node = 0; node < nodes; ++node)
    for (const int other : {node, node - 1, node - 9})
      if (other >= 0)
        blocks.block<3, 3>(3 * node, 3 * other) = MatrixX::NullaryExpr(3, 3, [&] { return uniform(random); });
  const MatrixX symmetric = blocks * blocks.transpose() + MatrixX::Identity(size, size);
  const MatrixX right = random_right(size, 4), exact = symmetric.llt().solve(right);
  const MatrixX factor = symmetric.llt().matrixL();
  // Columns that reach little, the end alone, or everything; one of zeros; none.
  std::vector<SparseMatrix> sparse_columns;
  for (const int last : {0, 3, 70, 140}) {
    SparseMatrix columns(size, last);
    for (int c = 0; c < last; ++c)
      for (int k = 0; k < c % 5; ++k)
        columns.coeffRef((c * c + 37 * k) % size, c) = uniform(random);
    sparse_columns.push_back(columns);
  }
  // One more unknown that is coupled to nothing is no block: the same factor from the ordinary analysis.
  MatrixX longer = MatrixX::Identity(size + 1, size + 1);
  longer.topLeftCorner(size, size) = symmetric;
  const auto whole = solvers::factor_ordered(lower(longer));
  SparseMatrix full_diagonals = lower(symmetric);
  for (int node = 0; node < nodes; ++node)
    for (int a = 0; a < 3; ++a)
      for (int b = a + 1; b < 3; ++b)
        full_diagonals.coeffRef(3 * node + a, 3 * node + b) = symmetric(3 * node + a, 3 * node + b);
  full_diagonals.makeCompressed();
  for (const SparseMatrix& matrix : {lower(symmetric), full_diagonals}) {
    const auto cholesky = solvers::factor_ordered(matrix);
    CHECK(cholesky->nonzeros() + 1 == whole->nonzeros());
    CHECK((cholesky->solve(right) - exact).norm() < 1e-10 * exact.norm());
    for (const SparseMatrix& columns : sparse_columns) {
      const MatrixX dense(columns), compliance = cholesky->compliance(columns);
      const MatrixX truth = dense.transpose() * symmetric.llt().solve(dense);
      REQUIRE(compliance.rows() == columns.cols());
      CHECK((compliance - truth).norm() <= 1e-11 * truth.norm());
    }
    CHECK((cholesky->trailing(100) - factor.bottomRightCorner(100, 100)).norm() < 1e-10 * factor.norm());
  }
  MatrixX indefinite = symmetric;
  indefinite(40, 40) = -1;
  CHECK_THROWS_WITH(solvers::factor_ordered(lower(indefinite)), Catch::Contains("(column 40 of 210"));
}

TEST_CASE("The factor of a body has the same bits whatever the number of threads") {
  // Nodes on a grid, coupled as overlapping spheres are: wide supernodes, and subtrees side by side.
  const int side = 12, nodes = side * side * side, reach = 2, size = 3 * nodes;
  const auto place = [&](int node) {
    return std::array<int, 3>{node / (side * side), node / side % side, node % side};
  };
  std::vector<int> start{0}, neighbours;
  for (int node = 0; node < nodes; ++node) {
    for (int other = 0; other < nodes; ++other) {
      const auto a = place(node), b = place(other);
      if (std::abs(a[0] - b[0]) <= reach && std::abs(a[1] - b[1]) <= reach && std::abs(a[2] - b[2]) <= reach)
        neighbours.push_back(other);
    }
    start.push_back(static_cast<int>(neighbours.size()));
  }
  const std::vector<int> order = solvers::fill_reducing_ordering(start, neighbours);
  std::vector<int> rank(nodes);
  for (int k = 0; k < nodes; ++k)
    rank[order[k]] = k;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Eigen::Triplet<double>> entries;
  for (int node = 0; node < nodes; ++node)
    for (int k = start[node]; k < start[node + 1]; ++k)
      if (const int row = rank[node], column = rank[neighbours[k]]; row >= column)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            if (row > column || a >= b)
              entries.emplace_back(3 * row + a, 3 * column + b, row == column && a == b ? 300.0 : uniform(random));
  SparseMatrix matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const MatrixX right = random_right(size, 2);
  const auto alone = solvers::factor_ordered(matrix);
  const MatrixX solution = alone->solve(right);
  CHECK((matrix.selfadjointView<Eigen::Lower>() * solution - right).norm() < 1e-12 * right.norm());
  const MatrixX trailing = alone->trailing(1000);
  struct Threads {
    explicit Threads(int count) { solvers::set_thread_count(count); }
    ~Threads() { solvers::set_thread_count(1); }
  } const two(2);
  const auto together = solvers::factor_ordered(matrix);
  CHECK(together->trailing(1000) == trailing);
  CHECK(together->solve(right) == solution);
  // The first column that fails is told, whichever thread comes to it.
  SparseMatrix indefinite = matrix;
  for (const int column : {700, 40, 4000})
    indefinite.coeffRef(column, column) = -1;
  CHECK_THROWS_WITH(solvers::factor_ordered(indefinite), Catch::Contains("(column 40 of 5184"));
}
