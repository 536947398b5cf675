#include "solvers/algebra/schur_window.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <map>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// Springs between random neighbours on a line plus a weak foundation: sparse, positive definite.
MatrixX spring_matrix(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  MatrixX k = 0.1 * MatrixX::Identity(n, n);
  for (int i = 0; i < n; ++i)
    for (int step : {1, 2, 7})
      if (i + step < n) {
        const double stiffness = uniform(random);
        k(i, i) += stiffness;
        k(i + step, i + step) += stiffness;
        k(i, i + step) -= stiffness;
        k(i + step, i) -= stiffness;
      }
  return k;
}

SparseMatrix lower_of(const MatrixX& k) {
  return MatrixX(k.triangularView<Eigen::Lower>()).sparseView();
}

VectorX random_vector(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return VectorX::NullaryExpr(n, [&] { return normal(random); });
}

} // namespace

TEST_CASE("A window solves the system it was taken from", "[schur_window]") {
  const int n = 90, changing = 20, contact = 12;
  const MatrixX k = spring_matrix(n, 1);
  SchurWindow window(lower_of(k), changing, 6, contact);
  window.factor();
  const MatrixX right = random_vector(n, 2);
  const MatrixX exact = k.llt().solve(right);
  const MatrixX found = window.recover(window.solve(window.reduce(right)), right);
  CHECK((found - exact).norm() < 1e-12 * exact.norm());
  CHECK(window.far() == n - changing - contact);
  CHECK(window.slot_of(n - 1) == window.slots() - 1);
  CHECK(window.slot_of(0) == -1);
}

TEST_CASE("Changed, added and removed unknowns give what a system built from scratch gives", "[schur_window]") {
  const int n = 90, changing = 20, room = 5, contact = 12, far = n - changing - contact;
  const MatrixX k = spring_matrix(n, 3);
  SchurWindow window(lower_of(k), changing, room, contact);
  // What will not change is eliminated ahead, in one or two stages; or too much is, by the first or by the second, and
  // the window has to start over from there, which another stage may do after the change.
  enum Ahead { nothing, one_stage, too_much, two_stages, too_much_in_second, second_anew };
  const Ahead ahead = GENERATE(nothing, one_stage, too_much, two_stages, too_much_in_second, second_anew);
  std::vector<char> kept(window.slots(), 0);
  for (int unknown : {1, 3, 4, 8, 9, 10, 11, 12, 17})
    kept.at(window.slot_of(far + unknown)) = 1;
  kept[window.slot_of(n - 1)] = 1; // of the contact; the others see what is done ahead
  std::vector<char> more = kept;
  for (const int unknown : {5, 13, n - 2 - far})
    more.at(window.slot_of(far + unknown)) = 1;
  std::vector<char> less = kept;
  less.at(window.slot_of(far + 9)) = 0;
  if (ahead == one_stage)
    window.prepare({kept});
  else if (ahead == too_much)
    window.prepare({less});
  else if (ahead != nothing)
    window.prepare({more, ahead == two_stages ? kept : less});
  // What some functionals see of it before the change is known: some of it stays, of another only the load does.
  MatrixX early = MatrixX::Zero(window.slots(), 3);
  if (ahead != nothing) {
    for (int slot = window.contact_begin(); slot < window.slots(); ++slot)
      for (int c = 0; c < 3; ++c)
        early(slot, c) = std::sin(1.0 + slot * (c + 1));
    early(window.slot_of(far + 2), 1) = 0.3; // done ahead
    static_cast<void>(window.condense(early.sparseView(), VectorX::Ones(window.slots())));
  }
  // From scratch: unknown `gone` leaves with its springs, two new ones come, coupled to each other and the window.
  MatrixX larger = MatrixX::Zero(n + 2, n + 2);
  larger.topLeftCorner(n, n) = k;
  const auto spring = [&](int a, int b, double stiffness) {
    for (const auto& [i, j, s] :
         {std::tuple{a, a, 1.0}, std::tuple{b, b, 1.0}, std::tuple{a, b, -1.0}, std::tuple{b, a, -1.0}})
      larger(i, j) += s * stiffness;
    const auto slot = [&](int i) { return i < n ? window.slot_of(i) : changing + i - n; };
    const int low = std::min(slot(a), slot(b)), high = std::max(slot(a), slot(b));
    window.column(low)[low] += stiffness;
    window.column(high)[high] += stiffness;
    window.column(low)[high] -= stiffness;
  };
  window.activate({changing, changing + 1});
  spring(n, far + 4, 0.7);
  spring(n, n + 1, 0.4);
  spring(n + 1, n - 1, 0.9); // a contact unknown
  spring(far + 1, far + 9, 2.0);
  const int gone = far + 10; // beyond the reach of springs into the far part
  for (int other = far; other < n; ++other)
    if (other != gone && larger(other, gone) != 0)
      spring(other, gone, larger(other, gone));
  window.deactivate({window.slot_of(gone)});
  larger.row(gone).setZero();
  larger.col(gone).setZero();
  larger(gone, gone) = 1;
  CHECK(window.factor() == (ahead == one_stage || ahead == two_stages));
  CHECK(window.stages() == std::map<Ahead, int>{{nothing, 0},
                                                {one_stage, 1},
                                                {too_much, 0},
                                                {two_stages, 2},
                                                {too_much_in_second, 1},
                                                {second_anew, 1}}[ahead]);
  if (ahead == second_anew) {
    const int before = window.done_ahead();
    kept[changing + 1] = 1; // what has come stays; of it the other goes
    window.prepare({kept});
    CHECK(window.stages() == 2);
    CHECK(window.done_ahead() == before + 4);
    CHECK_FALSE(window.is_kept(changing));
    CHECK(window.is_kept(changing + 1));
  }
  CHECK(window.factored() + window.done_ahead() == changing - 1 + 2 + contact);

  VectorX right = random_vector(n + 2, 4);
  right[gone] = 0;
  const VectorX exact = larger.llt().solve(right);
  MatrixX seen = window.reduce(right.head(n));
  seen(changing, 0) = right[n];
  seen(changing + 1, 0) = right[n + 1];
  seen(window.slot_of(gone), 0) = 0;
  const MatrixX by_slot = window.solve(seen);
  const MatrixX found = window.recover(by_slot, right.head(n));
  CHECK((found.col(0) - exact.head(n)).norm() < 1e-11 * exact.norm());
  CHECK(by_slot(changing, 0) == Approx(exact[n]));
  CHECK(by_slot(changing + 1, 0) == Approx(exact[n + 1]));

  const MatrixX inverse = larger.inverse();
  for (const int from : {window.contact_begin(), changing + 1, 0}) { // where the functionals begin
    MatrixX functionals = MatrixX::Zero(window.slots(), 3);
    std::vector<int> unknown_of(window.slots(), -1);
    for (int i = far; i < n; ++i)
      if (i != gone)
        unknown_of[window.slot_of(i)] = i;
    unknown_of[changing] = n;
    unknown_of[changing + 1] = n + 1;
    MatrixX by_unknown = MatrixX::Zero(n + 2, 3);
    for (int slot = from; slot < window.slots(); ++slot)
      if (unknown_of[slot] >= 0)
        for (int c = 0; c < 3; ++c)
          functionals(slot, c) = by_unknown(unknown_of[slot], c) = std::sin(1.0 + slot * (c + 1));
    const SchurWindow::Condensed condensed = window.condense(functionals.sparseView(), seen.col(0));
    const MatrixX compliance = by_unknown.transpose() * inverse * by_unknown;
    CHECK((condensed.compliance - compliance).norm() < 1e-11 * compliance.norm());
    CHECK((condensed.response - by_unknown.transpose() * exact).norm() < 1e-11 * (by_unknown.norm() * exact.norm()));
    const SchurWindow::Half of_functionals = window.half(functionals);
    CHECK((SchurWindow::product(of_functionals, of_functionals) - compliance).norm() < 1e-11 * compliance.norm());
    CHECK((window.seen_by_condensed(of_functionals.left_columns(2)) - compliance.leftCols(2)).norm() <
          1e-11 * compliance.norm());
    // What the functionals see of the part done ahead is kept; another right-hand side and half of them ask anew.
    CHECK(window.condense(functionals.sparseView(), seen.col(0)).compliance == condensed.compliance);
    const SchurWindow::Condensed halved = window.condense((0.5 * functionals).sparseView(), 2 * seen.col(0));
    CHECK((halved.compliance - 0.25 * condensed.compliance).norm() < 1e-13 * condensed.compliance.norm());
    CHECK((halved.response - condensed.response).norm() < 1e-12 * condensed.response.norm());
  }
}

TEST_CASE("A window without hold is said, not solved", "[schur_window]") {
  const int n = 40;
  SchurWindow window(lower_of(spring_matrix(n, 5)), 10, 2, 4);
  window.activate({10}); // a new unknown that nothing holds
  CHECK_THROWS_AS(window.factor(), NumericalError);
  CHECK_THROWS_AS(SchurWindow(lower_of(spring_matrix(n, 5)), 30, 0, 20), InputError);
}
