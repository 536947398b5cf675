#include "solvers/algebra/factorisation.hpp"

#include "solvers/algebra/cholmod_workspace.inl"
#include "solvers/algebra/dense_products.hpp"
#include "solvers/algebra/large_pages.hpp"
#include "solvers/algebra/supernodal_cholesky.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <umfpack.h>

namespace spherecut::solvers {

namespace {

/// SuiteSparse takes its memory in large pages, from before main on: it keeps one allocator for the whole program. One
/// that the program has given it before stays.
[[maybe_unused]] const bool large_pages = [] {
  const bool untouched = SuiteSparse_config.malloc_func == std::malloc && SuiteSparse_config.free_func == std::free;
  if (untouched)
    SuiteSparse_config.malloc_func = allocate_in_large_pages;
  return untouched;
}();

cholmod_sparse view(const SparseMatrix& matrix, int symmetry) {
  cholmod_sparse sparse{};
  sparse.nrow = static_cast<std::size_t>(matrix.rows());
  sparse.ncol = static_cast<std::size_t>(matrix.cols());
  sparse.nzmax = static_cast<std::size_t>(matrix.nonZeros());
  sparse.p = const_cast<int*>(matrix.outerIndexPtr());
  sparse.i = const_cast<int*>(matrix.innerIndexPtr());
  sparse.x = const_cast<double*>(matrix.valuePtr());
  sparse.stype = symmetry;
  sparse.itype = CHOLMOD_INT;
  sparse.xtype = CHOLMOD_REAL;
  sparse.dtype = CHOLMOD_DOUBLE;
  sparse.sorted = 1;
  sparse.packed = 1;
  return sparse;
}

constexpr int node_size = 3; // unknowns of a node

/// The graph of the blocks where the lower triangle of a matrix consists of full 3 x 3 blocks (those on the diagonal
/// may be halves).
std::optional<SparseMatrix> block_graph(const SparseMatrix& lower) {
  const auto n = static_cast<int>(lower.rows());
  if (n == 0 || n % node_size != 0 || !lower.isCompressed())
    return std::nullopt;
  const int *start = lower.outerIndexPtr(), *row = lower.innerIndexPtr();
  // The rows of a column below its diagonal block.
  const auto below = [&](int column) {
    return std::span(
        std::lower_bound(row + start[column], row + start[column + 1], column / node_size * node_size + node_size),
        row + start[column + 1]);
  };
  SparseMatrix graph(n / node_size, n / node_size);
  graph.reserve(lower.nonZeros() / (node_size * node_size) + n);
  for (int column = 0; column < n; column += node_size) {
    const std::span<const int> rows = below(column);
    if (rows.size() % node_size != 0)
      return std::nullopt;
    for (int other = column + 1; other < column + node_size; ++other)
      if (const std::span<const int> same = below(other);
          !std::equal(rows.begin(), rows.end(), same.begin(), same.end()))
        return std::nullopt;
    graph.startVec(column / node_size);
    graph.insertBack(column / node_size, column / node_size) = 1;
    for (std::size_t k = 0; k < rows.size(); k += node_size) {
      if (rows[k] % node_size != 0 || rows[k + 1] != rows[k] + 1 || rows[k + 2] != rows[k] + 2)
        return std::nullopt;
      graph.insertBack(rows[k] / node_size, column / node_size) = 1;
    }
  }
  graph.finalize();
  return graph;
}

/// Symbolic factor of a matrix of 3 x 3 blocks from that of the graph of its blocks, a ninth of the work: every column
/// and row of a supernode stands for three. Null when memory or indices do not suffice.
cholmod_factor* analysed_by_blocks(const SparseMatrix& graph, long& nonzeros, cholmod_common& common) {
  cholmod_sparse matrix = view(graph, -1);
  cholmod_factor* by_block = cholmod_analyze(&matrix, &common);
  if (by_block == nullptr)
    return nullptr;
  const std::size_t count = by_block->n, supernodes = by_block->nsuper;
  const bool fits = node_size * node_size * by_block->xsize <= std::numeric_limits<int>::max();
  if (!fits)
    common.status = CHOLMOD_TOO_LARGE;
  cholmod_factor* factor = fits ? cholmod_allocate_factor(node_size * count, &common) : nullptr;
  if (factor != nullptr) {
    factor->ordering = CHOLMOD_NATURAL;
    factor->is_ll = factor->is_super = factor->is_monotonic = 1;
    factor->nsuper = supernodes;
    factor->ssize = node_size * by_block->ssize;
    factor->xsize = node_size * node_size * by_block->xsize;
    factor->maxcsize = node_size * node_size * by_block->maxcsize;
    factor->maxesize = node_size * by_block->maxesize;
    const auto array = [&](std::size_t size) { return static_cast<int*>(cholmod_malloc(size, sizeof(int), &common)); };
    int* const super = array(supernodes + 1);
    int* const pi = array(supernodes + 1);
    int* const px = array(supernodes + 1);
    int* const rows = array(factor->ssize);
    factor->super = super;
    factor->pi = pi;
    factor->px = px;
    factor->s = rows;
    if (super == nullptr || pi == nullptr || px == nullptr || rows == nullptr) {
      cholmod_free_factor(&factor, &common);
    } else {
      for (std::size_t s = 0; s <= supernodes; ++s) {
        super[s] = node_size * static_cast<const int*>(by_block->super)[s];
        pi[s] = node_size * static_cast<const int*>(by_block->pi)[s];
        px[s] = node_size * node_size * static_cast<const int*>(by_block->px)[s];
      }
      for (std::size_t k = 0; k < factor->ssize; ++k)
        rows[k] = node_size * static_cast<const int*>(by_block->s)[k / node_size] + static_cast<int>(k % node_size);
      int* const counts = static_cast<int*>(factor->ColCount);
      nonzeros = 0;
      for (std::size_t column = 0; column < node_size * count; ++column) {
        const int own = static_cast<int>(column % node_size);
        counts[column] = node_size * static_cast<const int*>(by_block->ColCount)[column / node_size] - own;
        nonzeros += counts[column];
      }
    }
  }
  cholmod_free_factor(&by_block, &common);
  return factor;
}

class CholeskyFactorisation final : public OrderedCholesky {
 public:
  explicit CholeskyFactorisation(const SparseMatrix& lower) {
    cholmod_common& common = workspace_.common;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_NATURAL;
    common.postorder = 0;
    if (const auto graph = block_graph(lower)) {
      factor_ = analysed_by_blocks(*graph, nonzeros_, common);
    } else {
      cholmod_sparse matrix = view(lower, -1);
      factor_ = cholmod_analyze(&matrix, &common);
      nonzeros_ = static_cast<long>(common.lnz);
    }
    if (factor_ == nullptr)
      throw NumericalError(fmt::format("Cholesky analysis failed (CHOLMOD status {})", common.status));
    try {
      find_values(lower);
    } catch (...) {
      cholmod_free_factor(&factor_, &common);
      throw;
    }
  }
  ~CholeskyFactorisation() override { cholmod_free_factor(&factor_, &workspace_.common); }
  CholeskyFactorisation(const CholeskyFactorisation&) = delete;
  CholeskyFactorisation& operator=(const CholeskyFactorisation&) = delete;

  MatrixX solve(const MatrixX& right_hand_sides) const override { return solve_with(CHOLMOD_A, right_hand_sides); }
  MatrixX forward(const MatrixX& right_hand_sides) const override { return solve_with(CHOLMOD_L, right_hand_sides); }
  void backward(int known, MatrixX& x) const override {
    const SupernodalFactor lower = supernodes();
    const int wanted = lower.size - known;
    MatrixX own, below;
    for (int s = lower.supernodes; s-- > 0;) {
      const int begin = lower.first_column[s], width = std::min(lower.first_column[s + 1], wanted) - begin;
      if (width <= 0)
        continue;
      const int height = lower.first_row[s + 1] - lower.first_row[s];
      const int* const row = lower.row + lower.first_row[s] + width;
      const double* const panel = lower.value + lower.panel[s];
      own = x.middleRows(begin, width);
      below.resize(height - width, x.cols());
      for (Eigen::Index c = 0; c < below.cols(); ++c)
        for (Eigen::Index k = 0; k < below.rows(); ++k)
          below(k, c) = x(row[k], c);
      add_transposed_product(-1, panel + width, height, below, own);
      triangular_solve(true, panel, height, own);
      x.middleRows(begin, width) = own;
    }
  }
  MatrixX trailing(int count) const override {
    const SupernodalFactor lower = supernodes();
    const int first = lower.size - count;
    MatrixX block = MatrixX::Zero(count, count);
    for (int s = 0; s < lower.supernodes; ++s) {
      const int begin = lower.first_column[s], height = lower.first_row[s + 1] - lower.first_row[s];
      for (int column = std::max(begin, first); column < lower.first_column[s + 1]; ++column) {
        const double* entries = lower.value + lower.panel[s] + static_cast<long>(column - begin) * height;
        for (int k = column - begin; k < height; ++k)
          block(lower.row[lower.first_row[s] + k] - first, column - first) = entries[k];
      }
    }
    return block;
  }
  MatrixX compliance(const SparseMatrix& columns) const override { return sparse_compliance(supernodes(), columns); }
  MatrixX forward_sparse(const MatrixX& right_hand_sides) const override {
    return sparse_forward(supernodes(), right_hand_sides);
  }
  MatrixX solve_transposed(const MatrixX& right_hand_sides) const override { return solve(right_hand_sides); }
  long nonzeros() const override { return nonzeros_; }

 private:
  /// Fills the supernodes that the analysis has found.
  void find_values(const SparseMatrix& lower) {
    factor_->x = cholmod_malloc(factor_->xsize, sizeof(double), &workspace_.common);
    if (factor_->x == nullptr)
      throw NumericalError(fmt::format("Cholesky factorisation failed: no memory for {:.1f} GB of factor",
                                       1e-9 * static_cast<double>(factor_->xsize * sizeof(double))));
    factor_->xtype = CHOLMOD_REAL;
    const int column = factor_supernodes(lower, supernodes(), static_cast<double*>(factor_->x));
    if (column >= 0)
      throw NumericalError(fmt::format("the stiffness matrix is not positive definite (column {} of {} in elimination "
                                       "order): the body is not held, or a support is unsound",
                                       column, lower.cols()));
  }
  [[nodiscard]] SupernodalFactor supernodes() const {
    const auto indices = [](const void* array) { return static_cast<const int*>(array); };
    return {static_cast<int>(factor_->n),
            static_cast<int>(factor_->nsuper),
            indices(factor_->super),
            indices(factor_->pi),
            indices(factor_->px),
            indices(factor_->s),
            static_cast<const double*>(factor_->x)};
  }
  [[nodiscard]] MatrixX solve_with(int system, const MatrixX& right_hand_sides) const {
    cholmod_dense dense{};
    dense.nrow = static_cast<std::size_t>(right_hand_sides.rows());
    dense.ncol = static_cast<std::size_t>(right_hand_sides.cols());
    dense.nzmax = dense.nrow * dense.ncol;
    dense.d = dense.nrow;
    dense.x = const_cast<double*>(right_hand_sides.data());
    dense.xtype = CHOLMOD_REAL;
    dense.dtype = CHOLMOD_DOUBLE;
    const std::scoped_lock lock(workspace_mutex_); // bodies that are cut share the factor of the uncut one
    cholmod_dense* solution = cholmod_solve(system, factor_, &dense, &workspace_.common);
    if (solution == nullptr)
      throw NumericalError("Cholesky solve ran out of memory");
    MatrixX result = Eigen::Map<const MatrixX>(static_cast<const double*>(solution->x), right_hand_sides.rows(),
                                               right_hand_sides.cols());
    cholmod_free_dense(&solution, &workspace_.common);
    return result;
  }

  mutable CholmodWorkspace workspace_{CHOLMOD_SUPERNODAL};
  mutable std::mutex workspace_mutex_;
  cholmod_factor* factor_ = nullptr;
  long nonzeros_ = 0;
};

constexpr Eigen::Index few = 3; // right-hand sides: fewer are solved for one by one, and refined
constexpr int panel_width = 16; // right-hand sides swept together: two cache lines a row

// row_j -= factor row_k and row /= pivot over one panel row, for the vector widths of the machine.
__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
lower_sweep(int n, const int* start, const int* column, const double* value, double* panel) {
  for (int row = 0; row < n; ++row) {
    double* target = panel + static_cast<long>(row) * panel_width;
    double sum[panel_width];
    for (int c = 0; c < panel_width; ++c)
      sum[c] = target[c];
    for (int k = start[row]; k < start[row + 1] - 1; ++k) { // the unit diagonal is last
      const double* source = panel + static_cast<long>(column[k]) * panel_width;
      for (int c = 0; c < panel_width; ++c)
        sum[c] -= value[k] * source[c];
    }
    for (int c = 0; c < panel_width; ++c)
      target[c] = sum[c];
  }
}

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
upper_sweep(int n, const int* start, const int* row, const double* value, double* panel) {
  for (int column = n - 1; column >= 0; --column) {
    double* source = panel + static_cast<long>(column) * panel_width;
    const double pivot = value[start[column + 1] - 1]; // last of its column
    double x[panel_width];
    for (int c = 0; c < panel_width; ++c) {
      x[c] = source[c] / pivot;
      source[c] = x[c];
    }
    for (int k = start[column]; k < start[column + 1] - 1; ++k) {
      double* target = panel + static_cast<long>(row[k]) * panel_width;
      for (int c = 0; c < panel_width; ++c)
        target[c] -= value[k] * x[c];
    }
  }
}

/// UMFPACK's factors taken out once, P R A Q = L U, so that many right-hand sides share each sweep over them: UMFPACK
/// itself solves one at a time.
struct LuFactors {
  std::vector<int> lower_start, lower_column, upper_start, upper_row, row_order, column_order;
  std::vector<double> lower, upper, scale;

  explicit LuFactors(void* numeric, int n) : row_order(n), column_order(n), scale(n) {
    int lower_size = 0, upper_size = 0, rows = 0, columns = 0, diagonal = 0;
    umfpack_di_get_lunz(&lower_size, &upper_size, &rows, &columns, &diagonal, numeric);
    lower_start.resize(n + 1);
    lower_column.resize(lower_size);
    lower.resize(lower_size);
    upper_start.resize(n + 1);
    upper_row.resize(upper_size);
    upper.resize(upper_size);
    int reciprocal = 0;
    const int status = umfpack_di_get_numeric(lower_start.data(), lower_column.data(), lower.data(), upper_start.data(),
                                              upper_row.data(), upper.data(), row_order.data(), column_order.data(),
                                              nullptr, &reciprocal, scale.data(), numeric);
    if (status != UMFPACK_OK)
      throw NumericalError(fmt::format("the LU factors cannot be read (UMFPACK status {})", status));
    if (reciprocal == 0)
      for (double& factor : scale)
        factor = 1 / factor;
  }

  void solve(const MatrixX& right, MatrixX& result) const {
    const int n = static_cast<int>(row_order.size());
    std::vector<double> panel(static_cast<std::size_t>(n) * panel_width);
    for (Eigen::Index first = 0; first < right.cols(); first += panel_width) {
      const Eigen::Index width = std::min<Eigen::Index>(panel_width, right.cols() - first);
      std::fill(panel.begin(), panel.end(), 0.0);
      for (Eigen::Index c = 0; c < width; ++c)
        for (int k = 0; k < n; ++k)
          panel[static_cast<std::size_t>(k) * panel_width + c] = scale[row_order[k]] * right(row_order[k], first + c);
      lower_sweep(n, lower_start.data(), lower_column.data(), lower.data(), panel.data());
      upper_sweep(n, upper_start.data(), upper_row.data(), upper.data(), panel.data());
      for (Eigen::Index c = 0; c < width; ++c)
        for (int k = 0; k < n; ++k)
          result(column_order[k], first + c) = panel[static_cast<std::size_t>(k) * panel_width + c];
    }
  }
};

class LuFactorisation final : public Factorisation {
 public:
  LuFactorisation(const SparseMatrix& matrix, const std::vector<int>& ordering) : matrix_(matrix) {
    matrix_.makeCompressed();
    umfpack_di_defaults(control_);
    // The patterns here are nearly symmetric: ordering A + A^T and preferring the diagonal halves the time.
    control_[UMFPACK_STRATEGY] = UMFPACK_STRATEGY_SYMMETRIC;
    control_[UMFPACK_ORDERING] = ordering.empty() ? UMFPACK_ORDERING_METIS : UMFPACK_ORDERING_GIVEN;
    // One refinement step: the estimates below rely on backward stability, and more never changed a digit.
    control_[UMFPACK_IRSTEP] = 1;
    double info[UMFPACK_INFO];
    void* symbolic = nullptr;
    const int n = static_cast<int>(matrix_.rows());
    int status = ordering.empty()
                     ? umfpack_di_symbolic(n, n, matrix_.outerIndexPtr(), matrix_.innerIndexPtr(), matrix_.valuePtr(),
                                           &symbolic, control_, info)
                     : umfpack_di_qsymbolic(n, n, matrix_.outerIndexPtr(), matrix_.innerIndexPtr(), matrix_.valuePtr(),
                                            ordering.data(), &symbolic, control_, info);
    if (status != UMFPACK_OK)
      throw NumericalError(fmt::format("LU analysis failed (UMFPACK status {})", status));
    status = umfpack_di_numeric(matrix_.outerIndexPtr(), matrix_.innerIndexPtr(), matrix_.valuePtr(), symbolic,
                                &numeric_, control_, info);
    umfpack_di_free_symbolic(&symbolic);
    if (status != UMFPACK_OK) {
      if (numeric_ != nullptr)
        umfpack_di_free_numeric(&numeric_);
      throw NumericalError(fmt::format("the collocation matrix is singular (UMFPACK status {}, reciprocal condition of "
                                       "the pivots {:.1e}): the body is not held, or a support is unsound",
                                       status, info[UMFPACK_RCOND]));
    }
    nonzeros_ = static_cast<long>(info[UMFPACK_LNZ] + info[UMFPACK_UNZ]);
  }
  ~LuFactorisation() override { umfpack_di_free_numeric(&numeric_); }
  LuFactorisation(const LuFactorisation&) = delete;
  LuFactorisation& operator=(const LuFactorisation&) = delete;

  MatrixX solve(const MatrixX& right_hand_sides) const override {
    if (right_hand_sides.cols() < few)
      return solve_with(UMFPACK_A, right_hand_sides);
    MatrixX result(right_hand_sides.rows(), right_hand_sides.cols());
    LuFactors(numeric_, static_cast<int>(matrix_.rows())).solve(right_hand_sides, result);
    return result;
  }
  MatrixX solve_transposed(const MatrixX& right_hand_sides) const override {
    return solve_with(UMFPACK_At, right_hand_sides);
  }
  long nonzeros() const override { return nonzeros_; }

 private:
  MatrixX solve_with(int system, const MatrixX& right_hand_sides) const {
    MatrixX result(right_hand_sides.rows(), right_hand_sides.cols());
    double info[UMFPACK_INFO];
    for (Eigen::Index k = 0; k < right_hand_sides.cols(); ++k) {
      const int status =
          umfpack_di_solve(system, matrix_.outerIndexPtr(), matrix_.innerIndexPtr(), matrix_.valuePtr(),
                           result.col(k).data(), right_hand_sides.col(k).data(), numeric_, control_, info);
      if (status != UMFPACK_OK)
        throw NumericalError(fmt::format("LU solve failed (UMFPACK status {})", status));
    }
    return result;
  }
  SparseMatrix matrix_;
  double control_[UMFPACK_CONTROL];
  void* numeric_ = nullptr;
  long nonzeros_ = 0;
};

} // namespace

std::unique_ptr<OrderedCholesky> factor_ordered(const SparseMatrix& lower) {
  interruption_point();
  return std::make_unique<CholeskyFactorisation>(lower);
}

std::unique_ptr<Factorisation> factor_general(const SparseMatrix& matrix, const std::vector<int>& ordering) {
  interruption_point();
  return std::make_unique<LuFactorisation>(matrix, ordering);
}

double one_norm(const SparseMatrix& matrix, bool lower_triangle_of_symmetric) {
  VectorX sums = VectorX::Zero(matrix.cols());
  for (int column = 0; column < matrix.outerSize(); ++column)
    for (SparseMatrix::InnerIterator entry(matrix, column); entry; ++entry) {
      if (lower_triangle_of_symmetric && entry.row() < column)
        continue;
      sums[column] += std::abs(entry.value());
      if (lower_triangle_of_symmetric && entry.row() != column)
        sums[entry.row()] += std::abs(entry.value());
    }
  return sums.size() == 0 ? 0 : sums.maxCoeff();
}

double condition_estimate(const Factorisation& factorisation, double norm_of_matrix, int size) {
  VectorX x = VectorX::Constant(size, 1.0 / size);
  double estimate = 0;
  Eigen::Index last = -1;
  for (int iteration = 0; iteration < 5; ++iteration) {
    const VectorX y = factorisation.solve(x);
    const double norm = y.lpNorm<1>();
    if (iteration > 0 && norm <= estimate)
      break;
    estimate = norm;
    const VectorX signs = y.unaryExpr([](double v) { return v >= 0 ? 1.0 : -1.0; });
    const VectorX z = factorisation.solve_transposed(signs);
    Eigen::Index largest = 0;
    const double peak = z.cwiseAbs().maxCoeff(&largest);
    if (largest == last || (iteration > 0 && peak <= z.dot(x)))
      break;
    last = largest;
    x = VectorX::Unit(size, largest);
  }
  return estimate * norm_of_matrix;
}

} // namespace spherecut::solvers
