// Material laws for registers of four doubles. Only what follows the target pragma may use AVX2: the headers come
// before it, so that no inline function of theirs is compiled for a machine that may not be there.
#include "solvers/elasticity/law_kernel.hpp"

#include "solvers/elasticity/dual.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#pragma GCC diagnostic ignored "-Wunknown-pragmas" // clang has no target pragma
#pragma GCC push_options
#pragma GCC target("avx2,fma")

namespace spherecut::solvers::law_kernel {
namespace {

constexpr int width = 4;
using Pack __attribute__((vector_size(32))) = double; // __m256d as a template argument

inline Pack root(Pack v) {
  return _mm256_sqrt_pd(v);
}

#include "solvers/elasticity/law_lanes.inl"

} // namespace

#pragma GCC pop_options

const Kernel* avx2() {
  static constexpr Kernel kernel = kernel_of("avx2");
  return &kernel;
}

} // namespace spherecut::solvers::law_kernel

#else

namespace spherecut::solvers::law_kernel {
const Kernel* avx2() {
  return nullptr;
}
} // namespace spherecut::solvers::law_kernel

#endif
