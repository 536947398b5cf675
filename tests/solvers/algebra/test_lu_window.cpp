#include "solvers/algebra/lu_window.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <numeric>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// Sparse, not symmetric, regular.
MatrixX random_matrix(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  MatrixX a = MatrixX::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    a(i, i) = 3 + uniform(random);
    for (const int step : {1, 2, 7})
      if (i + step < n) {
        a(i, i + step) = uniform(random);
        a(i + step, i) = uniform(random);
      }
  }
  return a;
}

MatrixX random_right(int n, int columns, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return MatrixX::NullaryExpr(n, columns, [&] { return normal(random); });
}

/// Solution of the whole from a window whose unknowns are `unknowns`, then those in the room.
MatrixX solved(const LuWindow& window, const std::vector<int>& unknowns, int n, const MatrixX& right,
               bool transposed = false) {
  MatrixX reduced = window.reduce(right.topRows(n), transposed);
  for (Eigen::Index s = 0; s < reduced.rows(); ++s)
    if (window.active(static_cast<int>(s)))
      reduced.row(s) += right.row(s < std::ssize(unknowns) ? unknowns[s] : n + s - std::ssize(unknowns));
  const MatrixX in_window = window.solve(reduced, transposed);
  MatrixX x = MatrixX::Zero(right.rows(), right.cols());
  x.topRows(n) = window.recover(in_window, right.topRows(n), transposed);
  for (Eigen::Index s = 0; s < reduced.rows(); ++s)
    x.row(s < std::ssize(unknowns) ? unknowns[s] : n + s - std::ssize(unknowns)) = in_window.row(s);
  return x;
}

} // namespace

TEST_CASE("A window solves the general system it was taken from, and its transpose", "[lu_window]") {
  const int n = 90;
  const MatrixX a = random_matrix(n, 1);
  std::vector<int> unknowns{80, 12, 13, 14, 15, 16, 40, 41, 42};
  for (const bool ordered : {false, true}) {
    std::vector<int> ordering(n);
    std::iota(ordering.rbegin(), ordering.rend(), 0);
    LuWindow window(a.sparseView(), unknowns, 3, ordered ? ordering : std::vector<int>());
    window.factor();
    CHECK(window.factored() == 9);
    const MatrixX right = random_right(n, 20, 2);
    MatrixX room = MatrixX::Zero(n + 3, 20);
    room.topRows(n) = right;
    const MatrixX exact = a.partialPivLu().solve(right), other = a.transpose().partialPivLu().solve(right);
    CHECK((solved(window, unknowns, n, room).topRows(n) - exact).norm() < 1e-12 * exact.norm());
    CHECK((solved(window, unknowns, n, room, true).topRows(n) - other).norm() < 1e-12 * other.norm());
    const double condition =
        a.cwiseAbs().colwise().sum().maxCoeff() * MatrixX(a.inverse()).cwiseAbs().colwise().sum().maxCoeff();
    CHECK(window.condition_estimate() <= condition * (1 + 1e-9));
    CHECK(window.condition_estimate() > condition / 3);
  }
}

TEST_CASE("Changed rows, new and removed unknowns give what the whole changed matrix gives", "[lu_window]") {
  const int n = 90;
  const MatrixX a = random_matrix(n, 3);
  // 20 to 22 will change; their rows reach 13 to 29.
  std::vector<int> unknowns(20);
  std::iota(unknowns.begin(), unknowns.end(), 12);
  // What will not change is eliminated ahead; or too much is, and the window has to start over.
  const bool enough = GENERATE(true, false);
  LuWindow window(a.sparseView(), unknowns, 4, {});
  CHECK(window.leads_far(0)); // 12 with 5
  CHECK_FALSE(window.leads_far(9));
  std::vector<char> kept(24, 0);
  std::fill_n(kept.begin() + 8, enough ? 3 : 2, 1);
  window.prepare(kept);
  CHECK(window.done_ahead() == (enough ? 17 : 18));
  const MatrixX before = random_right(n, 2, 8);
  MatrixX with_room = MatrixX::Zero(n + 4, 2);
  with_room.topRows(n) = before;
  const MatrixX at_first = a.partialPivLu().solve(before);
  CHECK((solved(window, unknowns, n, with_room).topRows(n) - at_first).norm() < 1e-12 * at_first.norm());
  MatrixX changed = MatrixX::Zero(n + 1, n + 1); // one unknown more
  changed.topLeftCorner(n, n) = a;
  for (const int row : {20, 21, 22}) {
    changed.row(row).setZero();
    window.clear_row(row - 12);
    const MatrixX entries = random_right(1, 9, static_cast<unsigned>(row));
    for (int k = 0; k < 9; ++k) {
      changed(row, 16 + k) = entries(0, k) + (16 + k == row ? 4 : 0);
      window.add(row - 12, 4 + k, changed(row, 16 + k));
    }
  }
  window.activate(20);
  changed(n, n) = 2;
  changed(n, 21) = 0.5;
  changed(22, n) = -0.7;
  window.add(20, 20, 2);
  window.add(20, 9, 0.5);
  window.add(10, 20, -0.7);
  CHECK(window.is_prepared() == enough);
  window.factor();
  CHECK(window.factored() == (enough ? 4 : 21));
  const MatrixX right = random_right(n + 1, 3, 5);
  MatrixX room = MatrixX::Zero(n + 4, 3);
  room.topRows(n + 1) = right;
  const MatrixX exact = changed.partialPivLu().solve(right);
  CHECK((solved(window, unknowns, n, room).topRows(n + 1) - exact).norm() < 1e-12 * exact.norm());
  MatrixX seen = MatrixX::Zero(24, 2), forces = MatrixX::Zero(24, 2); // of slots done ahead, kept and new
  seen(2, 0) = seen(9, 0) = seen(20, 1) = seen(15, 1) = 1;
  forces(3, 0) = forces(10, 0) = forces(20, 1) = forces(17, 1) = 2;
  const MatrixX condensed = seen.transpose() * window.solve(forces);
  for (int time = 0; time < 2; ++time)
    CHECK((window.condense(seen, forces) - condensed).norm() < 1e-13 * condensed.norm());

  // 21 goes: nobody asks for it any more.
  std::vector<int> rest;
  for (int i = 0; i <= n; ++i)
    if (i != 21)
      rest.push_back(i);
  for (int i = 0; i <= n; ++i)
    if (changed(i, 21) != 0 && i != 21) {
      REQUIRE((i == n || (i >= 12 && i < 32)));
      changed(i, 21) = 0;
    }
  window.deactivate(9);
  window.factor();
  const MatrixX smaller = changed(rest, rest);
  const MatrixX wanted = smaller.partialPivLu().solve(right(rest, Eigen::all));
  CHECK((solved(window, unknowns, n, room)(rest, Eigen::all) - wanted).norm() < 1e-12 * wanted.norm());
}

TEST_CASE("A singular window, and a singular far part, are told", "[lu_window]") {
  MatrixX a = random_matrix(30, 7);
  LuWindow window(a.sparseView(), {10, 11, 12, 13}, 0, {});
  window.deactivate(1);
  window.activate(1); // and nothing in its row
  CHECK_THROWS_WITH(window.factor(), Catch::Contains("singular"));
  a.row(25).setZero();
  CHECK_THROWS_AS(LuWindow(a.sparseView(), {10, 11, 12, 13}, 0, {}), NumericalError);
}
