#include "solvers/galerkin/stiffness_kernel.hpp"

namespace spherecut::solvers {

namespace {

/// A value of each row node, wherever they lie in memory; narrower machines take them in parts.
using Lanes = double __attribute__((vector_size(8 * tile_nodes), aligned(8), may_alias));

} // namespace

// One function, compiled for the baseline and for the vector widths of the machine; the loader picks once. Nine sums,
// three rows and three factors are as many registers as AVX2 has.
__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
add_to_tile(const double* rows, std::uint64_t row_points, const double* columns, const std::uint64_t* column_points,
            StiffnessTile& tile) {
  for (int column = 0; column < tile_nodes; ++column) {
    std::uint64_t points = row_points & column_points[column];
    if (points == 0)
      continue;
    Lanes xx{}, xy{}, xz{}, yx{}, yy{}, yz{}, zx{}, zy{}, zz{};
    for (; points != 0; points &= points - 1) {
      const int at = gradients_at_point * __builtin_ctzll(points);
      const double* row = rows + at;
      const double* own = columns + at + column;
      const double jx = own[0], jy = own[tile_nodes], jz = own[2 * tile_nodes];
      const Lanes x = *reinterpret_cast<const Lanes*>(row);
      const Lanes y = *reinterpret_cast<const Lanes*>(row + tile_nodes);
      const Lanes z = *reinterpret_cast<const Lanes*>(row + 2 * tile_nodes);
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
    const auto plane = [&](int p) -> Lanes& { return *reinterpret_cast<Lanes*>(tile.plane[column][p]); };
    plane(0) += xx;
    plane(1) += xy;
    plane(2) += xz;
    plane(3) += yx;
    plane(4) += yy;
    plane(5) += yz;
    plane(6) += zx;
    plane(7) += zy;
    plane(8) += zz;
  }
}

} // namespace spherecut::solvers
