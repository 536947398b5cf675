// The stiffness of the weak form added up in tiles of four by four nodes.
//
// Before the nodes have an elimination order they are grouped by place, four that lie together. A tile is complete when
// all cells are in, whatever order the unknowns get afterwards; every pair of nodes is in one tile alone.
#pragma once

#include "solvers/body/surface_patches.hpp"
#include "solvers/galerkin/stiffness_kernel.hpp"
#include "solvers/shapes/cell_shapes.hpp"

#include <array>

namespace spherecut::solvers {

/// Nodes in groups of four that lie together.
struct NodeGroups {
  explicit NodeGroups(const std::vector<Vector3>& positions);

  std::vector<int> place;   // of every node: group place / 4, lane place % 4
  std::vector<int> node_at; // of every place, -1 behind the last
  [[nodiscard]] int size() const { return static_cast<int>(node_at.size()) / tile_nodes; }
};

/// Neighbouring cells taken together: they share most of their nodes, so that each pair of groups is added to its tile
/// once for all their points.
class CellCluster {
 public:
  explicit CellCluster(const NodeGroups& groups) : groups_(&groups), local_(groups.size(), -1) {}

  /// Whether there is room for the points of one more cell.
  [[nodiscard]] bool has_room_for(const CellShapes& cell) const { return points_ + cell.points <= tile_points; }
  void add(const CellShapes& cell);
  void clear();
  [[nodiscard]] bool empty() const { return points_ == 0; }

 private:
  friend class StiffnessTiles;
  struct Group {
    int id;
    std::uint64_t reached = 0;                       // by some node
    std::array<std::uint64_t, tile_nodes> by_node{}; // bit q: the node reaches point q
  };
  /// [point][axis][lane]; no load of four lanes crosses a cache line. Of a cell that no node of the group reaches,
  /// whatever was there before.
  struct Gradients {
    alignas(64) double at[tile_points * gradients_at_point];
  };
  const NodeGroups* groups_;
  std::vector<int> local_; // of every group in members_, -1 outside
  std::vector<Group> members_;
  std::vector<Gradients> gradients_; // of every member, and room that larger clusters have left
  int points_ = 0;
};

class StiffnessTiles {
 public:
  explicit StiffnessTiles(const std::vector<Vector3>& positions) : groups_(positions), columns_(groups_.size()) {}

  [[nodiscard]] const NodeGroups& groups() const { return groups_; }

  /// Adds a cluster of cells. Of several threads each may add its `share` of every cluster, in the same order: the sums
  /// do not depend on how many shares there are.
  void add(const CellCluster& cluster, int share = 0, int shares = 1);
  /// Adds the penalty `factor` N/m of the components of a mean, m m^T, kept apart from the rest.
  void add_held(const DisplacementMean& mean, const std::array<bool, 3>& components, double factor);

  /// Two nodes that some point or some mean couples, each pair once.
  struct Pair {
    int row, column;        // nodes
    const double* products; // entry 3 a + b of dI,a dJ,b is products[(3 a + b) * tile_nodes]
    const double* held;     // penalty of component c is held[c * tile_nodes]; null: none
    /// Of a body of several materials: `products` are summed up times mu, these times lambda. Null: of one, neither is.
    const double* volumetric = nullptr;
    /// lambda gI gJ^T + mu gJ gI^T + mu (gI . gJ) 1, N/m; the moduli are those of the one material.
    [[nodiscard]] Matrix3 stiffness(double lambda, double mu) const {
      const auto matrix = [](const double* of) {
        Matrix3 g;
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            g(a, b) = of[(3 * a + b) * tile_nodes];
        return g;
      };
      const Matrix3 g = matrix(products);
      if (volumetric != nullptr) {
        Matrix3 block = matrix(volumetric) + g.transpose();
        block.diagonal().array() += g.trace();
        return block;
      }
      Matrix3 block = lambda * g + mu * g.transpose();
      block.diagonal().array() += mu * g.trace();
      return block;
    }
  };
  /// In an order that depends on nothing but what was added. They point into the tiles. `volumetric` (null: none): the
  /// same clusters, weighted with lambda as these are with mu.
  [[nodiscard]] std::vector<Pair> pairs(const StiffnessTiles* volumetric = nullptr) const;

 private:
  struct HeldTile {
    alignas(32) double plane[tile_nodes][3][tile_nodes]; // of column J: component, row I
  };
  /// Tiles of the column nodes of one group, with groups of row nodes from its own on.
  struct Column {
    std::vector<int> groups;
    std::vector<StiffnessTile> tiles;
    std::vector<int> held; // of every tile, -1: none
    std::vector<HeldTile> held_tiles;
    int add(int group);
  };

  NodeGroups groups_;
  std::vector<Column> columns_;
};

} // namespace spherecut::solvers
