#include "solvers/schur_window.hpp"

#include "topology/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dtrsm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m, const int* n,
            const double* alpha, const double* a, const int* lda, double* b, const int* ldb);
void dtrmm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m, const int* n,
            const double* alpha, const double* a, const int* lda, double* b, const int* ldb);
}

namespace spherecut::solvers {

namespace {

/// B = L^-1 B or L^-T B for the leading dimension `lda` of L.
void triangular_solve(bool transposed, const double* lower, int lda, MatrixX& right) {
  const int rows = static_cast<int>(right.rows()), columns = static_cast<int>(right.cols());
  if (rows == 0 || columns == 0)
    return;
  const double one = 1;
  dtrsm_("L", "L", transposed ? "T" : "N", "N", &rows, &columns, &one, lower, &lda, right.data(), &rows);
}

/// B = L B or L^T B.
void triangular_product(bool transposed, const MatrixX& lower, MatrixX& right) {
  const int rows = static_cast<int>(right.rows()), columns = static_cast<int>(right.cols());
  if (rows == 0 || columns == 0)
    return;
  const double one = 1;
  dtrmm_("L", "L", transposed ? "T" : "N", "N", &rows, &columns, &one, lower.data(), &rows, right.data(), &rows);
}

} // namespace

SchurWindow::SchurWindow(const SparseMatrix& lower, int changing, int room, int contact)
    : far_(static_cast<int>(lower.rows()) - changing - contact), changing_(changing), room_(room), contact_(contact) {
  if (changing < 0 || room < 0 || contact < 0 || far_ < 0)
    throw InputError(fmt::format("a window of {} changing and {} contact unknowns with room for {} does not fit a "
                                 "system of {}",
                                 changing, contact, room, lower.rows()));
  cholesky_ = factor_ordered(lower);
  const int window = changing + contact;
  trailing_ = cholesky_->trailing(window);
  MatrixX product = trailing_.transpose();
  triangular_product(false, trailing_, product);
  const int slots = window + room;
  schur_ = MatrixX::Zero(slots, slots);
  active_.assign(slots, 0);
  for (int j = 0; j < window; ++j) {
    const int slot = slot_of(far_ + j);
    active_[slot] = 1;
    for (int i = j; i < window; ++i)
      schur_(slot_of(far_ + i), slot) = product(i, j);
  }
}

void SchurWindow::activate(int slot) {
  deactivate(slot);
  active_[slot] = 1;
}

void SchurWindow::deactivate(int slot) {
  active_[slot] = 0;
  schur_.col(slot).setZero();
  schur_.row(slot).setZero();
}

void SchurWindow::factor() {
  order_.clear();
  for (int slot = 0; slot < slots(); ++slot)
    if (active_[slot] != 0)
      order_.push_back(slot);
  contact_size_ = static_cast<int>(order_.end() - std::lower_bound(order_.begin(), order_.end(), contact_begin()));
  const int n = static_cast<int>(order_.size());
  factor_.resize(static_cast<std::size_t>(n) * n);
  // Runs of consecutive active slots are copied as they are.
  for (int j = 0; j < n; ++j) {
    const double* from = column(order_[j]);
    double* to = factor_.data() + static_cast<std::ptrdiff_t>(j) * n;
    for (int i = j; i < n;) {
      int end = i + 1;
      while (end < n && order_[end] == order_[end - 1] + 1)
        ++end;
      std::copy(from + order_[i], from + order_[end - 1] + 1, to + i);
      i = end;
    }
  }
  int info = 0;
  if (n > 0)
    dpotrf_("L", &n, factor_.data(), &n, &info);
  if (info != 0)
    throw NumericalError(fmt::format("the window of {} unknowns is not positive definite (slot {}): a piece that "
                                     "nothing holds, or an unsound support",
                                     n, info > 0 ? order_[info - 1] : info));
}

MatrixX SchurWindow::reduce(const MatrixX& right) const {
  MatrixX seen = cholesky_->forward(right).bottomRows(changing_ + contact_);
  triangular_product(false, trailing_, seen);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  by_slot.topRows(changing_) = seen.topRows(changing_);
  by_slot.bottomRows(contact_) = seen.bottomRows(contact_);
  return by_slot;
}

MatrixX SchurWindow::solve(const MatrixX& right) const {
  const int n = static_cast<int>(order_.size());
  MatrixX packed(n, right.cols());
  for (int i = 0; i < n; ++i)
    packed.row(i) = right.row(order_[i]);
  triangular_solve(false, factor_.data(), n, packed);
  triangular_solve(true, factor_.data(), n, packed);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  for (int i = 0; i < n; ++i)
    by_slot.row(order_[i]) = packed.row(i);
  return by_slot;
}

MatrixX SchurWindow::solve_contact(const MatrixX& right) const {
  const int n = static_cast<int>(order_.size()), first = n - contact_size_;
  MatrixX packed(contact_size_, right.cols());
  for (int i = 0; i < contact_size_; ++i)
    packed.row(i) = right.row(order_[first + i] - contact_begin());
  const double* corner = factor_.data() + static_cast<std::ptrdiff_t>(first) * n + first;
  triangular_solve(false, corner, n, packed);
  triangular_solve(true, corner, n, packed);
  MatrixX by_slot = MatrixX::Zero(contact_, right.cols());
  for (int i = 0; i < contact_size_; ++i)
    by_slot.row(order_[first + i] - contact_begin()) = packed.row(i);
  return by_slot;
}

MatrixX SchurWindow::recover(const MatrixX& window, const MatrixX& right) const {
  const int size = changing_ + contact_;
  MatrixX known(size, window.cols());
  known.topRows(changing_) = window.topRows(changing_);
  known.bottomRows(contact_) = window.bottomRows(contact_);
  MatrixX halfway = cholesky_->forward(right);
  triangular_product(true, trailing_, known);
  halfway.bottomRows(size) = known;
  return cholesky_->backward(halfway);
}

} // namespace spherecut::solvers
