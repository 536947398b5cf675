// A column is zero at a supernode that neither it nor, by the elimination tree, any supernode before touches [Gilbert,
// Peierls 1988]: the others are worked on in a packed copy. The solution is kept transposed, so that what a supernode
// passes on to a row is a run of memory.
#include "solvers/algebra/sparse_compliance.hpp"

#include "solvers/algebra/dense_products.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace spherecut::solvers {

namespace {

/// For every supernode the columns of B that are not zero there after the forward solution.
class ColumnReach {
 public:
  /// `transposed`: B^T.
  ColumnReach(const SupernodalFactor& lower, const MatrixX& transposed)
      : words_((transposed.rows() + word_bits - 1) / word_bits),
        bits_(static_cast<std::size_t>(lower.supernodes * words_), 0) {
    std::vector<int> supernode_of(static_cast<std::size_t>(lower.size));
    for (int s = 0; s < lower.supernodes; ++s)
      std::fill(supernode_of.begin() + lower.first_column[s], supernode_of.begin() + lower.first_column[s + 1], s);
    for (int s = 0; s < lower.supernodes; ++s)
      for (int row = lower.first_column[s]; row < lower.first_column[s + 1]; ++row)
        for (Eigen::Index c = 0; c < transposed.rows(); ++c)
          if (transposed(c, row) != 0)
            word(s, c / word_bits) |= std::uint64_t{1} << c % word_bits;
    for (int s = 0; s < lower.supernodes; ++s) {
      const int below = lower.first_row[s] + lower.first_column[s + 1] - lower.first_column[s];
      if (below < lower.first_row[s + 1])
        for (Eigen::Index w = 0; w < words_; ++w)
          word(supernode_of[lower.row[below]], w) |= word(s, w);
    }
  }

  void columns_at(int supernode, std::vector<int>& columns) {
    columns.clear();
    for (Eigen::Index w = 0; w < words_; ++w)
      for (int b = 0; b < word_bits; ++b)
        if ((word(supernode, w) >> b & 1) != 0)
          columns.push_back(static_cast<int>(w * word_bits + b));
  }

 private:
  static constexpr int word_bits = 64;
  [[nodiscard]] std::uint64_t& word(int supernode, Eigen::Index w) {
    return bits_[static_cast<std::size_t>(supernode * words_ + w)];
  }
  Eigen::Index words_;
  std::vector<std::uint64_t> bits_;
};

} // namespace

namespace {

/// In place of B^T comes (L^-1 B)^T.
void solve_forward(const SupernodalFactor& lower, MatrixX& solution) {
  ColumnReach reach(lower, solution);
  std::vector<int> active;
  MatrixX own, passed_on; // one row a column of B that is not zero there
  for (int s = 0; s < lower.supernodes; ++s) {
    reach.columns_at(s, active);
    if (active.empty())
      continue;
    const auto count = std::ssize(active);
    const int first = lower.first_column[s], width = lower.first_column[s + 1] - first;
    const int *rows = lower.row + lower.first_row[s], height = lower.first_row[s + 1] - lower.first_row[s];
    const double* panel = lower.value + lower.panel[s];
    own.resize(count, width);
    for (int k = 0; k < width; ++k)
      for (std::ptrdiff_t c = 0; c < count; ++c)
        own(c, k) = solution(active[c], first + k);
    triangular_solve_from_right(panel, height, own);
    for (int k = 0; k < width; ++k)
      for (std::ptrdiff_t c = 0; c < count; ++c)
        solution(active[c], first + k) = own(c, k);
    product_with_transposed(own, panel + width, height, height - width, passed_on);
    for (int k = width; k < height; ++k)
      for (std::ptrdiff_t c = 0; c < count; ++c)
        solution(active[c], rows[k]) -= passed_on(c, k - width);
  }
}

} // namespace

MatrixX sparse_compliance(const SupernodalFactor& lower, const SparseMatrix& columns) {
  MatrixX solution = MatrixX::Zero(columns.cols(), lower.size); // transposed
  for (Eigen::Index c = 0; c < columns.cols(); ++c)
    for (SparseMatrix::InnerIterator entry(columns, c); entry; ++entry)
      solution(c, entry.row()) = entry.value();
  solve_forward(lower, solution);
  return gram_of_rows(solution);
}

MatrixX sparse_forward(const SupernodalFactor& lower, const MatrixX& columns) {
  MatrixX solution = columns.transpose();
  solve_forward(lower, solution);
  return solution.transpose();
}

} // namespace spherecut::solvers
