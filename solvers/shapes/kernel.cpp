#include "solvers/shapes/kernel.hpp"

namespace spherecut::solvers::shape_kernel {

namespace {

const Kernel& widest() {
#if defined(__x86_64__) && defined(__GNUC__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return *avx512();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return *avx2();
#endif
  return portable();
}

} // namespace

const Kernel& dispatched() {
  static const Kernel& chosen = widest();
  return chosen;
}

} // namespace spherecut::solvers::shape_kernel
