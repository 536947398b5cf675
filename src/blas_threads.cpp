#include "src/blas_threads.hpp"

#include <dlfcn.h>

namespace spherecut::app {

void use_one_blas_thread() {
  using SetThreads = void (*)(int);
  if (void* const found = dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))
    reinterpret_cast<SetThreads>(found)(1);
}

} // namespace spherecut::app
