// Inner loop of the weak form: products of shape function derivatives summed over points, four by four nodes at a time.
#pragma once

#include <cstdint>

namespace spherecut::solvers {

inline constexpr int tile_nodes = 4;   // in a group, along either side of a tile
inline constexpr int tile_points = 64; // most points that are added up in one call
/// Gradients of a group of nodes at one point: x, y, z derivative, each of the four nodes.
inline constexpr int gradients_at_point = 3 * tile_nodes;

/// Of four column nodes J and four row nodes I: plane[J][3 a + b][I] = sum_q w_q dI,a dJ,b.
struct StiffnessTile {
  alignas(32) double plane[tile_nodes][9][tile_nodes];
};

/// tile += sum over points. `rows` and `columns` hold `gradients_at_point` values a point, multiplied by
/// sqrt(w_q). Bit q of `row_points`: some row node reaches point q; of column_points[J]: column node J does. Points
/// that either does not reach are not looked at; where the one reaches and the other does not, its zeros are.
void add_to_tile(const double* rows, std::uint64_t row_points, const double* columns,
                 const std::uint64_t* column_points, StiffnessTile& tile);

} // namespace spherecut::solvers
