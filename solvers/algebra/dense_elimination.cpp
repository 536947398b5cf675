#include "solvers/algebra/dense_elimination.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

// The memory of a system: n rows of `width` entries, four panel columns of `padded` entries, n solution rows of eight.
struct Layout {
  double *matrix, *panel, *solution;
  int n, right, width, padded;
  [[nodiscard]] double* row(int i) const { return matrix + static_cast<long>(i) * width; }
};

int blocks_for(int entries) {
  return (entries + 7) / 8;
}

namespace portable_elimination {
#include "solvers/algebra/dense_elimination.inl"
} // namespace portable_elimination

#if defined(__x86_64__) && defined(__GNUC__)

#pragma GCC diagnostic ignored "-Wunknown-pragmas" // clang has no target pragma
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace avx2_elimination {
#include "solvers/algebra/dense_elimination.inl"
} // namespace avx2_elimination
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx2,fma,avx512f,avx512dq,avx512vl,prefer-vector-width=512")
namespace avx512_elimination {
#include "solvers/algebra/dense_elimination.inl"
} // namespace avx512_elimination
#pragma GCC pop_options

#endif

using Solve = EliminationResult (*)(const Layout&);

Solve widest() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return avx512_elimination::solve;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return avx2_elimination::solve;
#endif
  return portable_elimination::solve;
}

} // namespace

DenseSystem::DenseSystem(int unknowns, int right_hand_sides)
    : n_(unknowns), right_(right_hand_sides), width_(8 * blocks_for(unknowns + right_hand_sides)) {
  constexpr int most_unknowns = 10000;
  if (n_ < 1 || n_ > most_unknowns || right_ < 1 || right_ > most_right)
    throw InputError(fmt::format("dense system of {} unknowns and {} right-hand sides; the limits are {} and {}", n_,
                                 right_, most_unknowns, most_right));
  matrix_.resize(static_cast<std::size_t>(n_) * blocks_for(n_ + right_));
  panel_.resize(4 * static_cast<std::size_t>(blocks_for(n_)));
  solution_.resize(n_);
}

void DenseSystem::clear() noexcept {
  std::fill_n(row(0), static_cast<std::ptrdiff_t>(n_) * width_, 0.0);
}

EliminationResult DenseSystem::solve() noexcept {
  static const Solve chosen = widest();
  return chosen({row(0), panel_.data()->data(), solution_.data()->data(), n_, right_, width_, 8 * blocks_for(n_)});
}

EliminationResult DenseSystem::solve_portable() noexcept {
  return portable_elimination::solve(
      {row(0), panel_.data()->data(), solution_.data()->data(), n_, right_, width_, 8 * blocks_for(n_)});
}

} // namespace spherecut::solvers
