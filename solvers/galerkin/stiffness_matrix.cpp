#include "solvers/galerkin/stiffness_matrix.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace spherecut::solvers {

namespace {

using TilePair = StiffnessTiles::Pair;

/// Without those of nodes that are left out, and with a diagonal block for every node.
void complete_pairs(int count, const std::vector<char>& dropped, std::vector<TilePair>& pairs) {
  if (!dropped.empty())
    std::erase_if(pairs, [&](const TilePair& pair) { return dropped[pair.column] != 0; });
  std::vector<char> has_diagonal(count, 0);
  for (const TilePair& pair : pairs)
    if (pair.row == pair.column)
      has_diagonal[pair.row] = 1;
  for (int i = 0; i < count; ++i)
    if (has_diagonal[i] == 0)
      pairs.push_back({i, i, nullptr, nullptr});
}

/// The pairs in the order `before` sorted by key(pair), those alike as they were; start[k]: the first with key k.
template <class Key>
std::vector<int> sorted_by(const std::vector<TilePair>& pairs, const std::vector<int>& before, const Key& key,
                           int count, std::vector<int>& start) {
  start.assign(count + 1, 0);
  for (const int p : before)
    ++start[key(pairs[p]) + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<int> next(start.begin(), start.end() - 1), after(before.size());
  for (const int p : before)
    after[next[key(pairs[p])]++] = p;
  return after;
}

} // namespace

void build_stiffness(std::vector<StiffnessTiles::Pair> pairs, const std::vector<int>& rank,
                     const std::vector<char>& dropped, const std::vector<Anchor>& anchors, const Problem& problem,
                     SparseMatrix& stiffness, EntriesInLargePages& elastic) {
  const int count = problem.nodes.size();
  complete_pairs(count, dropped, pairs);
  const long blocks = std::ssize(pairs);
  if (9 * blocks > std::numeric_limits<int>::max())
    throw InputError(
        fmt::format("{} nodes give {} matrix entries, more than the factorisation can index", count, 9 * blocks));

  std::vector<int> all(pairs.size()), start;
  std::iota(all.begin(), all.end(), 0);
  const auto lower_of = [&](const TilePair& pair) { return std::max(rank[pair.row], rank[pair.column]); };
  const auto upper_of = [&](const TilePair& pair) { return std::min(rank[pair.row], rank[pair.column]); };
  // Into ascending columns and, within each, ascending rows: by the row first, then by the column.
  const std::vector<int> by_row = sorted_by(pairs, all, lower_of, count, start),
                         sorted = sorted_by(pairs, by_row, upper_of, count, start);

  stiffness.resize(3 * count, 3 * count);
  stiffness.resizeNonZeros(9 * blocks);
  int* outer = stiffness.outerIndexPtr();
  int* inner = stiffness.innerIndexPtr();
  double* values = stiffness.valuePtr();
  outer[0] = 0;
  const double mu = problem.material.shear_modulus(), lambda = problem.material.lame_lambda();
  std::vector<int> first_entry(pairs.size()); // of a pair's block
  for (int j = 0; j < count; ++j) {
    const int stride = 3 * (start[j + 1] - start[j]);
    for (int b = 0; b < 3; ++b)
      outer[3 * j + b + 1] = 9 * start[j] + stride * (b + 1);
    for (int k = start[j]; k < start[j + 1]; ++k) {
      const int first = first_entry[sorted[k]] = 9 * start[j] + 3 * (k - start[j]);
      const int row = 3 * lower_of(pairs[sorted[k]]);
      for (int b = 0; b < 3; ++b)
        for (int a = 0; a < 3; ++a)
          inner[first + b * stride + a] = row + a;
    }
  }
  const auto stride_of = [&](const TilePair& pair) { return 3 * (start[upper_of(pair) + 1] - start[upper_of(pair)]); };
  // In the order of the tiles, which lie in memory as the pairs do.
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const TilePair& pair = pairs[p];
    Matrix3 block = Matrix3::Zero();
    if (pair.products != nullptr)
      block = pair.stiffness(lambda, mu);
    else if (!dropped.empty() && dropped[pair.row] != 0) // the unknowns stay, alone and without load
      block.diagonal().setConstant(problem.material.young_modulus * problem.nodes.spacings[pair.row]);
    if (rank[pair.row] < rank[pair.column])
      block.transposeInPlace();
    double* to = values + first_entry[p];
    for (int b = 0; b < 3; ++b, to += stride_of(pair))
      for (int a = 0; a < 3; ++a)
        to[a] = block(a, b);
  }
  for (const Anchor& anchor : anchors) {
    const int j = rank[anchor.node], first = 9 * start[j], stride = 3 * (start[j + 1] - start[j]);
    const double spring = problem.material.young_modulus * problem.nodes.spacings[anchor.node];
    for (int b = 0; b < 3; ++b)
      for (int a = 0; a < 3; ++a) // the diagonal block heads its column
        values[first + stride * b + a] += spring * anchor.direction[a] * anchor.direction[b];
  }
  elastic.assign(values, values + 9 * blocks);
  for (std::size_t p = 0; p < pairs.size(); ++p)
    for (int c = 0; c < 3 && pairs[p].held != nullptr; ++c)
      values[first_entry[p] + c * stride_of(pairs[p]) + c] += pairs[p].held[c * tile_nodes];
}

} // namespace spherecut::solvers
