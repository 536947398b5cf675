// Memory in large pages for what is megabytes at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace spherecut::solvers {

/// As std::malloc; from 4 MiB on aligned to pages of 2 MiB, and Linux is asked to back it by such. To be freed by
/// std::free. A factor written for the first time in small pages costs a fault every 4 KiB, a sixth of a
/// factorisation of 2000 nodes.
void* allocate_in_large_pages(std::size_t bytes) noexcept;

/// The same for containers.
template <typename T>
struct InLargePages {
  using value_type = T;
  InLargePages() = default;
  template <typename U>
  InLargePages(const InLargePages<U>&) {}
  T* allocate(std::size_t count) {
    void* const memory = count > SIZE_MAX / sizeof(T) ? nullptr : allocate_in_large_pages(count * sizeof(T));
    if (memory == nullptr)
      throw std::bad_alloc();
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t) { std::free(memory); }
  bool operator==(const InLargePages&) const = default;
};

} // namespace spherecut::solvers
