// Batches of a law. Compiled once for any machine and again for AVX2 and AVX-512; the widest that the machine has is
// chosen once. Plain numbers alone pass here: nothing compiled for a wide instruction set may reach other units.
#pragma once

#include <cstddef>

namespace spherecut::solvers::law_kernel {

/// Points to evaluate and where the results go; arrays are column-major, point after point.
struct Batch {
  const double* constants; // of the law's model, in the order of its constructor
  double bulk;             // Pa; 0: without U
  std::size_t count;
  const double* gradients;  // nine each
  const double* frames;     // six each
  std::size_t frame_stride; // 6, or 0: one frame for all points
  double* energy;
  double* stress; // nine each
};

using Evaluate = void (*)(const Batch& batch);

struct Kernel {
  const char* name;
  int width;            // points together
  Evaluate evaluate[5]; // in the order of LawSpec::law
};

/// Runs everywhere.
const Kernel& portable();
/// Null where the program was built for another architecture.
const Kernel* avx2();
const Kernel* avx512();
/// The widest kernel this machine can run.
const Kernel& dispatched();

} // namespace spherecut::solvers::law_kernel
