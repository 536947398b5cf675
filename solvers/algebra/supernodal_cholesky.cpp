// Left-looking [Ng, Peyton 1993: block sparse Cholesky algorithms on advanced uniprocessor computers]: a supernode
// takes the products of all supernodes before it that reach its columns, then it is factored. Work is cut into parts
// whose size depends on the matrix alone, so that the bits do not depend on how many threads share them:
// - subtrees of the elimination tree with a small part of the work are factored side by side, each by one thread;
// - the supernodes above them come one after another, and threads share the tiles of their panels.
#include "solvers/algebra/supernodal_cholesky.hpp"

#include "solvers/algebra/blas.inl"
#include "solvers/algebra/parallel.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <atomic>
#include <functional>
#include <numeric>
#include <span>
#include <vector>

namespace spherecut::solvers {

namespace {

constexpr int tile_columns = 256;     // of a panel that are factored together
constexpr int tile_rows = 512;        // of a panel that one part of the work covers
constexpr double subtree_part = 0.04; // of all work: subtrees with less are factored by one thread each

/// Rows [first, end) of a supernode among the rows of one before it.
struct Descendant {
  int supernode, first, end; // places in its list of rows: those of the columns that it reaches
};

class NumericCholesky {
 public:
  NumericCholesky(const SparseMatrix& lower, const SupernodalFactor& structure, double* value)
      : lower_(lower), structure_(structure), value_(value), owner_(static_cast<std::size_t>(structure.size)) {
    for (int s = 0; s < structure.supernodes; ++s)
      std::fill(owner_.begin() + structure.first_column[s], owner_.begin() + structure.first_column[s + 1], s);
    find_descendants();
    find_subtrees();
  }

  int factor() {
    // Subtrees with the most work begin first.
    std::vector<int> by_work(subtrees_.size());
    std::iota(by_work.begin(), by_work.end(), 0);
    std::stable_sort(by_work.begin(), by_work.end(),
                     [&](int a, int b) { return work_[subtrees_[a].root] > work_[subtrees_[b].root]; });
    std::vector<int> failed(subtrees_.size(), -1);
    parallel_ranges(static_cast<int>(subtrees_.size()), 1, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) {
        const Subtree tree = subtrees_[by_work[k]];
        for (int s = tree.first; s <= tree.root && failed[by_work[k]] < 0; ++s)
          failed[by_work[k]] = factor_supernode(s, false);
      }
    });
    for (const int column : failed) // in ascending order, as the subtrees are
      if (column >= 0)
        return column;
    for (const int s : above_)
      if (const int column = factor_supernode(s, true); column >= 0)
        return column;
    return -1;
  }

 private:
  struct Subtree {
    int first, root; // supernodes
  };

  [[nodiscard]] int width(int s) const { return structure_.first_column[s + 1] - structure_.first_column[s]; }
  [[nodiscard]] int height(int s) const { return structure_.first_row[s + 1] - structure_.first_row[s]; }
  [[nodiscard]] const int* rows(int s) const { return structure_.row + structure_.first_row[s]; }
  [[nodiscard]] double* panel(int s) const { return value_ + structure_.panel[s]; }

  template <typename Visit>
  void for_each_reached(int s, const Visit& visit) const {
    const int* const row = rows(s);
    const int count = height(s);
    for (int first = width(s); first < count;) {
      const int to = owner_[row[first]];
      const int end =
          static_cast<int>(std::lower_bound(row + first, row + count, structure_.first_column[to + 1]) - row);
      visit(to, first, end);
      first = end;
    }
  }

  void find_descendants() {
    start_.assign(static_cast<std::size_t>(structure_.supernodes) + 1, 0);
    for (int s = 0; s < structure_.supernodes; ++s)
      for_each_reached(s, [&](int to, int, int) { ++start_[to + 1]; });
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    descendants_.resize(start_.back());
    std::vector<std::size_t> next(start_.begin(), start_.end() - 1);
    for (int s = 0; s < structure_.supernodes; ++s)
      for_each_reached(s, [&](int to, int first, int end) { descendants_[next[to]++] = {s, first, end}; });
  }

  /// The order of elimination is postordered: a subtree is a run of supernodes that ends with its root.
  void find_subtrees() {
    const int count = structure_.supernodes;
    work_.assign(static_cast<std::size_t>(count), 0);
    std::vector<int> father(count, -1), first(count);
    std::iota(first.begin(), first.end(), 0);
    bool postordered = true;
    double all = 0;
    for (int s = 0; s < count; ++s) {
      const double own = static_cast<double>(width(s)) * height(s) * height(s);
      all += own;
      work_[s] += own;
      if (height(s) > width(s)) {
        father[s] = owner_[rows(s)[width(s)]];
        work_[father[s]] += work_[s];
        first[father[s]] = std::min(first[father[s]], first[s]);
      }
    }
    // Where the order is not postordered subtrees are no runs: all supernodes come one after another then.
    std::vector<int> size(count, 1);
    for (int s = 0; s < count; ++s) {
      postordered = postordered && size[s] == s - first[s] + 1;
      if (father[s] >= 0)
        size[father[s]] += size[s];
    }
    const auto is_small = [&](int s) { return postordered && work_[s] <= subtree_part * all; };
    for (int s = 0; s < count; ++s)
      if (!is_small(s))
        above_.push_back(s);
      else if (father[s] < 0 || !is_small(father[s]))
        subtrees_.push_back({first[s], s});
  }

  /// Returns the first column without a positive pivot, or -1.
  int factor_supernode(int s, bool shared) {
    const int columns = width(s), count = height(s);
    interruption_point();
    scatter_matrix(s);
    for (int begin = 0; begin < columns; begin += tile_columns) {
      const int end = std::min(columns, begin + tile_columns);
      // Tile 0 is the square on the diagonal; those below have tile_rows rows.
      const int tiles = 1 + (count - end + tile_rows - 1) / tile_rows;
      const auto rows_of = [&](int tile) {
        const int from = tile == 0 ? begin : end + (tile - 1) * tile_rows;
        return std::pair(from, tile == 0 ? end : std::min(count, from + tile_rows));
      };
      for_each(tiles, shared, [&](int tile) {
        const auto [from, to] = rows_of(tile);
        add_descendants(s, from, to, begin, end);
        add_columns_before(s, from, to, begin, end);
      });
      const int size = end - begin;
      double* const diagonal = panel(s) + static_cast<long>(begin) * count + begin;
      int info = 0;
      dpotrf_("L", &size, diagonal, &count, &info);
      if (info > 0)
        return structure_.first_column[s] + begin + info - 1;
      for_each(tiles - 1, shared, [&](int below) {
        const auto [from, to] = rows_of(below + 1);
        const int some = to - from;
        const double one = 1;
        dtrsm_("R", "L", "T", "N", &some, &size, &one, diagonal, &count, diagonal + from - begin, &count);
      });
    }
    return -1;
  }

  static void for_each(int count, bool shared, const std::function<void(int)>& part) {
    if (shared)
      parallel_ranges(count, 1, [&](int begin, int end) {
        for (int k = begin; k < end; ++k)
          part(k);
      });
    else
      for (int k = 0; k < count; ++k)
        part(k);
  }

  void scatter_matrix(int s) {
    const int columns = width(s), count = height(s), first = structure_.first_column[s];
    const int* const row = rows(s);
    double* const entries = panel(s);
    std::fill_n(entries, static_cast<long>(columns) * count, 0.0);
    for (int column = 0; column < columns; ++column) {
      int place = column;
      for (SparseMatrix::InnerIterator entry(lower_, first + column); entry; ++entry) {
        if (entry.row() < first + column)
          continue;
        if (entry.row() < row[place]) // rows of a column come in any order
          place = column;
        while (row[place] < entry.row())
          ++place;
        entries[static_cast<long>(column) * count + place] = entry.value();
      }
    }
  }

  /// What the supernodes before s leave of rows [from, to) of its panel, in columns [begin, end).
  void add_descendants(int s, int from, int to, int begin, int end) {
    const int count = height(s), first = structure_.first_column[s];
    const int* const row = rows(s);
    const int lowest = row[from], highest = row[to - 1];
    double* const entries = panel(s);
    thread_local std::vector<double> product;
    thread_local std::vector<int> place;
    for (std::size_t k = start_[s]; k < start_[s + 1]; ++k) {
      const Descendant& before = descendants_[k];
      const int* const its = rows(before.supernode);
      const int its_height = height(before.supernode), inner = width(before.supernode);
      const auto find = [&](int begin_at, int end_at, int wanted) {
        return static_cast<int>(std::lower_bound(its + begin_at, its + end_at, wanted) - its);
      };
      const int c0 = find(before.first, before.end, first + begin), c1 = find(c0, before.end, first + end);
      if (c0 == c1)
        continue;
      const int r0 = find(c0, its_height, lowest), r1 = find(r0, its_height, highest + 1);
      const int m = r1 - r0, n = c1 - c0;
      if (m == 0)
        continue;
      product.resize(static_cast<std::size_t>(m) * n);
      const double* const l = panel(before.supernode);
      const double one = 1, none = 0;
      if (r0 == c0 && m == n)
        dsyrk_("L", "N", &n, &inner, &one, l + c0, &its_height, &none, product.data(), &m);
      else
        dgemm_("N", "T", &m, &n, &inner, &one, l + r0, &its_height, l + c0, &its_height, &none, product.data(), &m);
      place.resize(m);
      for (int r = 0, at = from; r < m; ++r) {
        while (row[at] < its[r0 + r])
          ++at;
        place[r] = at;
      }
      const int above = r0 == c0 && m == n ? 1 : 0; // the square on the diagonal has no more than its lower triangle
      for (int c = 0; c < n; ++c) {
        double* const target = entries + static_cast<long>(its[c0 + c] - first) * count;
        const double* const source = product.data() + static_cast<std::size_t>(c) * m;
        for (int r = above * c; r < m; ++r)
          target[place[r]] -= source[r];
      }
    }
  }

  /// What the columns of s before `begin` leave of the tile.
  void add_columns_before(int s, int from, int to, int begin, int end) {
    if (begin == 0)
      return;
    const int count = height(s), m = to - from, n = end - begin;
    double* const entries = panel(s);
    double* const target = entries + static_cast<long>(begin) * count + from;
    const double minus = -1, one = 1;
    if (from == begin)
      dsyrk_("L", "N", &n, &begin, &minus, entries + from, &count, &one, target, &count);
    else
      dgemm_("N", "T", &m, &n, &begin, &minus, entries + from, &count, entries + begin, &count, &one, target, &count);
  }

  const SparseMatrix& lower_;
  const SupernodalFactor& structure_;
  double* value_;
  std::vector<int> owner_; // supernode of a column
  std::vector<std::size_t> start_;
  std::vector<Descendant> descendants_; // of supernode s: start_[s] .. start_[s + 1], ascending
  std::vector<double> work_;            // of a supernode and all below it
  std::vector<Subtree> subtrees_;
  std::vector<int> above_;
};

} // namespace

int factor_supernodes(const SparseMatrix& lower, const SupernodalFactor& structure, double* value) {
  return NumericCholesky(lower, structure, value).factor();
}

} // namespace spherecut::solvers
