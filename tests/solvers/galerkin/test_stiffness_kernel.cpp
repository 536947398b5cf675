#include "solvers/galerkin/stiffness_kernel.hpp"

#include "solvers/galerkin/stiffness_tiles.hpp"
#include "topology/base/types.hpp"

#include <catch2/catch.hpp>
#include <memory>
#include <random>

using namespace spherecut;
using solvers::StiffnessTiles;
using solvers::tile_nodes;

TEST_CASE("The stiffness kernel sums the products of the points that both sides reach") {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> value(-1, 1);
  for (int points : {1, 8, 27, 64}) {
    const std::size_t size = static_cast<std::size_t>(points) * solvers::gradients_at_point;
    std::vector<double> rows(size), columns(size);
    std::uint64_t row_points = 0, column_points[tile_nodes] = {};
    for (int q = 0; q < points; ++q)
      for (int k = 0; k < tile_nodes; ++k)
        for (const bool is_row : {true, false}) {
          const bool reached = value(random) > -0.3;
          std::vector<double>& of = is_row ? rows : columns;
          for (int a = 0; a < 3; ++a)
            of[q * solvers::gradients_at_point + a * tile_nodes + k] = reached ? value(random) : 0;
          (is_row ? row_points : column_points[k]) |= std::uint64_t{reached} << q;
        }
    const auto tile = std::make_unique<solvers::StiffnessTile>();
    std::fill_n(&tile->plane[0][0][0], tile_nodes * 9 * tile_nodes, 0.25);
    solvers::add_to_tile(rows.data(), row_points, columns.data(), column_points, *tile);
    double worst = 0;
    for (int j = 0; j < tile_nodes; ++j)
      for (int i = 0; i < tile_nodes; ++i)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) {
            double sum = 0;
            for (int q = 0; q < points; ++q)
              sum += rows[q * solvers::gradients_at_point + a * tile_nodes + i] *
                     columns[q * solvers::gradients_at_point + b * tile_nodes + j];
            worst = std::max(worst, std::abs(tile->plane[j][3 * a + b][i] - 0.25 - sum));
          }
    CHECK(worst < 1e-13);
  }
}

TEST_CASE("Every pair of nodes that cells or means couple stands in one tile with their whole stiffness") {
  const double lambda = 1.7, mu = 0.6;
  const int count = 51;
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> value(-1, 1);
  std::vector<Vector3> positions(count);
  for (Vector3& x : positions)
    x = Vector3(value(random), value(random), value(random));
  MatrixX expected = MatrixX::Zero(3 * count, 3 * count);
  std::vector<solvers::CellShapes> cells(30);
  for (int c = 0; c < std::ssize(cells); ++c) {
    solvers::CellShapes& cell = cells[c];
    cell.points = c % 3 == 0 ? 27 : 8;
    for (int node = 0; node + 3 < count; ++node) // the last three are in no cell
      if (value(random) > 0.2)
        cell.nodes.push_back(node);
    cell.stride = (cell.points + 7) / 8 * 8;
    cell.reached.assign(cell.nodes.size(), 0);
    cell.gradients.assign(3 * cell.nodes.size() * static_cast<std::size_t>(cell.stride), 0.0);
    for (int q = 0; q < cell.points; ++q) {
      MatrixX g = MatrixX::Zero(3, count);
      for (std::size_t k = 0; k < cell.nodes.size(); ++k)
        if (value(random) > 0.6) {
          cell.reached[k] |= std::uint32_t{1} << q;
          for (int a = 0; a < 3; ++a)
            g(a, cell.nodes[k]) = cell.gradients[(3 * k + a) * static_cast<std::size_t>(cell.stride) + q] =
                value(random);
        }
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j)
          expected.block<3, 3>(3 * i, 3 * j) += lambda * g.col(i) * g.col(j).transpose() +
                                                mu * g.col(j) * g.col(i).transpose() +
                                                mu * g.col(i).dot(g.col(j)) * Matrix3::Identity();
    }
  }
  const solvers::DisplacementMean mean{{3, 17, count - 1}, {0.5, 0.25, 0.25}, Vector3::Zero(), 1, {}};
  MatrixX penalties = MatrixX::Zero(3 * count, 3 * count);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (const int c : {0, 2})
        penalties(3 * mean.nodes[i] + c, 3 * mean.nodes[j] + c) = 7 * mean.weights[i] * mean.weights[j];

  const auto check = [&](const StiffnessTiles& tiles) {
    MatrixX sum = MatrixX::Zero(3 * count, 3 * count), held = sum;
    for (const StiffnessTiles::Pair& pair : tiles.pairs()) {
      CHECK(sum.block<3, 3>(3 * pair.row, 3 * pair.column).isZero(0));
      const Matrix3 block = pair.stiffness(lambda, mu);
      sum.block<3, 3>(3 * pair.row, 3 * pair.column) = block;
      sum.block<3, 3>(3 * pair.column, 3 * pair.row) = block.transpose();
      for (int c = 0; c < 3 && pair.held != nullptr; ++c)
        held(3 * pair.row + c, 3 * pair.column + c) = held(3 * pair.column + c, 3 * pair.row + c) =
            pair.held[c * tile_nodes];
    }
    CHECK((sum - expected).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((held - penalties).cwiseAbs().maxCoeff() < 1e-15);
    return sum;
  };
  const auto added_up = [&](int shares) {
    StiffnessTiles tiles(positions);
    solvers::CellCluster cluster(tiles.groups());
    const auto flush = [&] {
      for (int share = 0; share < shares; ++share)
        tiles.add(cluster, share, shares);
      cluster.clear();
    };
    for (const solvers::CellShapes& cell : cells) {
      if (!cluster.has_room_for(cell))
        flush();
      cluster.add(cell);
    }
    flush();
    tiles.add_held(mean, {true, false, true}, 7);
    return check(tiles);
  };
  CHECK(added_up(3) == added_up(1));
}
