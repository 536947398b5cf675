// Material laws for registers of eight doubles. Only what follows the target pragma may use AVX-512: the headers come
// before it, so that no inline function of theirs is compiled for a machine that may not be there.
#include "solvers/elasticity/law_kernel.hpp"

#include "solvers/elasticity/dual.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#pragma GCC diagnostic ignored "-Wunknown-pragmas" // clang has no target pragma
#pragma GCC push_options
#pragma GCC target("avx2,fma,avx512f,avx512dq,avx512vl")

namespace spherecut::solvers::law_kernel {
namespace {

constexpr int width = 8;
using Pack __attribute__((vector_size(64))) = double; // __m512d as a template argument

// All lanes kept by the mask: the unmasked intrinsic of GCC 12 warns of its own uninitialised operand.
inline Pack root(Pack v) {
  return _mm512_maskz_sqrt_pd(0xff, v);
}

#include "solvers/elasticity/law_lanes.inl"

} // namespace

#pragma GCC pop_options

const Kernel* avx512() {
  static constexpr Kernel kernel = kernel_of("avx512");
  return &kernel;
}

} // namespace spherecut::solvers::law_kernel

#else

namespace spherecut::solvers::law_kernel {
const Kernel* avx512() {
  return nullptr;
}
} // namespace spherecut::solvers::law_kernel

#endif
