// Loops over independent parts of a body, shared among threads. What a loop computes does not depend on how many there
// are: every part writes only what is its own, and sums are taken in a fixed order afterwards.
#pragma once

#include <functional>

namespace spherecut::solvers {

/// Threads that the loops of this process may use, the calling one included; 1 unless set, and never more than cores.
/// Throws InputError outside 1 .. 256.
void set_thread_count(int count);
[[nodiscard]] int thread_count();

/// part(begin, end) for ranges of at most `grain` that make up 0 .. count - 1. Returns when all are done; of the
/// exceptions they throw, the one of the first range.
void parallel_ranges(int count, int grain, const std::function<void(int begin, int end)>& part);

} // namespace spherecut::solvers
