// Memory in large pages for what is megabytes at a time.
#pragma once

#include <cstddef>

namespace spherecut::solvers {

/// As std::malloc; from 4 MiB on aligned to pages of 2 MiB, and Linux is asked to back it by such. To be freed by
/// std::free. A factor written for the first time in small pages costs a fault every 4 KiB, a sixth of a
/// factorisation of 2000 nodes.
void* allocate_in_large_pages(std::size_t bytes) noexcept;

} // namespace spherecut::solvers
