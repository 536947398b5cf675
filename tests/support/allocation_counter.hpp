// Counts the heap allocations of the calling thread, for code that promises none. Linking this replaces operator new.
#pragma once

#include <cstddef>

namespace spherecut::tests {

/// Number of calls of operator new by this thread so far.
std::size_t allocations() noexcept;

} // namespace spherecut::tests
