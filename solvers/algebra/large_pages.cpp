#include "solvers/algebra/large_pages.hpp"

#include <cstdlib>
#include <sys/mman.h>

namespace spherecut::solvers {

void* allocate_in_large_pages(std::size_t bytes) noexcept {
  constexpr std::size_t page = std::size_t{2} << 20, fewest = 2 * page;
  if (bytes < fewest)
    return std::malloc(bytes);
  const std::size_t rounded = (bytes + page - 1) / page * page;
  if (rounded < bytes)
    return nullptr;
  void* const memory = std::aligned_alloc(page, rounded);
  if (memory != nullptr)
    madvise(memory, rounded, MADV_HUGEPAGE); // where the kernel declines, the pages are small ones
  return memory;
}

} // namespace spherecut::solvers
