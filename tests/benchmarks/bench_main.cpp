// The benchmarks run under the settings of the program.
#include "src/base/process_settings.hpp"

#include <benchmark/benchmark.h>

int main(int argc, char** argv) {
  spherecut::app::use_one_blas_thread();
  spherecut::app::keep_freed_memory();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv))
    return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
