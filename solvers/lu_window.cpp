#include "solvers/lu_window.hpp"

#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

extern "C" {
void dgetrf_(const int* m, const int* n, double* a, const int* lda, int* pivots, int* info);
void dgetrs_(const char* trans, const int* n, const int* columns, const double* a, const int* lda, const int* pivots,
             double* b, const int* ldb, int* info);
}

namespace spherecut::solvers {

namespace {

/// Of the largest entry of the pivot's column: a smaller pivot is rounding.
constexpr double singular_pivot = 1e-13;

/// The whole of A, as long as nothing has changed, for the estimate of its condition.
class Whole final : public Factorisation {
 public:
  Whole(const LuWindow& window, const std::vector<int>& unknowns) : window_(window), unknowns_(unknowns) {}
  MatrixX solve(const MatrixX& right) const override { return solved(right, false); }
  MatrixX solve_transposed(const MatrixX& right) const override { return solved(right, true); }
  long nonzeros() const override { return window_.factor_nonzeros(); }

 private:
  [[nodiscard]] MatrixX solved(const MatrixX& right, bool transposed) const {
    MatrixX reduced = window_.reduce(right, transposed);
    for (Eigen::Index s = 0; s < std::ssize(unknowns_); ++s)
      reduced.row(s) += right.row(unknowns_[s]);
    const MatrixX in_window = window_.solve(reduced, transposed);
    MatrixX solution = window_.recover(in_window, right, transposed);
    for (Eigen::Index s = 0; s < std::ssize(unknowns_); ++s)
      solution.row(unknowns_[s]) = in_window.row(s);
    return solution;
  }
  const LuWindow& window_;
  const std::vector<int>& unknowns_;
};

} // namespace

LuWindow::LuWindow(const SparseMatrix& matrix, std::vector<int> window, int room, const std::vector<int>& ordering)
    : window_(std::move(window)), norm_(one_norm(matrix)) {
  const auto count = std::ssize(window_);
  std::vector<int> slot(static_cast<std::size_t>(matrix.rows()), -1);
  for (Eigen::Index s = 0; s < count; ++s)
    slot[window_[s]] = static_cast<int>(s);
  std::vector<Eigen::Triplet<double>> to_far, from_far;
  for (int column = 0; column < matrix.outerSize(); ++column)
    for (SparseMatrix::InnerIterator entry(matrix, column); entry; ++entry) {
      const auto row = static_cast<int>(entry.row());
      if (entry.value() == 0 || (slot[row] >= 0) == (slot[column] >= 0))
        continue;
      if (slot[row] >= 0)
        to_far.emplace_back(slot[row], column, entry.value());
      else
        from_far.emplace_back(row, slot[column], entry.value());
    }
  to_far_.resize(count, matrix.cols());
  to_far_.setFromTriplets(to_far.begin(), to_far.end());
  from_far_.resize(matrix.rows(), count);
  from_far_.setFromTriplets(from_far.begin(), from_far.end());
  far_ = factor_partly(matrix, window_, ordering);
  schur_ = MatrixX::Zero(count + room, count + room);
  schur_.topLeftCorner(count, count) = far_->take_complement();
  active_.assign(static_cast<std::size_t>(count) + room, 0);
  std::fill_n(active_.begin(), count, 1);
}

double LuWindow::condition_estimate() const {
  return solvers::condition_estimate(Whole(*this, window_), norm_, static_cast<int>(from_far_.rows()));
}

void LuWindow::activate(int slot) {
  deactivate(slot);
  active_[slot] = 1;
}

void LuWindow::deactivate(int slot) {
  active_[slot] = 0;
  schur_.col(slot).setZero();
  schur_.row(slot).setZero();
}

void LuWindow::factor() {
  order_.clear();
  for (int slot = 0; slot < slots(); ++slot)
    if (active_[slot] != 0)
      order_.push_back(slot);
  const int n = static_cast<int>(order_.size());
  factor_.resize(n, n);
  VectorX largest(n);
  for (int j = 0; j < n; ++j) {
    const double* from = schur_.data() + static_cast<std::ptrdiff_t>(order_[j]) * schur_.rows();
    double* to = factor_.data() + static_cast<std::ptrdiff_t>(j) * n;
    for (int i = 0; i < n; ++i)
      to[i] = from[order_[i]];
    largest[j] = factor_.col(j).lpNorm<Eigen::Infinity>();
  }
  pivots_.resize(order_.size());
  int info = 0;
  if (n > 0)
    dgetrf_(&n, &n, factor_.data(), &n, pivots_.data(), &info);
  for (int j = 0; j < n; ++j)
    if (const double pivot = std::abs(factor_(j, j)); !(pivot > singular_pivot * largest[j]))
      throw NumericalError(fmt::format("the window of {} unknowns is singular to rounding (slot {}, pivot {:.1e} of "
                                       "{:.1e}): a piece that nothing holds, or an unsound support",
                                       n, order_[j], pivot, largest[j]));
}

MatrixX LuWindow::reduce(const MatrixX& right, bool transposed) const {
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  const MatrixX far = far_->solve_eliminated(right, transposed);
  if (transposed)
    by_slot.topRows(std::ssize(window_)) = -(from_far_.transpose() * far);
  else
    by_slot.topRows(std::ssize(window_)) = -(to_far_ * far);
  return by_slot;
}

MatrixX LuWindow::solve(const MatrixX& right, bool transposed) const {
  const int n = static_cast<int>(order_.size()), columns = static_cast<int>(right.cols());
  MatrixX x(n, columns);
  for (int i = 0; i < n; ++i)
    x.row(i) = right.row(order_[i]);
  int info = 0;
  if (n > 0 && columns > 0)
    dgetrs_(transposed ? "T" : "N", &n, &columns, factor_.data(), &n, pivots_.data(), x.data(), &n, &info);
  MatrixX by_slot = MatrixX::Zero(slots(), columns);
  for (int i = 0; i < n; ++i)
    by_slot.row(order_[i]) = x.row(i);
  return by_slot;
}

MatrixX LuWindow::recover(const MatrixX& window, const MatrixX& right, bool transposed) const {
  const auto known = window.topRows(std::ssize(window_));
  const MatrixX seen = transposed ? MatrixX(to_far_.transpose() * known) : MatrixX(from_far_ * known);
  return far_->solve_eliminated(right - seen, transposed);
}

} // namespace spherecut::solvers
