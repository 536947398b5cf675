#include "solvers/galerkin/stiffness_tiles.hpp"

#include <algorithm>
#include <functional>
#include <numeric>

namespace spherecut::solvers {

namespace {

/// Place of every group in the column that is worked on, -1 outside.
std::vector<int>& place_in_column(std::size_t groups) {
  thread_local std::vector<int> place;
  place.resize(std::max(place.size(), groups), -1);
  return place;
}

} // namespace

NodeGroups::NodeGroups(const std::vector<Vector3>& positions) : place(positions.size()), node_at(positions.size()) {
  std::iota(node_at.begin(), node_at.end(), 0);
  std::vector<std::array<int, 2>> pending{{0, static_cast<int>(positions.size())}};
  while (!pending.empty()) {
    const auto [begin, end] = pending.back();
    pending.pop_back();
    if (end - begin <= tile_nodes)
      continue;
    Vector3 lower = positions[node_at[begin]], upper = lower;
    for (int k = begin; k < end; ++k) {
      lower = lower.cwiseMin(positions[node_at[k]]);
      upper = upper.cwiseMax(positions[node_at[k]]);
    }
    int axis = 0;
    (upper - lower).maxCoeff(&axis);
    const int middle = begin + ((end - begin) / 2 + tile_nodes - 1) / tile_nodes * tile_nodes;
    std::nth_element(node_at.begin() + begin, node_at.begin() + middle, node_at.begin() + end, [&](int a, int b) {
      return positions[a][axis] != positions[b][axis] ? positions[a][axis] < positions[b][axis] : a < b;
    });
    pending.push_back({begin, middle});
    pending.push_back({middle, end});
  }
  // Within a group the order of the partition's leavings is made one that is known.
  for (std::size_t first = 0; first < node_at.size(); first += tile_nodes)
    std::sort(node_at.begin() + static_cast<std::ptrdiff_t>(first),
              node_at.begin() + static_cast<std::ptrdiff_t>(std::min(first + tile_nodes, node_at.size())));
  for (std::size_t k = 0; k < node_at.size(); ++k)
    place[node_at[k]] = static_cast<int>(k);
  node_at.resize((positions.size() + tile_nodes - 1) / tile_nodes * tile_nodes, -1);
}

void CellCluster::add(const CellShapes& cell) {
  for (std::size_t k = 0; k < cell.nodes.size(); ++k) {
    const int place = groups_->place[cell.nodes[k]], lane = place % tile_nodes;
    int& local = local_[place / tile_nodes];
    if (local < 0) {
      local = static_cast<int>(members_.size());
      members_.push_back({place / tile_nodes});
      if (gradients_.size() < members_.size())
        gradients_.emplace_back();
    }
    Group& group = members_[local];
    double* const of_cell = gradients_[local].at + static_cast<std::ptrdiff_t>(points_) * gradients_at_point;
    if (group.reached >> points_ == 0) // the first of its nodes in this cell
      std::fill_n(of_cell, cell.points * gradients_at_point, 0.0);
    const std::uint64_t reached = std::uint64_t{cell.reached[k]} << points_;
    group.reached |= reached;
    group.by_node[lane] |= reached;
    double* to = of_cell + lane;
    const double* from = cell.gradients.data() + 3 * k * static_cast<std::size_t>(cell.stride);
    for (int q = 0; q < cell.points; ++q, ++from, to += gradients_at_point) {
      to[0] = from[0];
      to[tile_nodes] = from[cell.stride];
      to[2 * tile_nodes] = from[2 * static_cast<std::ptrdiff_t>(cell.stride)];
    }
  }
  points_ += cell.points;
}

void CellCluster::clear() {
  for (const Group& group : members_)
    local_[group.id] = -1;
  members_.clear();
  points_ = 0;
}

int StiffnessTiles::Column::add(int group) {
  if (tiles.empty()) {
    constexpr int usual = 40; // of a group well inside a body
    groups.reserve(usual);
    tiles.reserve(usual);
    held.reserve(usual);
  }
  groups.push_back(group);
  tiles.emplace_back();
  held.push_back(-1);
  return static_cast<int>(groups.size()) - 1;
}

void StiffnessTiles::add(const CellCluster& cluster, int share, int shares) {
  std::vector<int>& place = place_in_column(columns_.size());
  for (std::size_t c = 0; c < cluster.members_.size(); ++c) {
    const CellCluster::Group& own = cluster.members_[c];
    if (own.id % shares != share)
      continue;
    Column& column = columns_[own.id];
    for (int k = 0; k < std::ssize(column.groups); ++k)
      place[column.groups[k]] = k;
    for (std::size_t r = 0; r < cluster.members_.size(); ++r) {
      const CellCluster::Group& other = cluster.members_[r];
      if (other.id < own.id || (other.reached & own.reached) == 0)
        continue;
      if (place[other.id] < 0)
        place[other.id] = column.add(other.id);
      add_to_tile(cluster.gradients_[r].at, other.reached, cluster.gradients_[c].at, own.by_node.data(),
                  column.tiles[place[other.id]]);
    }
    for (const int group : column.groups)
      place[group] = -1;
  }
}

void StiffnessTiles::add_held(const DisplacementMean& mean, const std::array<bool, 3>& components, double factor) {
  struct Weights {
    int group;
    std::array<double, tile_nodes> weight{};
  };
  std::vector<Weights> groups;
  std::vector<int>& place = place_in_column(columns_.size());
  for (std::size_t k = 0; k < mean.nodes.size(); ++k) {
    const int at = groups_.place[mean.nodes[k]];
    int& local = place[at / tile_nodes];
    if (local < 0) {
      local = static_cast<int>(groups.size());
      groups.push_back({at / tile_nodes});
    }
    groups[local].weight[at % tile_nodes] = mean.weights[k];
  }
  for (const Weights& group : groups)
    place[group.group] = -1;
  for (const Weights& own : groups) {
    Column& column = columns_[own.group];
    for (int k = 0; k < std::ssize(column.groups); ++k)
      place[column.groups[k]] = k;
    for (const Weights& other : groups) {
      if (other.group < own.group)
        continue;
      if (place[other.group] < 0)
        place[other.group] = column.add(other.group);
      int& held = column.held[place[other.group]];
      if (held < 0) {
        held = static_cast<int>(column.held_tiles.size());
        column.held_tiles.emplace_back();
      }
      HeldTile& tile = column.held_tiles[held];
      for (int j = 0; j < tile_nodes; ++j)
        for (int c = 0; c < 3; ++c)
          for (int i = 0; i < tile_nodes && components[c]; ++i)
            tile.plane[j][c][i] += factor * own.weight[j] * other.weight[i];
    }
    for (const int group : column.groups)
      place[group] = -1;
  }
}

std::vector<StiffnessTiles::Pair> StiffnessTiles::pairs(const StiffnessTiles* volumetric) const {
  std::vector<Pair> all;
  std::size_t tiles = 0;
  for (const Column& column : columns_)
    tiles += column.tiles.size();
  all.reserve(tiles * tile_nodes * tile_nodes);
  for (int own = 0; own < groups_.size(); ++own) {
    const Column& column = columns_[own];
    for (std::size_t t = 0; t < column.tiles.size(); ++t)
      for (int j = 0; j < tile_nodes; ++j) {
        const auto& plane = column.tiles[t].plane[j];
        const HeldTile* held = column.held[t] < 0 ? nullptr : &column.held_tiles[column.held[t]];
        const StiffnessTile* other = nullptr; // groups that a mean alone has brought together come after those of cells
        if (volumetric != nullptr && t < volumetric->columns_[own].tiles.size())
          other = &volumetric->columns_[own].tiles[t];
        std::array<bool, tile_nodes> elastic{};
        // As a rule the first products tell, and the others need not be fetched from memory.
        for (int p = 0; p < 9 && !std::all_of(elastic.begin(), elastic.end(), std::identity()); ++p)
          for (int i = 0; i < tile_nodes; ++i)
            elastic[i] |= plane[p][i] != 0;
        for (int i = column.groups[t] == own ? j : 0; i < tile_nodes; ++i) {
          const double* const penalty = held == nullptr ? nullptr : &held->plane[j][0][i];
          const bool is_held =
              held != nullptr && (penalty[0] != 0 || penalty[tile_nodes] != 0 || penalty[2 * tile_nodes] != 0);
          if (elastic[i] || is_held)
            all.push_back({groups_.node_at[column.groups[t] * tile_nodes + i], groups_.node_at[own * tile_nodes + j],
                           &plane[0][i], is_held ? penalty : nullptr,
                           elastic[i] && other != nullptr ? &other->plane[j][0][i] : nullptr});
        }
      }
  }
  return all;
}

} // namespace spherecut::solvers
