#include "solvers/schur_window.hpp"

#include "solvers/dense_products.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dtrsm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m, const int* n,
            const double* alpha, const double* a, const int* lda, double* b, const int* ldb);
void dsyrk_(const char* uplo, const char* trans, const int* n, const int* k, const double* alpha, const double* a,
            const int* lda, const double* beta, double* c, const int* ldc);
void dgemm_(const char* transa, const char* transb, const int* m, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* b, const int* ldb, const double* beta, double* c,
            const int* ldc);
}

namespace spherecut::solvers {

namespace {

/// Of its diagonal entry: a smaller pivot is rounding. A severed piece leaves 1e-16, bodies that are held 1e-9 and
/// more.
constexpr double singular_pivot = 1e-13;

/// Dense Cholesky factor in place. Pivots are judged by the diagonal of the whole S, before anything was eliminated.
void cholesky(const std::vector<int>& slots, const MatrixX& schur, std::vector<double>& square) {
  const int n = static_cast<int>(slots.size());
  int info = 0;
  if (n > 0)
    dpotrf_("L", &n, square.data(), &n, &info);
  if (info != 0)
    throw NumericalError(fmt::format("the window of {} unknowns is not positive definite (slot {}): a piece that "
                                     "nothing holds, or an unsound support",
                                     n, info > 0 ? slots[info - 1] : info));
  for (Eigen::Index j = 0; j < n; ++j)
    if (const double pivot = square[static_cast<std::size_t>(j * n + j)];
        !(pivot * pivot > singular_pivot * schur(slots[j], slots[j])))
      throw NumericalError(fmt::format(
          "the window of {} unknowns is singular to rounding (slot {}): a piece that nothing holds", n, slots[j]));
}

/// Lower triangle of L L^T, by blocks of columns that leave out the zeros of L.
MatrixX lower_square(const MatrixX& lower) {
  constexpr int block = 128;
  const int n = static_cast<int>(lower.rows());
  MatrixX product = MatrixX::Zero(n, n);
  const double one = 1, none = 0;
  for (int first = 0; first < n; first += block) {
    const int width = std::min(block, n - first), rows = n - first, inner = first + width;
    dgemm_("N", "T", &rows, &width, &inner, &one, lower.data() + first, &n, lower.data() + first, &n, &none,
           product.data() + static_cast<std::ptrdiff_t>(first) * n + first, &n);
  }
  return product;
}

} // namespace

SchurWindow::SchurWindow(const SparseMatrix& lower, int changing, int room, int contact)
    : far_(static_cast<int>(lower.rows()) - changing - contact), changing_(changing), room_(room), contact_(contact) {
  if (changing < 0 || room < 0 || contact < 0 || far_ < 0)
    throw InputError(fmt::format("a window of {} changing and {} contact unknowns with room for {} does not fit a "
                                 "system of {}",
                                 changing, contact, room, lower.rows()));
  norm_ = one_norm(lower, true);
  cholesky_ = factor_ordered(lower);
  const int window = changing + contact;
  trailing_ = cholesky_->trailing(window);
  const MatrixX product = lower_square(trailing_);
  const int slots = window + room;
  schur_ = MatrixX::Zero(slots, slots);
  active_.assign(slots, 0);
  changed_.assign(slots, 0);
  for (int j = 0; j < window; ++j) {
    const int slot = slot_of(far_ + j);
    active_[slot] = 1;
    for (int i = j; i < window; ++i)
      schur_(slot_of(far_ + i), slot) = product(i, j);
  }
}

double SchurWindow::condition_estimate() const {
  return solvers::condition_estimate(*cholesky_, norm_, far_ + changing_ + contact_);
}

void SchurWindow::activate(const std::vector<int>& slots) {
  deactivate(slots);
  for (const int slot : slots) {
    active_[slot] = 1;
    // What is done ahead knows the slots that were free then, not one that has changed hands since.
    if (!ahead_.empty() && (kept_place_[slot] < 0 || active_ahead_[slot] != 0))
      ahead_.clear();
  }
}

void SchurWindow::deactivate(const std::vector<int>& slots) {
  for (const int slot : slots) {
    active_[slot] = 0;
    changed_[slot] = 1;
    schur_.col(slot).setZero();
  }
  // All rows column by column: one row alone would fetch every column for a single entry.
  for (Eigen::Index column = 0; column < schur_.cols(); ++column)
    if (active_[column] != 0)
      for (const int slot : slots)
        if (slot > column)
          schur_(slot, column) = 0;
}

/// The lower triangle of S of some slots (ascending), column-major; with `less_eliminated` less what is done ahead.
void SchurWindow::gather(const std::vector<int>& slots, bool less_eliminated, std::vector<double>& square) const {
  const auto n = std::ssize(slots);
  square.resize(static_cast<std::size_t>(n * n));
  // Runs of consecutive slots, which are consecutive among the kept ones as well.
  std::vector<std::ptrdiff_t> run_end(static_cast<std::size_t>(n));
  for (std::ptrdiff_t i = n; i-- > 0;)
    run_end[i] = i + 1 < n && slots[i + 1] == slots[i] + 1 ? run_end[i + 1] : i + 1;
  for (std::ptrdiff_t j = 0; j < n; ++j) {
    const double* from = schur_.data() + static_cast<std::ptrdiff_t>(slots[j]) * schur_.rows();
    const double* less = less_eliminated ? eliminated_.data() + kept_place_[slots[j]] * eliminated_.rows() : nullptr;
    double* to = square.data() + j * n;
    for (std::ptrdiff_t i = j; i < n; i = run_end[i]) {
      const std::ptrdiff_t length = run_end[i] - i;
      const Eigen::Map<const VectorX> part(from + slots[i], length);
      if (less != nullptr)
        Eigen::Map<VectorX>(to + i, length) = part - Eigen::Map<const VectorX>(less + kept_place_[slots[i]], length);
      else
        Eigen::Map<VectorX>(to + i, length) = part;
    }
  }
}

void SchurWindow::prepare(const std::vector<char>& kept) {
  ahead_.clear();
  seen_ahead_ = {};
  condensed_rest_.resize(0, 0);
  kept_.clear();
  kept_place_.assign(slots(), -1);
  active_ahead_ = active_;
  for (int slot = 0; slot < slots(); ++slot) {
    const bool free_room = active_[slot] == 0 && slot >= changing_;
    if (kept[slot] != 0 || free_room) {
      kept_place_[slot] = static_cast<int>(kept_.size());
      kept_.push_back(slot);
    } else if (active_[slot] != 0) {
      ahead_.push_back(slot);
    }
  }
  std::fill(changed_.begin(), changed_.end(), 0);
  gather(ahead_, false, ahead_factor_);
  try {
    cholesky(ahead_, schur_, ahead_factor_);
  } catch (...) {
    ahead_.clear();
    throw;
  }
  coupling_.resize(std::ssize(kept_), std::ssize(ahead_));
  for (Eigen::Index j = 0; j < coupling_.cols(); ++j)
    for (Eigen::Index i = 0; i < coupling_.rows(); ++i)
      coupling_(i, j) = kept_[i] > ahead_[j] ? schur_(kept_[i], ahead_[j]) : schur_(ahead_[j], kept_[i]);
  const int rows = static_cast<int>(kept_.size()), columns = static_cast<int>(ahead_.size());
  eliminated_ = MatrixX::Zero(rows, rows);
  if (rows > 0 && columns > 0) {
    const double one = 1, none = 0;
    dtrsm_("R", "L", "T", "N", &rows, &columns, &one, ahead_factor_.data(), &columns, coupling_.data(), &rows);
    dsyrk_("L", "N", &rows, &columns, &one, coupling_.data(), &rows, &none, eliminated_.data(), &rows);
  }
  factor();
}

bool SchurWindow::is_prepared() const {
  return !ahead_.empty() && std::all_of(ahead_.begin(), ahead_.end(), [&](int slot) { return changed_[slot] == 0; });
}

bool SchurWindow::factor() {
  const bool usable = is_prepared();
  if (!usable)
    ahead_.clear();
  std::fill(changed_.begin(), changed_.end(), 0);
  condensed_rest_.resize(0, 0);
  order_.clear();
  for (int slot = 0; slot < slots(); ++slot)
    if (active_[slot] != 0 && (!usable || kept_place_[slot] >= 0))
      order_.push_back(slot);
  gather(order_, usable, factor_);
  cholesky(order_, schur_, factor_);
  return usable;
}

MatrixX SchurWindow::reduce(const MatrixX& right, MatrixX* far) const {
  const MatrixX halfway = cholesky_->forward(right);
  if (far != nullptr)
    *far = halfway.topRows(far_);
  MatrixX seen = halfway.bottomRows(changing_ + contact_);
  triangular_product(false, trailing_, seen);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  by_slot.topRows(changing_) = seen.topRows(changing_);
  by_slot.bottomRows(contact_) = seen.bottomRows(contact_);
  return by_slot;
}

SchurWindow::Half SchurWindow::half(const MatrixX& right) const {
  Half result;
  auto& [ahead, rest] = result;
  ahead.resize(std::ssize(ahead_), right.cols());
  rest.resize(std::ssize(order_), right.cols());
  for (Eigen::Index i = 0; i < ahead.rows(); ++i)
    ahead.row(i) = right.row(ahead_[i]);
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    rest.row(i) = right.row(order_[i]);
  if (!ahead_.empty()) {
    triangular_solve(false, ahead_factor_.data(), static_cast<int>(ahead_.size()), ahead);
    MatrixX taken = MatrixX::Zero(coupling_.rows(), right.cols());
    add_product(1, coupling_, false, ahead, taken);
    for (Eigen::Index i = 0; i < rest.rows(); ++i)
      rest.row(i) -= taken.row(kept_place_[order_[i]]);
  }
  triangular_solve(false, factor_.data(), static_cast<int>(order_.size()), rest);
  return result;
}

MatrixX SchurWindow::product(const Half& one, const Half& other) {
  MatrixX result = MatrixX::Zero(one.rest.cols(), other.rest.cols());
  add_product(1, one.ahead, true, other.ahead, result);
  add_product(1, one.rest, true, other.rest, result);
  return result;
}

MatrixX SchurWindow::seen_by_condensed(const Half& right) const {
  MatrixX result = MatrixX::Zero(condensed_rest_.cols(), right.rest.cols());
  if (!ahead_.empty())
    add_product(1, seen_ahead_.halfway.leftCols(result.rows()), true, right.ahead, result);
  add_product(1, condensed_rest_, true, right.rest.bottomRows(condensed_rest_.rows()), result);
  return result;
}

MatrixX SchurWindow::solve(const MatrixX& right) const {
  auto [ahead, rest] = half(right);
  triangular_solve(true, factor_.data(), static_cast<int>(order_.size()), rest);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    by_slot.row(order_[i]) = rest.row(i);
  if (ahead_.empty())
    return by_slot;
  MatrixX below = MatrixX::Zero(std::ssize(kept_), right.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    below.row(kept_place_[order_[i]]) = rest.row(i);
  add_product(-1, coupling_, true, below, ahead);
  triangular_solve(true, ahead_factor_.data(), static_cast<int>(ahead_.size()), ahead);
  for (Eigen::Index i = 0; i < ahead.rows(); ++i)
    by_slot.row(ahead_[i]) = ahead.row(i);
  return by_slot;
}

void SchurWindow::see_ahead(const MatrixX& functionals, const VectorX& right) {
  const auto rows = std::ssize(ahead_);
  const Eigen::Index count = functionals.cols() + 1;
  MatrixX there(rows, count);
  for (Eigen::Index i = 0; i < rows; ++i) {
    there.row(i).head(count - 1) = functionals.row(ahead_[i]);
    there(i, count - 1) = right[ahead_[i]];
  }
  SeenAhead& seen = seen_ahead_;
  if (seen.there.rows() != rows || seen.there.cols() != count) {
    seen.there = MatrixX::Zero(rows, count);
    seen.halfway = seen.there;
    seen.taken = MatrixX::Zero(coupling_.rows(), count);
    seen.products = MatrixX::Zero(count, count);
  }
  std::vector<Eigen::Index> fresh;
  for (Eigen::Index c = 0; c < count; ++c)
    if (seen.there.col(c) != there.col(c))
      fresh.push_back(c);
  if (fresh.empty())
    return;
  MatrixX halfway(rows, std::ssize(fresh)), taken = MatrixX::Zero(coupling_.rows(), std::ssize(fresh));
  for (Eigen::Index k = 0; k < halfway.cols(); ++k)
    halfway.col(k) = there.col(fresh[k]);
  triangular_solve(false, ahead_factor_.data(), static_cast<int>(rows), halfway);
  add_product(1, coupling_, false, halfway, taken);
  for (Eigen::Index k = 0; k < halfway.cols(); ++k) {
    seen.halfway.col(fresh[k]) = halfway.col(k);
    seen.taken.col(fresh[k]) = taken.col(k);
  }
  seen.products = gram(seen.halfway);
  seen.there = std::move(there);
}

SchurWindow::Condensed SchurWindow::condense(const MatrixX& functionals, const VectorX& right) {
  // With Y = L^-1 F: F^T S^-1 F = Y^T Y and F^T S^-1 b = Y^T (L^-1 b). Above its first entry F leaves Y zero.
  const Eigen::Index count = functionals.cols();
  MatrixX seen(std::ssize(order_), count), load(std::ssize(order_), 1);
  for (Eigen::Index i = 0; i < seen.rows(); ++i) {
    seen.row(i) = functionals.row(order_[i]);
    load(i, 0) = right[order_[i]];
  }
  Condensed condensed{MatrixX::Zero(count, count), VectorX::Zero(count)};
  if (!ahead_.empty()) {
    see_ahead(functionals, right);
    for (Eigen::Index i = 0; i < seen.rows(); ++i) {
      const auto taken = seen_ahead_.taken.row(kept_place_[order_[i]]);
      seen.row(i) -= taken.head(count);
      load(i, 0) -= taken[count];
    }
    condensed.compliance = seen_ahead_.products.topLeftCorner(count, count);
    condensed.response = seen_ahead_.products.col(count).head(count);
  }
  Eigen::Index first = 0;
  while (first < seen.rows() && seen.row(first).isZero(0))
    ++first;
  MatrixX& rest = condensed_rest_;
  rest = seen.bottomRows(seen.rows() - first);
  const int n = static_cast<int>(order_.size());
  if (!load.isZero(0)) // a body that nothing but the tool loads
    triangular_solve(false, factor_.data(), n, load);
  if (rest.rows() > 0)
    triangular_solve(false, factor_.data() + first * n + first, n, rest);
  condensed.compliance += gram(rest);
  condensed.response += rest.transpose() * load.bottomRows(rest.rows());
  return condensed;
}

MatrixX SchurWindow::recover(const MatrixX& window, const MatrixX& right) const {
  return recover_from(cholesky_->forward(right), window);
}

MatrixX SchurWindow::recover_from_half(const MatrixX& window, const MatrixX& far) const {
  MatrixX halfway(far_ + changing_ + contact_, window.cols());
  halfway.topRows(far_) = far;
  return recover_from(std::move(halfway), window);
}

MatrixX SchurWindow::recover_from(MatrixX halfway, const MatrixX& window) const {
  const int size = changing_ + contact_;
  MatrixX known(size, window.cols());
  known.topRows(changing_) = window.topRows(changing_);
  known.bottomRows(contact_) = window.bottomRows(contact_);
  triangular_product(true, trailing_, known);
  halfway.bottomRows(size) = known;
  return cholesky_->backward(halfway);
}

} // namespace spherecut::solvers
