#include "solvers/algebra/parallel.hpp"

#include "solvers/galerkin/galerkin.hpp"
#include "tests/support/cut_block.hpp"
#include "topology/base/errors.hpp"

#include <atomic>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// Threads for the length of a test.
struct Threads {
  explicit Threads(int count) { set_thread_count(count); }
  ~Threads() { set_thread_count(1); }
};

} // namespace

TEST_CASE("A parallel loop does every part once, and fails as a loop in order would") {
  for (const int threads : {1, 2, 5}) {
    const Threads used(threads);
    for (const int count : {0, 1, 7, 64, 1001})
      for (const int grain : {1, 8, 5000}) {
        std::vector<std::atomic<int>> done(static_cast<std::size_t>(count));
        parallel_ranges(count, grain, [&](int begin, int end) {
          CHECK(end - begin <= grain);
          for (int i = begin; i < end; ++i)
            ++done[i];
        });
        CHECK(std::all_of(done.begin(), done.end(), [](const std::atomic<int>& times) { return times == 1; }));
      }
    CHECK_THROWS_WITH(parallel_ranges(100, 3,
                                      [](int begin, int) {
                                        if (begin >= 30)
                                          throw NumericalError("range " + std::to_string(begin));
                                      }),
                      "range 30");
  }
  CHECK_THROWS_AS(set_thread_count(0), InputError);
  CHECK_THROWS_AS(set_thread_count(257), InputError);
}

TEST_CASE("The matrix of a cut body has the same bits whatever the number of threads") {
  const tests::CutBlock block = tests::cut_block(7, false, 3);
  const auto matrix = [&](int threads) {
    const Threads used(threads);
    Problem problem = tests::problem_of(block, {1000, 0.4, 0});
    for (int i = 0; i < block.nodes.size(); ++i)
      if (block.nodes.kinds[i] != NodeKind::interior && block.nodes.positions[i].z() < -0.5 + 1e-9)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.z() < -0.49; };
    const auto body = discretise(std::move(problem), {});
    return SparseMatrix(stiffness_of(*body).lower);
  };
  const SparseMatrix one = matrix(1);
  for (const int threads : {2, 3}) {
    const SparseMatrix many = matrix(threads);
    REQUIRE(many.nonZeros() == one.nonZeros());
    CHECK(std::equal(one.valuePtr(), one.valuePtr() + one.nonZeros(), many.valuePtr()));
    CHECK(std::equal(one.innerIndexPtr(), one.innerIndexPtr() + one.nonZeros(), many.innerIndexPtr()));
  }
}
