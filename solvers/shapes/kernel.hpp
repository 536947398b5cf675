// The hot loop of the shape functions: collect the support of a point and evaluate the linear basis there. Compiled
// once for any x86-64 (or other) machine and again for AVX2 and AVX-512; the widest that the machine has is chosen
// once.
//
// Key: d_j = x_j - x, q_j = 1 / R_j^2, s_j = |d_j| / R_j, W quartic spline, P_j = {1, d_j / l} with a local length l,
// A = sum_j W_j P_j P_j^T, h_j shape function of node j.
#pragma once

#include "solvers/shapes/functions.hpp"

namespace spherecut::solvers::shape_kernel {

/// The support of a point as structure of arrays with room for a multiple of SphereGrid::lanes. Entries from `count` up
/// to that multiple hold d = (1, 0, 0), q = 1, where the weight and all its derivatives vanish.
struct Support {
  int count;
  int* ids;
  double *dx, *dy, *dz; // m
  double* q;            // 1/m2
};

/// Where the kernel writes; every array has room for the padded support.
struct LinearOutput {
  double *value, *dx, *dy, *dz;
  std::array<double*, 6> second; // xx yy zz xy xz yz
};

/// A sphere where it stands: centre, m, and 1 / R^2, 1/m2.
struct Sphere {
  double x, y, z, q;
};

inline constexpr int points_together = 8;

/// Points that share their candidates. Gradients there are multiplied by `factor`.
struct Points {
  alignas(64) double x[points_together], y[points_together], z[points_together], factor[points_together];
};

/// Moving least squares of one point near a cut, whose weights follow ways around its front. Arrays have room for a
/// multiple of SphereGrid::lanes; up to there the weights and their gradients are 0 and the basis functions finite.
struct Moments {
  int count;
  const double* weight;
  const double* weight_gradient[3]; // 1/m
  const double* basis[7];           // those after the constant: d / l, and with `enriched` b_1 .. b_4
  bool enriched;
  double slope;              // 1/m, of the first three along their axes
  double branch_slope[4][3]; // 1/m, of b_1 .. b_4
  double share;              // of the enriched shape functions, the rest are plain ones; 0 to 1
  double share_gradient[3];  // 1/m
  double flattest;           // least product of the principal spreads of the support over that of a ball, squares
};

struct Kernel {
  const char* name;
  int width; // doubles per register
  /// Writes the members of the cell that hold the point, in the cell's order.
  void (*collect)(const SphereGrid::Cell& cell, const double* point, Support& support);
  /// Shape functions and gradients; returns the 1-norm condition of the scaled moment matrix (not finite, or huge, when
  /// the matrix is singular: the outputs are then meaningless). LinearOutput::second is not used.
  double (*evaluate_linear)(const Support& support, const LinearOutput& output);
  /// The same with second derivatives.
  double (*evaluate_linear_second)(const Support& support, const LinearOutput& output);
  /// Bit p of inside[k]: sphere k holds point p.
  void (*find_inside)(const Sphere* spheres, int count, const Points& points, std::uint8_t* inside);
  /// Gradients of the linear basis at all points together: of sphere k along `axis` at point p in
  /// gradients[(3 k + axis) stride + p], zero where the sphere does not hold the point, and the condition at each point
  /// as evaluate_linear gives it. `spheres` are all that hold any of the points.
  void (*gradients_at_points)(const Sphere* spheres, int count, const Points& points, int stride, double* gradients,
                              double* condition);
  /// Returns the 1-norm condition of the moment matrix scaled to a unit diagonal (of the enriched one where it counts);
  /// infinite, with outputs that mean nothing, where it is singular. LinearOutput::second is not used.
  double (*solve_moments)(const Moments& moments, const LinearOutput& output);
};

/// Runs everywhere.
const Kernel& portable();
/// For machines with AVX2 and FMA, or AVX-512 (F, DQ, VL); null when the program was built for another architecture.
const Kernel* avx2();
const Kernel* avx512();
/// The widest kernel this machine can run.
const Kernel& dispatched();

/// Shape functions on a given support, in place of what `out` held; allocates only where the arrays of `out` are too
/// small. False when the support has fewer nodes than basis functions or is worse conditioned than allowed.
bool evaluate_support(const Kernel& kernel, const Support& support, Basis basis, bool second, double worst_condition,
                      ShapeFunctions& out);

/// Does what solvers::evaluate does for the linear basis, with a given kernel.
bool evaluate_with(const Kernel& kernel, const Spheres& spheres, const Vector3& x, ShapeFunctions& out);

} // namespace spherecut::solvers::shape_kernel
