#include "solvers/algebra/dense_elimination.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/types.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

MatrixX random_matrix(int rows, int columns, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  MatrixX m(rows, columns);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j)
      m(i, j) = std::ldexp(static_cast<double>(random() >> 11), -52) - 1;
  return m;
}

void fill(DenseSystem& system, const MatrixX& a, const MatrixX& b) {
  system.clear();
  for (int i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < a.cols(); ++j)
      system.row(i)[j] = a(i, j);
    for (int j = 0; j < b.cols(); ++j)
      system.row(i)[a.cols() + j] = b(i, j);
  }
}

} // namespace

TEST_CASE("Elimination solves systems of every remainder of its block sizes", "[elimination]") {
  for (int n : {1, 2, 3, 4, 5, 7, 8, 9, 12, 15, 16, 31, 40, 99})
    for (int right : {1, 3, 8}) {
      MatrixX a = random_matrix(n, n, 17 * n + right);
      for (int i = 0; i < n; i += 2)
        a(i, i) = 0; // pivots must be looked for
      if (n == 1)
        a(0, 0) = 2;
      const MatrixX b = random_matrix(n, right, n);
      const MatrixX exact = a.fullPivLu().solve(b);
      DenseSystem system(n, right);
      for (bool portable : {false, true}) {
        fill(system, a, b);
        const EliminationResult result = portable ? system.solve_portable() : system.solve();
        REQUIRE(result.regular);
        CHECK(result.pivot_ratio >= 1);
        for (int i = 0; i < n; ++i)
          for (int c = 0; c < right; ++c)
            CHECK(std::abs(system.solution(i, c) - exact(i, c)) < 1e-9 * (1 + exact.cwiseAbs().maxCoeff()));
      }
    }
}

TEST_CASE("Elimination reports a singular system", "[elimination]") {
  MatrixX a = random_matrix(12, 12, 3);
  a.col(7).setZero();
  DenseSystem system(12, 2);
  fill(system, a, random_matrix(12, 2, 1));
  CHECK_FALSE(system.solve().regular);
  CHECK_THROWS_AS(DenseSystem(0, 1), InputError);
  CHECK_THROWS_AS(DenseSystem(5, 9), InputError);
}
