// The shape kernel for registers of eight doubles. Only what follows the target pragma may use AVX-512: the headers
// come before it, so that no inline function of theirs is compiled for a machine that may not be there.
#include "solvers/shapes/kernel.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#pragma GCC diagnostic ignored "-Wunknown-pragmas" // clang has no target pragma
#pragma GCC push_options
#pragma GCC target("avx2,fma,popcnt,avx512f,avx512dq,avx512vl")

namespace spherecut::solvers::shape_kernel {
namespace {

constexpr int width = 8;
using Pack __attribute__((vector_size(64))) = double; // __m512d as a template argument

// All lanes kept by the mask: the unmasked intrinsic of GCC 12 warns of its own uninitialised operand.
inline Pack root(Pack v) {
  return _mm512_maskz_sqrt_pd(0xff, v);
}

// A bit for every lane that is below one.
inline unsigned below_one(Pack v) {
  return _mm512_cmp_pd_mask(v, _mm512_set1_pd(1), _CMP_LT_OQ);
}

// Compressed in the register and stored whole: compressing stores are slow on some machines.
inline void compress(double* to, Pack v, __mmask8 mask) {
  _mm512_storeu_pd(to, _mm512_maskz_compress_pd(mask, v));
}

void collect(const SphereGrid::Cell& cell, const double* point, Support& support) {
  const Pack px = _mm512_set1_pd(point[0]), py = _mm512_set1_pd(point[1]), pz = _mm512_set1_pd(point[2]);
  const int* ids = cell.ids.data();
  int n = 0;
  for (int k = 0; k < cell.padded; k += width) {
    const Pack x = _mm512_load_pd(cell.x + k) - px, y = _mm512_load_pd(cell.y + k) - py;
    const Pack z = _mm512_load_pd(cell.z + k) - pz, q = _mm512_load_pd(cell.inverse_square_radius + k);
    const __mmask8 mask = _mm512_cmp_pd_mask((x * x + y * y + z * z) * q, _mm512_set1_pd(1), _CMP_LT_OQ);
    compress(support.dx + n, x, mask);
    compress(support.dy + n, y, mask);
    compress(support.dz + n, z, mask);
    compress(support.q + n, q, mask);
    const __m256i id = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(ids + k));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(support.ids + n), _mm256_maskz_compress_epi32(mask, id));
    n += __builtin_popcount(mask);
  }
  support.count = n;
  _mm512_storeu_pd(support.dx + n, _mm512_set1_pd(1));
  _mm512_storeu_pd(support.dy + n, _mm512_setzero_pd());
  _mm512_storeu_pd(support.dz + n, _mm512_setzero_pd());
  _mm512_storeu_pd(support.q + n, _mm512_set1_pd(1));
}

#include "solvers/shapes/kernel_lanes.inl"

#include "solvers/shapes/kernel_moments.inl"

} // namespace

#pragma GCC pop_options

const Kernel* avx512() {
  static constexpr Kernel kernel{
      "avx512", width, collect, evaluate<false>, evaluate<true>, find_inside, gradients_at_points, solve_moments};
  return &kernel;
}

} // namespace spherecut::solvers::shape_kernel

#else

namespace spherecut::solvers::shape_kernel {
const Kernel* avx512() {
  return nullptr;
}
} // namespace spherecut::solvers::shape_kernel

#endif
