#include "solvers/shape_kernel.hpp"

namespace spherecut::solvers::shape_kernel {

const Kernel& dispatched() {
  return portable();
}

} // namespace spherecut::solvers::shape_kernel
