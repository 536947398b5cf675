#include "solvers/algebra/linear_complementarity.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using solvers::ComplementaritySolution;
using solvers::solve_complementarity;

namespace {

class Numbers {
 public:
  explicit Numbers(std::uint64_t seed) : generator_(seed) {}
  double number() { return distribution_(generator_); }
  VectorX vector(int size) {
    VectorX v(size);
    for (int k = 0; k < size; ++k)
      v[k] = number();
    return v;
  }
  MatrixX matrix(int rows, int columns) {
    MatrixX m(rows, columns);
    for (int k = 0; k < columns; ++k)
      m.col(k) = vector(rows);
    return m;
  }

 private:
  std::mt19937_64 generator_;
  std::normal_distribution<double> distribution_;
};

/// The forces of the one active set among all 2^n that satisfies every condition.
VectorX by_enumeration(const MatrixX& matrix, const VectorX& gap) {
  const int size = static_cast<int>(gap.size());
  VectorX found;
  int solutions = 0;
  for (unsigned set = 0; set < (1U << size); ++set) {
    std::vector<int> chosen;
    for (int k = 0; k < size; ++k)
      if (set >> k & 1U)
        chosen.push_back(k);
    VectorX forces = VectorX::Zero(size);
    if (!chosen.empty()) {
      const MatrixX part = matrix(chosen, chosen);
      const VectorX depth = -gap(chosen);
      forces(chosen) = part.fullPivLu().solve(depth);
    }
    const VectorX open = matrix * forces + gap;
    if (forces.minCoeff() >= 0 && open.minCoeff() >= -1e-11) {
      found = forces;
      ++solutions;
    }
  }
  REQUIRE(solutions == 1);
  return found;
}

} // namespace

TEST_CASE("Complementarity with a P-matrix finds the only active set that works") {
  Numbers random(31);
  for (int size = 1; size <= 8; ++size)
    for (int round = 0; round < 12; ++round) {
      // Positive definite plus skew: a P-matrix that is far from symmetric.
      const MatrixX root = random.matrix(size, size), skew = random.matrix(size, size);
      const MatrixX matrix = root * root.transpose() + 0.1 * MatrixX::Identity(size, size) + skew - skew.transpose();
      const VectorX gap = random.vector(size), exact = by_enumeration(matrix, gap);
      std::vector<char> everything(size, 1), some(size, 0);
      some[size / 2] = 1;
      for (const std::vector<char>& start : {std::vector<char>{}, everything, some}) {
        const ComplementaritySolution solution = solve_complementarity(matrix, gap, start, 1e-12);
        CHECK(solution.converged);
        CHECK((solution.forces - exact).norm() < 1e-8 * (1 + exact.norm()));
        for (int k = 0; k < size; ++k)
          if (solution.forces[k] > 0)
            CHECK(solution.active[k]);
      }
    }
}

TEST_CASE("Complementarity with large symmetric matrices leaves no residual") {
  Numbers random(77);
  for (int size : {40, 150}) {
    // Compliance like: nearby unknowns move together.
    MatrixX matrix(size, size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b)
        matrix(a, b) = 1e-3 / (0.3 + std::abs(a - b));
    matrix.diagonal().array() += 1e-3;
    const VectorX gap = 1e-3 * random.vector(size);
    const ComplementaritySolution solution = solve_complementarity(matrix, gap, {}, 1e-13);
    const VectorX open = matrix * solution.forces + gap;
    CHECK(solution.converged);
    CHECK(solution.forces.minCoeff() >= 0);
    CHECK(solution.forces.maxCoeff() > 0);
    CHECK(open.minCoeff() > -1e-12);
    CHECK((open.array() * solution.forces.array()).abs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("Single pivots take over where block pivots cycle") {
  // Murty's example: a P-matrix (unit lower triangular with 2 below the diagonal) on which all-at-once pivots wander.
  for (int size : {3, 6, 9}) {
    MatrixX matrix = MatrixX::Identity(size, size);
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < row; ++column)
        matrix(row, column) = 2;
    for (const MatrixX& form : {matrix, MatrixX(matrix.transpose())}) {
      const VectorX gap = -VectorX::Ones(size);
      const ComplementaritySolution solution = solve_complementarity(form, gap, {}, 1e-12);
      CHECK(solution.converged);
      CHECK((solution.forces - by_enumeration(form, gap)).norm() < 1e-12);
    }
  }
  // Cyclic coupling of three: each pair of block pivots undoes the last.
  Eigen::Matrix3d cyclic;
  cyclic << 1, 2, 0, 0, 1, 2, 2, 0, 1;
  const ComplementaritySolution solution = solve_complementarity(cyclic, -Vector3::Ones(), {}, 1e-12);
  CHECK(solution.converged);
  CHECK((solution.forces - VectorX::Constant(3, 1.0 / 3)).norm() < 1e-12);
}

TEST_CASE("No contact needs no force") {
  const ComplementaritySolution solution =
      solve_complementarity(MatrixX::Identity(4, 4), VectorX::Constant(4, 0.1), {1, 1, 1, 1}, 1e-12);
  CHECK(solution.converged);
  CHECK(solution.forces.isZero(0));
  CHECK(solve_complementarity(MatrixX(0, 0), VectorX(0), {}, 1e-12).converged);
}

TEST_CASE("Complementarity closes gaps and lets go of forces down to the tolerance") {
  // Springs that do not feel one another, pressed by `depth` or clear of the obstacle by it: force = depth /
  // compliance.
  const double compliance = 1e-3; // m/N
  for (double depth : {1e-3, 5e-7, 2e-9}) {
    const Eigen::Vector4d gap(-depth, depth, -0.5 * depth, 0);
    for (const std::vector<char>& start : {std::vector<char>{}, {1, 1, 1, 1}, {0, 1, 0, 1}}) {
      const ComplementaritySolution solution =
          solve_complementarity(compliance * MatrixX::Identity(4, 4), gap, start, 1e-10);
      CHECK(solution.converged);
      CHECK((solution.forces - Eigen::Vector4d(depth, 0, 0.5 * depth, 0) / compliance).norm() < 1e-12 / compliance);
    }
  }
}
