#include "solvers/algebra/schur_window.hpp"

#include "solvers/algebra/blas.inl"
#include "solvers/algebra/dense_products.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

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
    stages_.erase(
        std::find_if(stages_.begin(), stages_.end(), [&](const Stage& stage) { return stage.place[slot] != free; }),
        stages_.end());
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

/// The lower triangle of S of some slots (ascending), column-major, less what is done ahead.
void SchurWindow::gather(const std::vector<int>& slots, std::vector<double>& square) const {
  const auto n = std::ssize(slots);
  square.resize(static_cast<std::size_t>(n * n));
  const Stage* const last = stages_.empty() ? nullptr : &stages_.back();
  const auto place = [&](std::ptrdiff_t i) { return last != nullptr ? last->place[slots[i]] : free; };
  // Runs of slots that are consecutive among the kept ones as well.
  std::vector<std::ptrdiff_t> run_end(static_cast<std::size_t>(n));
  for (std::ptrdiff_t i = n; i-- > 0;) {
    const bool goes_on = i + 1 < n && slots[i + 1] == slots[i] + 1 &&
                         (place(i) == free ? place(i + 1) == free : place(i + 1) == place(i) + 1);
    run_end[i] = goes_on ? run_end[i + 1] : i + 1;
  }
  for (std::ptrdiff_t j = 0; j < n; ++j) {
    const double* from = schur_.data() + static_cast<std::ptrdiff_t>(slots[j]) * schur_.rows();
    const double* less = place(j) != free ? last->taken_off.data() + place(j) * last->taken_off.rows() : nullptr;
    double* to = square.data() + j * n;
    for (std::ptrdiff_t i = j; i < n; i = run_end[i]) {
      const std::ptrdiff_t length = run_end[i] - i;
      const Eigen::Map<const VectorX> part(from + slots[i], length);
      if (less != nullptr && place(i) != free)
        Eigen::Map<VectorX>(to + i, length) = part - Eigen::Map<const VectorX>(less + place(i), length);
      else
        Eigen::Map<VectorX>(to + i, length) = part;
    }
  }
}

void SchurWindow::prepare(const std::vector<std::vector<char>>& kept) {
  keep_sound_stages();
  std::fill(changed_.begin(), changed_.end(), 0);
  try {
    for (const std::vector<char>& set : kept)
      add_stage(set);
    factor();
  } catch (...) {
    stages_.clear();
    order_.clear();
    condensed_rest_.resize(0, 0);
    throw;
  }
}

void SchurWindow::add_stage(const std::vector<char>& kept) {
  const auto eliminates_kept = [&](const Stage& stage) {
    return std::any_of(stage.ahead.begin(), stage.ahead.end(), [&](int slot) { return kept[slot] != 0; });
  };
  stages_.erase(std::find_if(stages_.begin(), stages_.end(), eliminates_kept), stages_.end());
  const Stage* const last = stages_.empty() ? nullptr : &stages_.back();
  Stage stage;
  stage.place.assign(slots(), eliminated);
  stage.ahead_place.assign(slots(), -1);
  for (int slot = 0; slot < slots(); ++slot) {
    if (!is_kept(slot))
      continue;
    if (active_[slot] == 0) {
      stage.place[slot] = free;
    } else if (kept[slot] != 0) {
      stage.place[slot] = static_cast<int>(stage.kept.size());
      stage.kept.push_back(slot);
    } else {
      stage.ahead_place[slot] = static_cast<int>(stage.ahead.size());
      stage.ahead.push_back(slot);
    }
  }
  if (stage.ahead.empty())
    return;
  gather(stage.ahead, stage.factor);
  cholesky(stage.ahead, schur_, stage.factor);
  const int rows = static_cast<int>(stage.kept.size()), columns = static_cast<int>(stage.ahead.size());
  stage.coupling.resize(rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j)
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto [column, row] = std::minmax(stage.kept[i], stage.ahead[j]);
      stage.coupling(i, j) = schur_(row, column);
      if (last != nullptr && last->place[row] >= 0 && last->place[column] >= 0)
        stage.coupling(i, j) -= last->taken_off(last->place[row], last->place[column]);
    }
  stage.taken_off = MatrixX::Zero(rows, rows);
  if (last != nullptr)
    for (Eigen::Index j = 0; j < rows; ++j)
      for (Eigen::Index i = j; i < rows; ++i)
        if (const int row = last->place[stage.kept[i]], column = last->place[stage.kept[j]]; row >= 0 && column >= 0)
          stage.taken_off(i, j) = last->taken_off(row, column);
  if (rows > 0) {
    const double one = 1;
    triangular_solve_from_right(stage.factor.data(), columns, stage.coupling);
    dsyrk_("L", "N", &rows, &columns, &one, stage.coupling.data(), &rows, &one, stage.taken_off.data(), &rows);
  }
  stages_.push_back(std::move(stage));
}

int SchurWindow::keep_sound_stages() {
  const auto is_changed = [&](const Stage& stage) {
    return std::any_of(stage.ahead.begin(), stage.ahead.end(), [&](int slot) { return changed_[slot] != 0; });
  };
  stages_.erase(std::find_if(stages_.begin(), stages_.end(), is_changed), stages_.end());
  return static_cast<int>(stages_.size());
}

int SchurWindow::done_ahead() const {
  std::size_t count = 0;
  for (const Stage& stage : stages_)
    count += stage.ahead.size();
  return static_cast<int>(count);
}

bool SchurWindow::factor() {
  const auto before = std::ssize(stages_);
  const bool stood = keep_sound_stages() == before && before > 0;
  std::fill(changed_.begin(), changed_.end(), 0);
  condensed_rest_.resize(0, 0);
  order_.clear();
  for (int slot = 0; slot < slots(); ++slot)
    if (active_[slot] != 0 && is_kept(slot))
      order_.push_back(slot);
  gather(order_, factor_);
  cholesky(order_, schur_, factor_);
  return stood;
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

SchurWindow::Half SchurWindow::Half::left_columns(Eigen::Index count) const {
  Half left{{}, rest.leftCols(count)};
  for (const MatrixX& stage : ahead)
    left.ahead.emplace_back(stage.leftCols(count));
  return left;
}

SchurWindow::Half SchurWindow::half(const MatrixX& right) const {
  Half result;
  MatrixX taken; // from the slots that the stage before keeps
  const Stage* before = nullptr;
  const auto rows_of = [&](const std::vector<int>& slots) {
    MatrixX rows(std::ssize(slots), right.cols());
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      rows.row(i) = right.row(slots[i]);
      if (before != nullptr)
        before->take_from(rows, i, taken, slots[i]);
    }
    return rows;
  };
  for (const Stage& stage : stages_) {
    MatrixX& ahead = result.ahead.emplace_back(rows_of(stage.ahead));
    MatrixX next = MatrixX::Zero(stage.coupling.rows(), right.cols());
    if (before != nullptr)
      for (Eigen::Index i = 0; i < next.rows(); ++i)
        if (const int place = before->place[stage.kept[i]]; place >= 0)
          next.row(i) = taken.row(place);
    if (!ahead.isZero(0)) {
      triangular_solve(false, stage.factor.data(), static_cast<int>(stage.ahead.size()), ahead);
      add_product(1, stage.coupling, false, ahead, next);
    }
    taken = std::move(next);
    before = &stage;
  }
  result.rest = rows_of(order_);
  triangular_solve(false, factor_.data(), static_cast<int>(order_.size()), result.rest);
  return result;
}

MatrixX SchurWindow::product(const Half& one, const Half& other) {
  MatrixX result = MatrixX::Zero(one.rest.cols(), other.rest.cols());
  for (std::size_t s = 0; s < one.ahead.size(); ++s)
    add_product(1, one.ahead[s], true, other.ahead[s], result);
  add_product(1, one.rest, true, other.rest, result);
  return result;
}

MatrixX SchurWindow::seen_by_condensed(const Half& right) const {
  MatrixX result = MatrixX::Zero(condensed_rest_.cols(), right.rest.cols());
  for (std::size_t s = 0; s < stages_.size(); ++s)
    add_product(1, stages_[s].halfway.leftCols(result.rows()), true, right.ahead[s], result);
  add_product(1, condensed_rest_, true, right.rest.bottomRows(condensed_rest_.rows()), result);
  return result;
}

MatrixX SchurWindow::solve(const MatrixX& right) const {
  auto [ahead, rest] = half(right);
  triangular_solve(true, factor_.data(), static_cast<int>(order_.size()), rest);
  MatrixX by_slot = MatrixX::Zero(slots(), right.cols());
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    by_slot.row(order_[i]) = rest.row(i);
  for (std::size_t s = stages_.size(); s-- > 0;) {
    const Stage& stage = stages_[s];
    MatrixX below(std::ssize(stage.kept), right.cols());
    for (Eigen::Index i = 0; i < below.rows(); ++i)
      below.row(i) = by_slot.row(stage.kept[i]);
    add_product(-1, stage.coupling, true, below, ahead[s]);
    triangular_solve(true, stage.factor.data(), static_cast<int>(stage.ahead.size()), ahead[s]);
    for (Eigen::Index i = 0; i < ahead[s].rows(); ++i)
      by_slot.row(stage.ahead[i]) = ahead[s].row(i);
  }
  return by_slot;
}

void SchurWindow::see_ahead(const SparseMatrix& functionals, const VectorX& right) {
  const Eigen::Index count = functionals.cols() + 1;
  std::vector<char> is_fresh(static_cast<std::size_t>(count), 0); // columns that are not as some stage saw them
  // The rows of a column that a stage has done ahead.
  const auto is_same = [](const Stage& stage, const SparseMatrix& other, Eigen::Index column) {
    SparseMatrix::InnerIterator a(stage.functionals, column), b(other, column);
    const auto next = [&](SparseMatrix::InnerIterator& entry) {
      while (entry && stage.ahead_place[entry.row()] < 0)
        ++entry;
      return static_cast<bool>(entry);
    };
    for (;; ++a, ++b) {
      const bool has_a = next(a), has_b = next(b);
      if (!has_a || !has_b)
        return has_a == has_b;
      if (a.row() != b.row() || a.value() != b.value())
        return false;
    }
  };
  const Stage* before = nullptr;
  for (Stage& stage : stages_) {
    const auto rows = std::ssize(stage.ahead);
    VectorX load(rows);
    for (Eigen::Index i = 0; i < rows; ++i)
      load[i] = right[stage.ahead[i]];
    if (stage.functionals.cols() + 1 != count || stage.halfway.cols() != count) {
      stage.halfway = MatrixX::Zero(rows, count);
      stage.taken = MatrixX::Zero(stage.coupling.rows(), count);
      stage.products = MatrixX::Zero(count, count);
      std::fill(is_fresh.begin(), is_fresh.end(), 1);
    } else {
      for (Eigen::Index c = 0; c + 1 < count; ++c)
        if (!is_same(stage, functionals, c))
          is_fresh[static_cast<std::size_t>(c)] = 1;
      if (load != stage.load)
        is_fresh.back() = 1;
    }
    std::vector<Eigen::Index> fresh;
    for (Eigen::Index c = 0; c < count; ++c)
      if (is_fresh[static_cast<std::size_t>(c)] != 0)
        fresh.push_back(c);
    if (!fresh.empty()) {
      MatrixX halfway(rows, std::ssize(fresh)), taken = MatrixX::Zero(stage.coupling.rows(), std::ssize(fresh));
      for (Eigen::Index k = 0; k < halfway.cols(); ++k) {
        if (fresh[k] + 1 == count) {
          halfway.col(k) = load;
        } else {
          halfway.col(k).setZero();
          for (SparseMatrix::InnerIterator entry(functionals, fresh[k]); entry; ++entry)
            if (const int place = stage.ahead_place[entry.row()]; place >= 0)
              halfway(place, k) = entry.value();
        }
        if (before == nullptr)
          continue;
        const auto all_taken = before->taken.col(fresh[k]);
        for (Eigen::Index i = 0; i < rows; ++i)
          if (const int place = before->place[stage.ahead[i]]; place >= 0)
            halfway(i, k) -= all_taken[place];
        for (Eigen::Index i = 0; i < taken.rows(); ++i)
          if (const int place = before->place[stage.kept[i]]; place >= 0)
            taken(i, k) = all_taken[place];
      }
      triangular_solve(false, stage.factor.data(), static_cast<int>(rows), halfway);
      add_product(1, stage.coupling, false, halfway, taken);
      for (Eigen::Index k = 0; k < halfway.cols(); ++k) {
        stage.halfway.col(fresh[k]) = halfway.col(k);
        stage.taken.col(fresh[k]) = taken.col(k);
      }
      stage.products = gram(stage.halfway);
      stage.functionals = functionals;
      stage.load = std::move(load);
    }
    before = &stage;
  }
}

SchurWindow::Condensed SchurWindow::condense(const SparseMatrix& functionals, const VectorX& right) {
  // With Y = L^-1 F: F^T S^-1 F = Y^T Y and F^T S^-1 b = Y^T (L^-1 b). Above its first entry F leaves Y zero.
  const Eigen::Index count = functionals.cols();
  see_ahead(functionals, right);
  MatrixX seen = MatrixX::Zero(std::ssize(order_), count), load(std::ssize(order_), 1);
  std::vector<int> order_place(static_cast<std::size_t>(slots()), -1);
  for (std::size_t i = 0; i < order_.size(); ++i) {
    order_place[order_[i]] = static_cast<int>(i);
    load(static_cast<Eigen::Index>(i), 0) = right[order_[i]];
  }
  for (Eigen::Index c = 0; c < count; ++c)
    for (SparseMatrix::InnerIterator entry(functionals, c); entry; ++entry)
      if (const int place = order_place[entry.row()]; place >= 0)
        seen(place, c) = entry.value();
  if (!stages_.empty()) {
    const Stage& last = stages_.back();
    for (Eigen::Index c = 0; c <= count; ++c) {
      const double* const taken = last.taken.col(c).data();
      double* const from = c < count ? seen.col(c).data() : load.data();
      for (std::size_t i = 0; i < order_.size(); ++i)
        if (const int place = last.place[order_[i]]; place >= 0)
          from[i] -= taken[place];
    }
  }
  Condensed condensed{MatrixX::Zero(count, count), VectorX::Zero(count)};
  for (const Stage& stage : stages_) {
    condensed.compliance += stage.products.topLeftCorner(count, count);
    condensed.response += stage.products.col(count).head(count);
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
  halfway.middleRows(far_, changing_) = window.topRows(changing_);
  halfway.bottomRows(contact_) = window.bottomRows(contact_);
  cholesky_->backward(changing_ + contact_, halfway);
  return halfway;
}

} // namespace spherecut::solvers
