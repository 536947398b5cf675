#include "src/process_settings.hpp"

#include <dlfcn.h>
#include <limits>
#include <malloc.h>

namespace spherecut::app {

void use_one_blas_thread() {
  using SetThreads = void (*)(int);
  if (void* const found = dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))
    reinterpret_cast<SetThreads>(found)(1);
}

void keep_freed_memory() {
  // From the heap up to the largest block, and no part of the heap given back. One heap for all threads: those of the
  // others are cut up in pieces of 64 MB, above which every block would be mapped and unmapped again.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  mallopt(M_TOP_PAD, 16 << 20);
  mallopt(M_ARENA_MAX, 1);
}

} // namespace spherecut::app
