#include "solvers/algebra/parallel.hpp"

#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <fmt/format.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <vector>

namespace spherecut::solvers {

namespace {

constexpr int most_threads = 256;

std::atomic<int>& count_of_process() {
  static std::atomic<int> count{1};
  return count;
}

} // namespace

void set_thread_count(int count) {
  if (count < 1 || count > most_threads)
    throw InputError(fmt::format("{} threads; from 1 to {} can be used", count, most_threads));
  count_of_process() = count;
}

int thread_count() {
  return count_of_process();
}

void parallel_ranges(int count, int grain, const std::function<void(int, int)>& part) {
  const int ranges = (count + grain - 1) / grain, threads = thread_count();
  const auto run = [&](int range) {
    interruption_point();
    part(range * grain, std::min(count, (range + 1) * grain));
  };
  const bool winds_up = WindingUp::of_this_thread();
  if (threads == 1 || ranges <= 1) {
    for (int range = 0; range < ranges; ++range)
      run(range);
    return;
  }
  std::vector<std::exception_ptr> failures(static_cast<std::size_t>(ranges));
  tbb::task_arena arena(std::min(threads, tbb::info::default_concurrency()));
  arena.execute([&] {
    tbb::parallel_for(
        0, ranges,
        [&](int range) {
          try {
            const WindingUp as_caller(winds_up);
            run(range);
          } catch (...) {
            failures[static_cast<std::size_t>(range)] = std::current_exception();
          }
        },
        tbb::simple_partitioner());
  });
  for (const std::exception_ptr& failure : failures)
    if (failure)
      std::rethrow_exception(failure);
}

} // namespace spherecut::solvers
