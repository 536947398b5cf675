#include "src/base/process_settings.hpp"

#include <dlfcn.h>
#include <limits>
#include <malloc.h>
#include <new>
#include <sys/mman.h>
#include <vector>

namespace spherecut::app {
namespace {

constexpr std::size_t blas_buffer = std::size_t{160} << 20U; // bytes: more than OpenBLAS asks for, with what it aligns

} // namespace

void use_one_blas_thread() {
  using SetThreads = void (*)(int);
  if (void* const found = dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))
    reinterpret_cast<SetThreads>(found)(1);
}

void reserve_blas_memory(int threads) {
  using Take = void* (*)(int);
  using Give = void (*)(void*);
  auto* const take = reinterpret_cast<Take>(dlsym(RTLD_DEFAULT, "blas_memory_alloc"));
  auto* const give = reinterpret_cast<Give>(dlsym(RTLD_DEFAULT, "blas_memory_free"));
  if (take == nullptr || give == nullptr) // another BLAS
    return;
  std::vector<void*> taken;
  bool enough = true;
  for (int i = 0; i < threads && enough; ++i) {
    // It is asked for one only where one can be had.
    void* const room = ::mmap(nullptr, blas_buffer, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    enough = room != MAP_FAILED;
    if (!enough)
      break;
    ::munmap(room, blas_buffer);
    taken.push_back(take(0));
  }
  for (void* const buffer : taken)
    give(buffer);
  if (!enough)
    throw std::bad_alloc();
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
