#include "solvers/stiffness_kernel.hpp"

namespace spherecut::solvers {

namespace {

/// Eight rows at once, wherever they lie in memory; narrower machines take them in parts.
using Lanes = double __attribute__((vector_size(64), aligned(8), may_alias));
constexpr int lane_count = 8;

} // namespace

// One function, compiled for the baseline and for the vector widths of the machine; the loader picks once.
__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
stiffness_column(const double* gradients, const double* signs, int points, int stride, int first, int count, int column,
                 double lambda, double mu, StiffnessColumn& out) {
  // A point that the column's sphere does not reach adds nothing, whatever the row.
  struct Reached {
    const double* gradients;
    double x, y, z; // of the column
  };
  Reached reached[stiffness_kernel_points];
  int reached_count = 0;
  for (int q = 0; q < points; ++q) {
    const double* point = gradients + static_cast<long>(3 * q) * stride;
    const double* own = point + column;
    const double sign = signs == nullptr ? 1 : signs[q];
    if (own[0] != 0 || own[stride] != 0 || own[2 * stride] != 0)
      reached[reached_count++] = {point, sign * own[0], sign * own[stride], sign * own[2 * stride]};
  }
  const double both = lambda + mu;
  for (int block = first & ~(lane_count - 1); block < count; block += lane_count) {
    Lanes xx{}, xy{}, xz{}, yx{}, yy{}, yz{}, zx{}, zy{}, zz{};
    for (int k = 0; k < reached_count; ++k) {
      const double* point = reached[k].gradients;
      const double jx = reached[k].x, jy = reached[k].y, jz = reached[k].z;
      const Lanes x = *reinterpret_cast<const Lanes*>(point + block);
      const Lanes y = *reinterpret_cast<const Lanes*>(point + stride + block);
      const Lanes z = *reinterpret_cast<const Lanes*>(point + 2 * stride + block);
      xx += x * jx;
      xy += x * jy;
      xz += x * jz;
      yx += y * jx;
      yy += y * jy;
      yz += y * jz;
      zx += z * jx;
      zy += z * jy;
      zz += z * jz;
    }
    const Lanes trace = mu * (xx + yy + zz);
    const auto plane = [&](int p) -> Lanes& { return *reinterpret_cast<Lanes*>(out.plane[p] + block); };
    plane(0) = both * xx + trace;
    plane(1) = lambda * xy + mu * yx;
    plane(2) = lambda * xz + mu * zx;
    plane(3) = lambda * yx + mu * xy;
    plane(4) = both * yy + trace;
    plane(5) = lambda * yz + mu * zy;
    plane(6) = lambda * zx + mu * xz;
    plane(7) = lambda * zy + mu * yz;
    plane(8) = both * zz + trace;
  }
}

} // namespace spherecut::solvers
