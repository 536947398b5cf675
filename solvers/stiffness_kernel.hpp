// Inner loop of the weak form: one block column of a cell's stiffness, vectorised over the rows.
#pragma once

namespace spherecut::solvers {

/// Longest column the kernel takes (a multiple of 8); supports of one background cell stay well below.
inline constexpr int stiffness_kernel_rows = 512;
/// Most points of one call: those of a cluster of cells.
inline constexpr int stiffness_kernel_points = 64;

/// Nine planes of `rows` values: plane 3 a + b holds entry (a, b) of the block of each row node.
struct StiffnessColumn {
  alignas(64) double plane[9][stiffness_kernel_rows];
};

/// For row nodes I = first .. count-1 and column node J of a cell or a cluster of cells,
///   block(I, J) = sum_q s_q w_q [lambda gI gJ^T + mu gJ gI^T + mu (gI . gJ) 1].
/// `signs`: s_q of every point, null for 1.
/// `gradients` holds for each point q three arrays of `stride` values (x, y, z derivative of every node's shape
/// function), already multiplied by sqrt(w_q); entries up to the next multiple of 8 after `count` must exist and be
/// finite.
void stiffness_column(const double* gradients, const double* signs, int points, int stride, int first, int count,
                      int column, double lambda, double mu, StiffnessColumn& out);

} // namespace spherecut::solvers
