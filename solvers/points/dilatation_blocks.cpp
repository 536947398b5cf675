#include "solvers/points/dilatation_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace spherecut::solvers {

namespace {

struct MeanBlock {
  Vector3 eye = Vector3::Zero(); // a point of it
  Vector3 moment = Vector3::Zero();
  double volume = 0, full = 0; // m3: of its points, and of its boxes
  double size = 0;             // m, longest edge of its boxes
  int joins = -1;              // the block that takes its groups
  [[nodiscard]] Vector3 centroid() const { return moment / volume; }
};

/// Boxes of one size lie on a grid; its indices halved.
std::array<int, 6> key_of(const BackgroundBox& box, const BoundingBox& bounds) {
  std::array<int, 6> key{};
  for (int axis = 0; axis < 3; ++axis) {
    const double edge = 2 * box.half[axis];
    const int cells = std::max(1, static_cast<int>(std::lround(bounds.extent()[axis] / edge)));
    const int blocks = std::max(1, cells / 2);
    const int index = static_cast<int>(std::floor((box.centre[axis] - bounds.lower[axis]) / edge));
    key[axis] = cells;
    key[3 + axis] = std::clamp(index * blocks / cells, 0, blocks - 1);
  }
  return key;
}

} // namespace

DilatationBlocks dilatation_blocks(const topology::Domain& domain, const BackgroundCells& cells,
                                   const PointTable& points, const topology::Incision* incision, double least_part) {
  const BoundingBox bounds = domain.bounds();
  const auto hides = [&](const Vector3& a, const Vector3& b) { return incision != nullptr && incision->blocks(a, b); };
  std::vector<MeanBlock> blocks;
  std::map<std::array<int, 6>, std::vector<int>> parts; // of every place: the blocks there
  std::vector<int> block_of_cell(cells.start.size() - 1, -1);
  for (const BackgroundBox& box : cells.boxes) {
    std::vector<int>& here = parts[key_of(box, bounds)];
    for (int cell = box.first_cell; cell < box.last_cell; ++cell) {
      const Vector3& eye = cells.of(cell).front().position;
      auto found = std::find_if(here.begin(), here.end(), [&](int b) { return !hides(blocks[b].eye, eye); });
      if (found == here.end()) {
        found = here.insert(here.end(), static_cast<int>(blocks.size()));
        blocks.push_back({.eye = eye});
      }
      MeanBlock& block = blocks[*found];
      block_of_cell[cell] = *found;
      block.full += 8 * box.half.prod() / (box.last_cell - box.first_cell);
      block.size = std::max(block.size, 2 * box.half.maxCoeff());
      for (const QuadraturePoint& point : cells.of(cell)) {
        block.volume += point.weight;
        block.moment += point.weight * point.position;
      }
    }
  }
  // A box at the surface may be one of few in its block: what counts is the volume of eight boxes.
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const double eight = 8 * std::pow(blocks[b].size, 3);
    if (blocks[b].volume >= least_part * std::max(blocks[b].full, std::min(eight, 2 * blocks[b].full)))
      continue;
    double nearest = std::pow(2.5 * blocks[b].size, 2);
    for (std::size_t other = 0; other < blocks.size(); ++other) {
      const double distance = (blocks[other].centroid() - blocks[b].centroid()).squaredNorm();
      if (other != b && distance < nearest && blocks[other].volume > blocks[b].volume &&
          !hides(blocks[other].eye, blocks[b].eye)) {
        nearest = distance;
        blocks[b].joins = static_cast<int>(other);
      }
    }
  }
  // Volumes rise along the chain of joins, so it ends.
  std::vector<int> number(blocks.size(), -1);
  DilatationBlocks result;
  const auto root = [&](int b) {
    while (blocks[b].joins >= 0)
      b = blocks[b].joins;
    return b;
  };
  for (int group = 0; group < points.groups(); ++group) {
    const int b = root(block_of_cell[points.cell[group]]);
    if (number[b] < 0) {
      number[b] = result.size();
      result.volume.push_back(0);
    }
    result.block.push_back(number[b]);
    for (int lane = 0; lane < points.count[group]; ++lane)
      result.volume[number[b]] += points.weights[group].value[lane];
  }
  return result;
}

} // namespace spherecut::solvers
