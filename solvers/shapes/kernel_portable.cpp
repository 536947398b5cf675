// The shape kernel for registers of two doubles, which every x86-64 and AArch64 machine has.
#include "solvers/shapes/kernel.hpp"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace spherecut::solvers::shape_kernel {
namespace {

constexpr int width = 2;
using Pack __attribute__((vector_size(16))) = double;

#ifdef __SSE2__
inline Pack root(Pack v) {
  return _mm_sqrt_pd(v);
}
inline unsigned below_one(Pack v) {
  return static_cast<unsigned>(_mm_movemask_pd(_mm_cmplt_pd(v, _mm_set1_pd(1))));
}
#else
inline Pack root(Pack v) {
  return Pack{__builtin_sqrt(v[0]), __builtin_sqrt(v[1])};
}
inline unsigned below_one(Pack v) {
  return (v[0] < 1 ? 1U : 0U) | (v[1] < 1 ? 2U : 0U);
}
#endif

#include "solvers/shapes/kernel_lanes.inl"

#include "solvers/shapes/kernel_moments.inl"

// First which candidates hold the point: every place is written at the end of the list and the end moves on only past
// those that do, so that there is no branch. Then these alone are copied.
void collect(const SphereGrid::Cell& cell, const double* point, Support& support) {
  const int candidates = static_cast<int>(cell.ids.size());
  int n = 0;
  for (int k = 0; k < candidates; k += width) { // entries beyond the last hold no point
    const Pack x = load(cell.x + k) - point[0], y = load(cell.y + k) - point[1], z = load(cell.z + k) - point[2];
    const unsigned inside = below_one((x * x + y * y + z * z) * load(cell.inverse_square_radius + k));
    support.ids[n] = k;
    n += static_cast<int>(inside & 1U);
    support.ids[n] = k + 1;
    n += static_cast<int>(inside >> 1U);
  }
  int* const ids = support.ids;
  double *const dx = support.dx, *const dy = support.dy, *const dz = support.dz, *const q = support.q;
  for (int i = 0; i < n; ++i) {
    const int k = ids[i];
    dx[i] = cell.x[k] - point[0];
    dy[i] = cell.y[k] - point[1];
    dz[i] = cell.z[k] - point[2];
    q[i] = cell.inverse_square_radius[k];
    ids[i] = cell.ids[k];
  }
  support.count = n;
  for (int k = n; k < n + SphereGrid::lanes; ++k) {
    support.dx[k] = support.q[k] = 1;
    support.dy[k] = support.dz[k] = 0;
  }
}

} // namespace

const Kernel& portable() {
  static constexpr Kernel kernel{
      "portable", width, collect, evaluate<false>, evaluate<true>, find_inside, gradients_at_points, solve_moments};
  return kernel;
}

} // namespace spherecut::solvers::shape_kernel
