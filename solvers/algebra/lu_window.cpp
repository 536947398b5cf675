#include "solvers/algebra/lu_window.hpp"

#include "solvers/algebra/blas.inl"
#include "solvers/algebra/dense_products.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

/// Of the largest entry of the pivot's row: a smaller pivot is rounding.
constexpr double rounding_pivot = 1e-13;

constexpr int rows_at_once = 4; // of a node, which have the same columns: what they read is read once
constexpr int chunk = 512;      // columns of them at once, which stay in the first cache

/// Adds to `rows_at_once` rows of length n (one after the other in `rows`) the products of their coefficients with the
/// rows of x, of leading dimension `ldx`, at `places`; for the vector widths of the machine.
__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
add_rows(int n, int count, const int* places, const double* coefficients, const double* x, std::ptrdiff_t ldx,
         double* rows) {
  for (int first = 0; first < n; first += chunk) {
    const int width = n - first < chunk ? n - first : chunk;
    double* const a = rows + first;
    double* const b = a + n;
    double* const c = b + n;
    double* const d = c + n;
    for (int k = 0; k < count; ++k) {
      const double* const from = x + places[k] * ldx + first;
      const double* const by = coefficients + static_cast<std::ptrdiff_t>(rows_at_once) * k;
      const double by_a = by[0], by_b = by[1], by_c = by[2], by_d = by[3];
      for (int i = 0; i < width; ++i) {
        const double value = from[i];
        a[i] += by_a * value;
        b[i] += by_b * value;
        c[i] += by_c * value;
        d[i] += by_d * value;
      }
    }
  }
}

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
  schur_ = RowMatrix::Zero(count + room, count + room);
  schur_.topLeftCorner(count, count) = far_->take_complement();
  active_.assign(static_cast<std::size_t>(count) + room, 0);
  changed_ = active_;
  std::fill_n(active_.begin(), count, 1);
}

double LuWindow::condition_estimate() const {
  return solvers::condition_estimate(Whole(*this, window_), norm_, static_cast<int>(from_far_.rows()));
}

void LuWindow::activate(int slot) {
  deactivate(slot);
  active_[slot] = 1;
  // What is done ahead knows the slots that were free then, not one that has changed hands since.
  if (!ahead_.slots.empty() && (kept_place_[slot] < 0 || active_ahead_[slot] != 0))
    ahead_.slots.clear();
}

void LuWindow::deactivate(int slot) {
  active_[slot] = 0;
  changed_[slot] = 1;
  schur_.row(slot).setZero();
  schur_.col(slot).setZero();
}

/// Transposed as LAPACK sees it. `scale`: largest entry of every row.
void LuWindow::gather(Part& part, VectorX& scale) const {
  const auto n = std::ssize(part.slots);
  part.factor.resize(n, n);
  scale.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double* from = schur_.data() + static_cast<std::ptrdiff_t>(part.slots[i]) * schur_.cols();
    double* to = part.factor.data() + i * n;
    for (Eigen::Index j = 0; j < n; ++j)
      to[j] = from[part.slots[j]];
    scale[i] = part.factor.col(i).lpNorm<Eigen::Infinity>();
  }
}

void LuWindow::Part::factorise(const VectorX& scale) {
  const int n = static_cast<int>(slots.size());
  pivots.resize(slots.size());
  int info = 0;
  if (n > 0)
    dgetrf_(&n, &n, factor.data(), &n, pivots.data(), &info);
  for (int j = 0; j < n; ++j)
    if (const double pivot = std::abs(factor(j, j)); !(pivot > rounding_pivot * scale[j]))
      throw NumericalError(fmt::format("the window of {} unknowns is singular to rounding (slot {}, pivot {:.1e} of "
                                       "{:.1e}): a piece that nothing holds, or an unsound support",
                                       n, slots[j], pivot, scale[j]));
}

void LuWindow::Part::solve(MatrixX& x, bool transposed) const {
  const int n = static_cast<int>(slots.size()), columns = static_cast<int>(x.cols());
  int info = 0;
  if (n > 0 && columns > 0)
    dgetrs_(transposed ? "N" : "T", &n, &columns, factor.data(), &n, pivots.data(), x.data(), &n, &info);
}

void LuWindow::prepare(const std::vector<char>& kept) {
  ahead_.slots.clear();
  seen_ = {};
  kept_.clear();
  kept_place_.assign(static_cast<std::size_t>(slots()), -1);
  ahead_place_ = kept_place_;
  active_ahead_ = active_;
  for (int slot = 0; slot < slots(); ++slot) {
    const bool free_room = active_[slot] == 0 && slot >= std::ssize(window_);
    if ((kept[slot] != 0 && !leads_far(slot)) || free_room) {
      kept_place_[slot] = static_cast<int>(kept_.size());
      kept_.push_back(slot);
    } else if (active_[slot] != 0) {
      ahead_place_[slot] = static_cast<int>(ahead_.slots.size());
      ahead_.slots.push_back(slot);
    }
  }
  std::fill(changed_.begin(), changed_.end(), 0);
  VectorX scale;
  gather(ahead_, scale);
  try {
    ahead_.factorise(scale);
  } catch (...) {
    ahead_.slots.clear();
    throw;
  }
  MatrixX x(std::ssize(ahead_.slots), std::ssize(kept_));
  for (Eigen::Index i = 0; i < x.rows(); ++i)
    for (Eigen::Index j = 0; j < x.cols(); ++j)
      x(i, j) = schur_(ahead_.slots[i], kept_[j]);
  ahead_.solve(x, false);
  beside_ = x.transpose();
  kept_rows_.assign(kept_.size(), {});
  taken_ = MatrixX::Zero(std::ssize(kept_), std::ssize(kept_));
  std::vector<int> all;
  for (int place = 0; place < std::ssize(kept_); ++place)
    if (active_[kept_[place]] != 0)
      all.push_back(place);
  take_from_kept(all);
  factor();
}

bool LuWindow::is_prepared() const {
  return !ahead_.slots.empty() &&
         std::all_of(ahead_.slots.begin(), ahead_.slots.end(), [&](int slot) { return changed_[slot] == 0; });
}

/// Rows of S_KA and of S_KA X at places in kept_.
void LuWindow::take_from_kept(const std::vector<int>& places) {
  const int n = static_cast<int>(kept_.size());
  std::vector<double> rows(static_cast<std::size_t>(rows_at_once) * n), coefficients;
  std::vector<int> columns;
  for (std::size_t first = 0; first < places.size(); first += rows_at_once) {
    const std::size_t count = std::min<std::size_t>(rows_at_once, places.size() - first);
    columns.clear();
    coefficients.clear();
    for (std::size_t r = 0; r < count; ++r)
      kept_rows_[places[first + r]] = {};
    for (const int slot : ahead_.slots) {
      std::array<double, rows_at_once> entries{};
      bool any = false;
      for (std::size_t r = 0; r < count; ++r) {
        entries[r] = schur_(kept_[places[first + r]], slot);
        any = any || entries[r] != 0;
        if (entries[r] != 0) {
          kept_rows_[places[first + r]].places.push_back(ahead_place_[slot]);
          kept_rows_[places[first + r]].values.push_back(entries[r]);
        }
      }
      if (!any)
        continue;
      columns.push_back(ahead_place_[slot]);
      coefficients.insert(coefficients.end(), entries.begin(), entries.end());
    }
    std::fill(rows.begin(), rows.end(), 0.0);
    add_rows(n, static_cast<int>(columns.size()), columns.data(), coefficients.data(), beside_.data(), beside_.rows(),
             rows.data());
    for (std::size_t r = 0; r < count; ++r)
      std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(r) * n, n,
                  taken_.data() + static_cast<std::ptrdiff_t>(places[first + r]) * n);
  }
}

void LuWindow::factor() {
  const bool usable = is_prepared();
  if (!usable)
    ahead_.slots.clear();
  rest_.slots.clear();
  std::vector<int> again;
  for (int slot = 0; slot < slots(); ++slot) {
    const int place = usable ? kept_place_[slot] : -1;
    if (active_[slot] == 0 || (usable && place < 0))
      continue;
    rest_.slots.push_back(slot);
    if (usable && changed_[slot] != 0)
      again.push_back(place);
  }
  std::fill(changed_.begin(), changed_.end(), 0);
  VectorX scale;
  gather(rest_, scale);
  if (usable) {
    take_from_kept(again);
    for (Eigen::Index i = 0; i < rest_.factor.cols(); ++i) {
      const double* less = taken_.data() + kept_place_[rest_.slots[i]] * taken_.rows();
      for (Eigen::Index j = 0; j < rest_.factor.rows(); ++j)
        rest_.factor(j, i) -= less[kept_place_[rest_.slots[j]]];
    }
  }
  rest_.factorise(scale);
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

MatrixX LuWindow::rows_of(const std::vector<int>& slots, const MatrixX& right) const {
  MatrixX rows(std::ssize(slots), right.cols());
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = right.row(slots[i]);
  return rows;
}

void LuWindow::subtract_ahead(const MatrixX& y, MatrixX& rest) const {
  const RowMatrix by_row = y;
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    const SparseRow& row = kept_rows_[kept_place_[rest_.slots[i]]];
    for (std::size_t k = 0; k < row.places.size(); ++k)
      rest.row(i) -= row.values[k] * by_row.row(row.places[k]);
  }
}

MatrixX LuWindow::by_kept(const MatrixX& rest) const {
  MatrixX kept = MatrixX::Zero(std::ssize(kept_), rest.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    kept.row(kept_place_[rest_.slots[i]]) = rest.row(i);
  return kept;
}

MatrixX LuWindow::solve(const MatrixX& right, bool transposed) const {
  MatrixX rest = rows_of(rest_.slots, right), ahead = rows_of(ahead_.slots, right);
  if (!ahead.isZero(0)) {
    ahead_.solve(ahead, false);
    subtract_ahead(ahead, rest);
  }
  rest_.solve(rest, transposed);
  if (!ahead_.slots.empty())
    add_product(-1, beside_, true, by_kept(rest), ahead);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    by_slot.row(rest_.slots[i]) = rest.row(i);
  for (Eigen::Index i = 0; i < ahead.rows(); ++i)
    by_slot.row(ahead_.slots[i]) = ahead.row(i);
  return by_slot;
}

MatrixX LuWindow::condense(const MatrixX& functionals, const MatrixX& right) {
  MatrixX rest = rows_of(rest_.slots, right);
  const MatrixX seen_rest = rows_of(rest_.slots, functionals);
  if (ahead_.slots.empty()) {
    rest_.solve(rest, false);
    return seen_rest.transpose() * rest;
  }
  const MatrixX seen = rows_of(ahead_.slots, functionals), forces = rows_of(ahead_.slots, right);
  const auto same = [](const MatrixX& a, const MatrixX& b) {
    return a.rows() == b.rows() && a.cols() == b.cols() && a == b;
  };
  if (!same(seen_.functionals, seen) || !same(seen_.right, forces)) {
    seen_.functionals = seen;
    seen_.right = forces;
    seen_.solved = forces;
    ahead_.solve(seen_.solved, false);
    seen_.response = seen.transpose() * seen_.solved;
    seen_.beside = (beside_ * seen).transpose();
  }
  subtract_ahead(seen_.solved, rest);
  rest_.solve(rest, false);
  return seen_.response + seen_rest.transpose() * rest - seen_.beside * by_kept(rest);
}

MatrixX LuWindow::recover(const MatrixX& window, const MatrixX& right, bool transposed) const {
  const auto known = window.topRows(std::ssize(window_));
  const MatrixX seen = transposed ? MatrixX(to_far_.transpose() * known) : MatrixX(from_far_ * known);
  return far_->solve_eliminated(right - seen, transposed);
}

} // namespace spherecut::solvers
