// The shape kernel for registers of four doubles. Only what follows the target pragma may use AVX2: the headers come
// before it, so that no inline function of theirs is compiled for a machine that may not be there.
#include "solvers/shapes/kernel.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#pragma GCC diagnostic ignored "-Wunknown-pragmas" // clang has no target pragma
#pragma GCC push_options
#pragma GCC target("avx2,fma")

namespace spherecut::solvers::shape_kernel {
namespace {

constexpr int width = 4;
using Pack __attribute__((vector_size(32))) = double; // __m256d as a template argument

inline Pack root(Pack v) {
  return _mm256_sqrt_pd(v);
}

// A bit for every lane that is below one.
inline unsigned below_one(Pack v) {
  return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(v, _mm256_set1_pd(1), _CMP_LT_OQ)));
}

// Entry m of `pick` moves the lanes whose bit is set in m to the front: positions of lanes, and of their 32-bit halves.
struct Compression {
  alignas(32) int halves[16][8];
  alignas(16) int lanes[16][4];
};
constexpr Compression make_compression() {
  Compression table{};
  for (int mask = 0; mask < 16; ++mask) {
    int n = 0;
    for (int lane = 0; lane < 4; ++lane)
      if ((mask >> lane) & 1) {
        table.lanes[mask][n] = lane;
        table.halves[mask][2 * n] = 2 * lane;
        table.halves[mask][2 * n + 1] = 2 * lane + 1;
        ++n;
      }
  }
  return table;
}
constexpr Compression compression = make_compression();

inline void compress(double* to, Pack v, __m256i order) {
  _mm256_storeu_pd(to, _mm256_castsi256_pd(_mm256_permutevar8x32_epi32(_mm256_castpd_si256(v), order)));
}

void collect(const SphereGrid::Cell& cell, const double* point, Support& support) {
  const Pack px = _mm256_set1_pd(point[0]), py = _mm256_set1_pd(point[1]), pz = _mm256_set1_pd(point[2]);
  const int* ids = cell.ids.data();
  int n = 0;
  for (int k = 0; k < cell.padded; k += width) {
    const Pack x = _mm256_load_pd(cell.x + k) - px, y = _mm256_load_pd(cell.y + k) - py;
    const Pack z = _mm256_load_pd(cell.z + k) - pz, q = _mm256_load_pd(cell.inverse_square_radius + k);
    const int mask = _mm256_movemask_pd(_mm256_cmp_pd((x * x + y * y + z * z) * q, _mm256_set1_pd(1), _CMP_LT_OQ));
    const __m256i order = _mm256_load_si256(reinterpret_cast<const __m256i*>(compression.halves[mask]));
    compress(support.dx + n, x, order);
    compress(support.dy + n, y, order);
    compress(support.dz + n, z, order);
    compress(support.q + n, q, order);
    const __m128i lane = _mm_load_si128(reinterpret_cast<const __m128i*>(compression.lanes[mask]));
    const __m128i id = _mm_loadu_si128(reinterpret_cast<const __m128i*>(ids + k));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(support.ids + n),
                     _mm_castps_si128(_mm_permutevar_ps(_mm_castsi128_ps(id), lane)));
    n += __builtin_popcount(static_cast<unsigned>(mask));
  }
  support.count = n;
  for (int k = n; k < n + SphereGrid::lanes; k += width) {
    _mm256_storeu_pd(support.dx + k, _mm256_set1_pd(1));
    _mm256_storeu_pd(support.dy + k, _mm256_setzero_pd());
    _mm256_storeu_pd(support.dz + k, _mm256_setzero_pd());
    _mm256_storeu_pd(support.q + k, _mm256_set1_pd(1));
  }
}

#include "solvers/shapes/kernel_lanes.inl"

#include "solvers/shapes/kernel_moments.inl"

} // namespace

#pragma GCC pop_options

const Kernel* avx2() {
  static constexpr Kernel kernel{
      "avx2", width, collect, evaluate<false>, evaluate<true>, find_inside, gradients_at_points, solve_moments};
  return &kernel;
}

} // namespace spherecut::solvers::shape_kernel

#else

namespace spherecut::solvers::shape_kernel {
const Kernel* avx2() {
  return nullptr;
}
} // namespace spherecut::solvers::shape_kernel

#endif
