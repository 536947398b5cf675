// Material laws for registers of two doubles, which every x86-64 and AArch64 machine has.
#include "solvers/elasticity/law_kernel.hpp"

#include "solvers/elasticity/dual.hpp"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace spherecut::solvers::law_kernel {
namespace {

constexpr int width = 2;
using Pack __attribute__((vector_size(16))) = double;

#ifdef __SSE2__
inline Pack root(Pack v) {
  return _mm_sqrt_pd(v);
}
#else
inline Pack root(Pack v) {
  return Pack{__builtin_sqrt(v[0]), __builtin_sqrt(v[1])};
}
#endif

#include "solvers/elasticity/law_lanes.inl"

} // namespace

const Kernel& portable() {
  static constexpr Kernel kernel = kernel_of("portable");
  return kernel;
}

} // namespace spherecut::solvers::law_kernel
