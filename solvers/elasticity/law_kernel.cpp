#include "solvers/elasticity/law_kernel.hpp"

namespace spherecut::solvers::law_kernel {
namespace {

const Kernel& widest_kernel() {
#if defined(__x86_64__) && defined(__GNUC__)
  __builtin_cpu_init();
  if (avx512() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return *avx512();
  if (avx2() && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return *avx2();
#endif
  return portable();
}

} // namespace

const Kernel& dispatched() {
  static const Kernel& chosen = widest_kernel();
  return chosen;
}

} // namespace spherecut::solvers::law_kernel
