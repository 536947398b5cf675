// Inner loops of a body at finite strain: deformation gradients at eight points, and the forces of their stresses.
#pragma once

#include "solvers/points/point_table.hpp"

namespace spherecut::solvers {

/// F = I + sum_J u_J (x) g_J at the points of a group, entry (i, j) at i + 3 j. `coefficients`: 3 a node, m.
void deformation_gradients(const int* nodes, int count, const LaneValues* gradients, const double* coefficients,
                           LaneValues* deformation);

/// Calls act(group, lane, F) for every point that weighs something, the groups in order.
template <class Act>
void for_each_deformation(const PointTable& table, const VectorX& coefficients, const Act& act) {
  for (int group = 0; group < table.groups(); ++group) {
    const std::span<const int> nodes = table.nodes_of(group);
    LaneValues f[9];
    deformation_gradients(nodes.data(), static_cast<int>(nodes.size()), table.gradients_of(group), coefficients.data(),
                          f);
    for (int lane = 0; lane < table.count[group]; ++lane) {
      Matrix3 deformation;
      for (int k = 0; k < 9; ++k)
        deformation.data()[k] = f[k].value[lane];
      act(group, lane, deformation);
    }
  }
}

/// forces[3 k + i] = sum over points and j of stress(i, j) g_kj, `stress` with the weights in it, N.
void group_forces(int count, const LaneValues* gradients, const LaneValues* stress, double* forces);

/// What of a vector a node no linear function has, at the points of a group: change[3 k + a] = v_ka - p_k . M^-1 sum_l
/// p_l v_la over the nodes that reach the point, with p = (1, scale (x_k - x)). A node reaches a point where its
/// gradient is not zero. `vectors`: 3 a node of the body; `inverse`: the ten entries of the upper triangle of M^-1, row
/// by row.
void take_linear(const int* nodes, int count, const LaneValues* gradients, const Vector3* places, const Vector3* points,
                 double scale, const LaneValues* inverse, const double* vectors, LaneValues* change);

/// The matrix of the same, summed over the points of a group with their weights: matrix[count k + l] = sum_q w_q (d_kl
/// - p_k . M^-1 p_l) over the points that both reach.
void linear_leftover(const int* nodes, int count, const LaneValues* gradients, const Vector3* places,
                     const Vector3* points, double scale, const LaneValues* inverse, const LaneValues& weights,
                     double* matrix);

} // namespace spherecut::solvers
