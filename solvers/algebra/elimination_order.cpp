// Minimum fill on rows of bits. A graph of overlapping spheres has hundreds of neighbours a node, so a row is as dense
// as it is sparse, and joining the neighbours of an eliminated node is a few words of logic each. What its elimination
// would fill is judged for every neighbour from one sample: of the nodes that it has beyond the new clique, the middle
// one, and how many of the others and of the clique that one does not reach. Nodes that would add next to nothing to
// the clique go with it, so that there are few cliques to update; nodes that have become alike are held as one.
//
// Fill alone goes wherever it happens to be least next: what is eliminated may close around half of the body, for two
// to three times the operations, and which nodes come first in their numbering decides. So elimination begins at a far
// end of the graph, and a node farther from there has to save fill to come before a nearer one: it sweeps through the
// body.
#include "solvers/algebra/elimination_order.hpp"

#include "solvers/algebra/cholmod_workspace.inl"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>

namespace spherecut::solvers {

namespace {

using Word = std::uint64_t;
constexpr int word_bits = 64;
constexpr int small_graph = 1500;                      // nodes
constexpr int added_with_in_small = 3, added_with = 2; // nodes that one which goes with another may add
constexpr int most_nodes = 3000;      // of a graph that minimum fill suits better than nested dissection
constexpr int fewest_neighbours = 50; // of a node of a dense graph, in the mean
constexpr int first_samples = 4;      // of a node's neighbours, before anything is eliminated
constexpr int smoothing_passes = 8;
constexpr double fill_per_edge = 8; // per neighbour, that is accepted for a node one edge nearer to the beginning

struct Bits {
  Word* word;
  int words;
  [[nodiscard]] bool has(int i) const { return (word[i / word_bits] >> (i % word_bits) & 1) != 0; }
  void set(int i) const { word[i / word_bits] |= Word{1} << (i % word_bits); }
  void clear(int i) const { word[i / word_bits] &= ~(Word{1} << (i % word_bits)); }
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (int w = 0; w < words; ++w)
      for (Word rest = word[w]; rest != 0; rest &= rest - 1)
        visit(w * word_bits + std::countr_zero(rest));
  }
};

// The loops below are compiled with the machine's own count of bits, which the baseline lacks.
#define SPHERECUT_COUNTS_BITS __attribute__((target_clones("default", "arch=x86-64-v3")))

SPHERECUT_COUNTS_BITS int count(const Word* row, int words) {
  int bits = 0;
  for (int w = 0; w < words; ++w)
    bits += std::popcount(row[w]);
  return bits;
}

SPHERECUT_COUNTS_BITS int count_beyond(const Word* row, const Word* clique, const Word* alive, int words) {
  int bits = 0;
  for (int w = 0; w < words; ++w)
    bits += std::popcount(row[w] & ~clique[w] & alive[w]);
  return bits;
}

SPHERECUT_COUNTS_BITS int count_common(const Word* a, const Word* b, int words) {
  int bits = 0;
  for (int w = 0; w < words; ++w)
    bits += std::popcount(a[w] & b[w]);
  return bits;
}

/// Joins a row with the clique; what it has beyond goes to `beyond`. Returns how many those are.
SPHERECUT_COUNTS_BITS int join(Word* row, const Word* clique, const Word* alive, int words, Word* beyond) {
  int bits = 0;
  for (int w = 0; w < words; ++w) {
    const Word mine = row[w] & alive[w];
    beyond[w] = mine & ~clique[w];
    bits += std::popcount(beyond[w]);
    row[w] = mine | clique[w];
  }
  return bits;
}

/// Place of the k-th bit that is set.
SPHERECUT_COUNTS_BITS int place_of(const Word* row, int k) {
  int w = 0;
  for (int bits = std::popcount(row[0]); k >= bits; bits = std::popcount(row[++w]))
    k -= bits;
  Word rest = row[w];
  for (; k > 0; --k)
    rest &= rest - 1;
  return w * word_bits + std::countr_zero(rest);
}

class MinimumFill {
 public:
  MinimumFill(std::span<const int> start, std::span<const int> neighbours)
      : count_(static_cast<int>(start.size()) - 1), words_((count_ + word_bits - 1) / word_bits),
        rows_(static_cast<std::size_t>(count_) * words_), masks_(static_cast<std::size_t>(4) * words_), score_(count_),
        distance_(count_), head_(count_), next_(count_, -1), tail_(count_), size_(count_, 1), candidates_(count_),
        left_(count_) {
    std::iota(head_.begin(), head_.end(), 0);
    tail_ = candidates_ = head_;
    for (int i = 0; i < count_; ++i) {
      alive().set(i);
      heads().set(i);
      for (int k = start[i]; k < start[i + 1]; ++k)
        if (neighbours[k] != i)
          row(i).set(neighbours[k]);
    }
    for (int i = 0; i < count_; ++i)
      score_[i] = first_score(row(i));
    find_distances(start, neighbours);
    for (int i = 0; i < count_; ++i)
      score_[i] += fill_per_edge * distance_[i];
  }

  std::vector<int> order() {
    order_.reserve(static_cast<std::size_t>(count_));
    while (left_ > 0) {
      std::copy_n(row(next_node()).word, words_, clique().word);
      eliminate(chosen_);
      gather_others();
      const int reached = solvers::count(clique().word, words_);
      if (reached == left_) { // the rest is full
        clique().for_each([&](int i) { order_.push_back(i); });
        break;
      }
      update(reached);
      hold_alike_as_one();
    }
    return std::move(order_);
  }

 private:
  [[nodiscard]] Bits row(int i) { return {rows_.data() + static_cast<std::size_t>(i) * words_, words_}; }
  [[nodiscard]] Bits mask(int k) { return {masks_.data() + static_cast<std::size_t>(k) * words_, words_}; }
  [[nodiscard]] Bits alive() { return mask(0); }  // not eliminated
  [[nodiscard]] Bits heads() { return mask(1); }  // the first ones of those held as one
  [[nodiscard]] Bits clique() { return mask(2); } // neighbours of what was eliminated last
  [[nodiscard]] Bits beyond() { return mask(3); }

  /// From a far end of the graph, in edges. A number of edges is coarse where four of them span the body: means over
  /// the neighbours, taken a few times, tell places on the same level apart.
  void find_distances(std::span<const int> start, std::span<const int> neighbours) {
    const auto lowest = std::min_element(score_.begin(), score_.end());
    const int end = search(search(static_cast<int>(lowest - score_.begin()), start, neighbours), start, neighbours);
    std::vector<double> mean(distance_.size());
    for (int pass = 0; pass < smoothing_passes; ++pass) {
      for (int i = 0; i < count_; ++i) {
        double sum = distance_[i];
        for (int k = start[i]; k < start[i + 1]; ++k)
          sum += distance_[neighbours[k]];
        mean[i] = sum / (1 + start[i + 1] - start[i]);
      }
      distance_.swap(mean);
    }
    score_[end] = std::numeric_limits<double>::lowest();
  }

  /// Numbers of edges from a node, breadth first; 0 where none lead. Returns the node found last.
  int search(int from, std::span<const int> start, std::span<const int> neighbours) {
    constexpr double unseen = -1;
    std::fill(distance_.begin(), distance_.end(), unseen);
    std::vector<int> found{from};
    distance_[from] = 0;
    for (std::size_t k = 0; k < found.size(); ++k)
      for (int at = start[found[k]]; at < start[found[k] + 1]; ++at)
        if (const int other = neighbours[at]; distance_[other] == unseen) {
          distance_[other] = distance_[found[k]] + 1;
          found.push_back(other);
        }
    std::replace(distance_.begin(), distance_.end(), unseen, 0.0);
    return found.back();
  }

  /// Mean fill for each neighbour, from some of them.
  double first_score(Bits own) {
    const int degree = solvers::count(own.word, words_);
    const int samples = std::min(degree, first_samples);
    if (samples == 0)
      return 0;
    double joined = 0;
    for (int s = 0; s < samples; ++s)
      joined += count_common(row(place_of(own.word, (2 * s + 1) * degree / (2 * samples))).word, own.word, words_);
    return 0.5 * (degree - 1 - joined / samples);
  }

  int next_node() {
    std::erase_if(candidates_, [&](int i) { return !heads().has(i); });
    chosen_ =
        *std::min_element(candidates_.begin(), candidates_.end(), [&](int a, int b) { return score_[a] < score_[b]; });
    return chosen_;
  }

  /// Takes a node and all that are held as one with it.
  void eliminate(int head) {
    heads().clear(head);
    for (int i = head; i >= 0; i = next_[i]) {
      alive().clear(i);
      clique().clear(i);
      order_.push_back(i);
      --left_;
    }
  }

  /// The nodes of the clique that would add next to nothing to it.
  void gather_others() {
    const int most_added = count_ <= small_graph ? added_with_in_small : added_with;
    others_.clear();
    for_each_head([&](int i) {
      const int added = count_beyond(row(i).word, clique().word, alive().word, words_);
      if (added <= most_added)
        others_.emplace_back(added, i);
    });
    std::sort(others_.begin(), others_.end());
    for (const auto& [added, i] : others_)
      for (int w = 0; w < words_; ++w)
        clique().word[w] |= row(i).word[w] & alive().word[w];
    for (const auto& [added, i] : others_)
      eliminate(i);
  }

  /// Joins the neighbours and judges them anew.
  void update(int reached) {
    alike_.clear();
    for_each_head([&](int i) {
      const int added = join(row(i).word, clique().word, alive().word, words_, beyond().word);
      row(i).clear(i);
      double fill = 0;
      if (added > 0) {
        const Word* sample = row(head_[place_of(beyond().word, added / 2)]).word;
        fill = added * (reached - count_common(sample, clique().word, words_) +
                        0.5 * (added - 1 - count_common(sample, beyond().word, words_)));
      }
      // For each neighbour outside, and for each node that would be done with.
      score_[i] = fill / (std::max(1, added + reached - size_[i]) * size_[i]) + fill_per_edge * distance_[i];
      alike_.push_back({fill, added, i});
    });
  }

  void hold_alike_as_one() {
    std::sort(alike_.begin(), alike_.end());
    for (std::size_t k = 0; k < alike_.size();) {
      const Judged first = alike_[k];
      const Bits own = row(first.node);
      own.set(first.node);
      for (++k; k < alike_.size() && alike_[k].fill == first.fill && alike_[k].added == first.added; ++k) {
        const int i = alike_[k].node;
        row(i).set(i);
        const bool same = std::equal(own.word, own.word + words_, row(i).word);
        row(i).clear(i);
        if (!same)
          continue;
        next_[tail_[first.node]] = i;
        tail_[first.node] = tail_[i];
        size_[first.node] += size_[i];
        heads().clear(i);
        for (int member = i; member >= 0; member = next_[member])
          head_[member] = first.node;
      }
      own.clear(first.node);
    }
  }

  template <typename Visit>
  void for_each_head(const Visit& visit) {
    for (int w = 0; w < words_; ++w)
      for (Word rest = clique().word[w] & heads().word[w]; rest != 0; rest &= rest - 1)
        visit(w * word_bits + std::countr_zero(rest));
  }

  struct Judged {
    double fill;
    int added, node;
    bool operator<(const Judged& other) const {
      return std::tie(fill, added, node) < std::tie(other.fill, other.added, other.node);
    }
  };

  int count_, words_;
  std::vector<Word> rows_, masks_;
  std::vector<double> score_;
  std::vector<double> distance_;               // of a node from where elimination begins, in edges
  std::vector<int> head_, next_, tail_, size_; // nodes held as one: the first, a list of them, its end, how many
  std::vector<int> candidates_, order_;
  int left_, chosen_ = -1;
  std::vector<std::pair<int, int>> others_;
  std::vector<Judged> alike_;
};

/// The same elimination, every subtree of its tree in one run: fathers behind their children, the highest child
/// last, next to its father.
std::vector<int> postordered(const std::vector<int>& order, std::span<const int> start,
                             std::span<const int> neighbours) {
  const int count = static_cast<int>(order.size());
  std::vector<int> rank(count), father(count, -1), ancestor(count, -1);
  for (int k = 0; k < count; ++k)
    rank[order[k]] = k;
  // Liu: the father of a rank is the first later one that its subtree reaches; paths to the top are shortened.
  for (int k = 0; k < count; ++k)
    for (int at = start[order[k]]; at < start[order[k] + 1]; ++at)
      for (int i = rank[neighbours[at]]; i >= 0 && i < k;) {
        const int above = std::exchange(ancestor[i], k);
        if (above < 0)
          father[i] = k;
        i = above;
      }
  std::vector<int> height(count, 0), first(count + 1, -1), next(count, -1);
  for (int k = 0; k < count; ++k)
    if (father[k] >= 0)
      height[father[k]] = std::max(height[father[k]], height[k] + 1);
  std::vector<int> by_height(count);
  std::iota(by_height.begin(), by_height.end(), 0);
  std::stable_sort(by_height.begin(), by_height.end(), [&](int a, int b) { return height[a] > height[b]; });
  for (const int k : by_height) { // the highest last in its list
    const int to = father[k] < 0 ? count : father[k];
    next[k] = std::exchange(first[to], k);
  }
  std::vector<int> result, path;
  result.reserve(static_cast<std::size_t>(count));
  for (int root = first[count]; root >= 0; root = next[root])
    for (path.push_back(root); !path.empty();) {
      const int k = path.back(), child = first[k];
      if (child >= 0) {
        first[k] = next[child];
        path.push_back(child);
      } else {
        result.push_back(order[k]);
        path.pop_back();
      }
    }
  return result;
}

} // namespace

std::vector<int> fill_reducing_ordering(const std::vector<int>& start, const std::vector<int>& neighbours) {
  const int n = static_cast<int>(start.size()) - 1;
  const bool is_dense = n > 0 && std::ssize(neighbours) >= static_cast<std::ptrdiff_t>(n) * fewest_neighbours;
  if (is_dense && n <= most_nodes)
    return postordered(MinimumFill(start, neighbours).order(), start, neighbours);
  // The lower triangle by columns: rows come in ascending order, so every column's do.
  std::vector<int> begin(static_cast<std::size_t>(n) + 1, 0);
  const auto for_each_entry = [&](const auto& visit) {
    for (int row = 0; row < n; ++row)
      for (int k = start[row]; k < start[row + 1]; ++k)
        if (neighbours[k] <= row)
          visit(row, neighbours[k]);
  };
  for_each_entry([&](int, int column) { ++begin[column + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int> next(begin.begin(), begin.end() - 1), rows(static_cast<std::size_t>(begin[n]));
  for_each_entry([&](int row, int column) { rows[next[column]++] = row; });

  cholmod_sparse pattern{};
  pattern.nrow = pattern.ncol = static_cast<std::size_t>(n);
  pattern.nzmax = rows.size();
  pattern.p = begin.data();
  pattern.i = rows.data();
  pattern.stype = -1;
  pattern.itype = CHOLMOD_INT;
  pattern.xtype = CHOLMOD_PATTERN;
  pattern.sorted = pattern.packed = 1;
  CholmodWorkspace workspace(CHOLMOD_SIMPLICIAL); // there are no values
  if (is_dense) { // CHOLMOD would not try it: minimum degree seems good enough to it, with twice the operations
    workspace.common.nmethods = 1;
    workspace.common.method[0].ordering = CHOLMOD_METIS;
  }
  cholmod_factor* factor = cholmod_analyze(&pattern, &workspace.common);
  if (factor == nullptr)
    throw NumericalError("ordering the node graph ran out of memory");
  const int* permutation = static_cast<const int*>(factor->Perm);
  std::vector<int> ordering(permutation, permutation + n);
  cholmod_free_factor(&factor, &workspace.common);
  return ordering;
}

} // namespace spherecut::solvers
