#include "solvers/sphere_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace spherecut::solvers {

namespace {

// A cell of 0.45 radii holds about 2.3 times the spheres that hold one of its points (volume of the sphere swept by
// the cell over that of the sphere); smaller cells cost more memory than they save time.
constexpr double side_over_radius = 0.45;
constexpr int few_members = 16; // a cell with no more is not split
constexpr int deepest = 12;
constexpr double slack = 1e-9; // of the cell's side: a point on a face may be sorted to either side of it

bool touches(const Vector3& centre, double radius, const Vector3& lower, double side) {
  const double tolerance = slack * side;
  double squared = 0;
  for (int a = 0; a < 3; ++a) {
    const double outside = std::max({lower[a] - tolerance - centre[a], centre[a] - (lower[a] + side + tolerance), 0.0});
    squared += outside * outside;
  }
  return squared < radius * radius;
}

} // namespace

struct SphereGrid::Builder {
  SphereGrid& grid;
  const std::vector<Vector3>& centres;
  const std::vector<double>& radii;

  void fill(int node, const Vector3& lower, double side, int depth, const std::vector<int>& members) {
    if (wants_split(side, depth, members)) {
      const int first = static_cast<int>(grid.nodes_.size());
      grid.nodes_[node].first_child = first;
      grid.nodes_.resize(grid.nodes_.size() + 8);
      std::vector<int> inside;
      for (int octant = 0; octant < 8; ++octant) {
        const Vector3 corner = lower + 0.5 * side * Vector3(octant & 1, (octant >> 1) & 1, (octant >> 2) & 1);
        inside.clear();
        for (int j : members)
          if (touches(centres[j], radii[j], corner, 0.5 * side))
            inside.push_back(j);
        fill(first + octant, corner, 0.5 * side, depth + 1, inside);
      }
      return;
    }
    store(grid.nodes_[node], members);
  }

  [[nodiscard]] bool wants_split(double side, int depth, const std::vector<int>& members) const {
    if (depth >= deepest || std::ssize(members) <= few_members)
      return false;
    double sum = 0;
    for (int j : members)
      sum += radii[j];
    return side > 1.2 * side_over_radius * sum / static_cast<double>(members.size());
  }

  void store(Node& leaf, const std::vector<int>& members) const {
    const int count = static_cast<int>(members.size());
    const int blocks = (count + lanes - 1) / lanes;
    leaf.count = count;
    leaf.first_id = static_cast<int>(grid.ids_.size());
    leaf.first_block = static_cast<int>(grid.blocks_.size());
    grid.ids_.insert(grid.ids_.end(), members.begin(), members.end());
    grid.ids_.resize(grid.ids_.size() + blocks * lanes - count, count > 0 ? members.back() : 0);
    grid.blocks_.resize(grid.blocks_.size() + 4 * static_cast<std::size_t>(blocks));
    Block* block = grid.blocks_.data() + leaf.first_block;
    const int* ids = grid.ids_.data() + leaf.first_id;
    for (int b = 0; b < blocks; ++b)
      for (int l = 0; l < lanes; ++l) {
        const int k = b * lanes + l, j = ids[k];
        for (int a = 0; a < 3; ++a)
          block[a * blocks + b].lane[l] = centres[j][a];
        block[3 * blocks + b].lane[l] = k < count ? 1 / (radii[j] * radii[j]) : std::numeric_limits<double>::infinity();
      }
  }
};

SphereGrid::SphereGrid(const std::vector<Vector3>& centres, const std::vector<double>& radii) {
  const int n = static_cast<int>(centres.size());
  Vector3 lower = Vector3::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
  // The box of the centres will do: a sphere that reaches a point outside it also touches the cell of the box nearest
  // to that point, since its centre lies on the inner side of whatever face of the box is between.
  for (int j = 0; j < n; ++j) {
    lower = lower.cwiseMin(centres[j]);
    upper = upper.cwiseMax(centres[j]);
  }
  const Vector3 extent = upper - lower;
  // Root cells fit the spheres of median size, but are no more than one per sphere or so, however large the box;
  // octants make up for it where spheres are small.
  std::vector<double> sorted = radii;
  std::nth_element(sorted.begin(), sorted.begin() + n / 2, sorted.end());
  const double median = sorted[n / 2];
  const double side =
      std::max(side_over_radius * median, std::cbrt(extent.cwiseMax(Vector3::Constant(median)).prod() / (n + 64.0)));
  origin_ = lower;
  inverse_side_ = 1 / side;
  for (int a = 0; a < 3; ++a)
    roots_[a] = std::max(1, static_cast<int>(std::ceil(extent[a] / side)));

  // Members of the root cells as compressed rows. A sphere covers a run of cells in each row of cells that it meets;
  // the runs are found first, then counted, then written.
  struct Run {
    int sphere, first, last;
  };
  std::vector<Run> runs;
  runs.reserve(static_cast<std::size_t>(n) * 40);
  const auto cells_between = [&](int axis, double low, double high) {
    const double from = (low - origin_[axis]) * inverse_side_ - slack;
    const double to = (high - origin_[axis]) * inverse_side_ + slack;
    return std::array<int, 2>{std::clamp(static_cast<int>(std::floor(from)), 0, roots_[axis] - 1),
                              std::clamp(static_cast<int>(std::floor(to)), 0, roots_[axis] - 1)};
  };
  // Squared distance from a coordinate to the layer of cells `i` along an axis.
  const auto layer_distance = [&](int axis, int i, double coordinate) {
    const double low = origin_[axis] + i * side, tolerance = slack * side;
    const double outside = std::max({low - tolerance - coordinate, coordinate - (low + side + tolerance), 0.0});
    return outside * outside;
  };
  for (int j = 0; j < n; ++j) {
    const Vector3& c = centres[j];
    const double r = radii[j];
    const auto [k0, k1] = cells_between(2, c.z() - r, c.z() + r);
    const auto [i0, i1] = cells_between(1, c.y() - r, c.y() + r);
    for (int k = k0; k <= k1; ++k)
      for (int i = i0; i <= i1; ++i) {
        const double squared = r * r - layer_distance(2, k, c.z()) - layer_distance(1, i, c.y());
        if (squared <= 0)
          continue;
        const double half = std::sqrt(squared);
        const auto [h0, h1] = cells_between(0, c.x() - half, c.x() + half);
        const int row = (k * roots_[1] + i) * roots_[0];
        runs.push_back({j, row + h0, row + h1});
      }
  }
  const int root_count = roots_[0] * roots_[1] * roots_[2];
  // Every run adds one to the count from its first cell on and takes it back behind its last.
  std::vector<int> start(static_cast<std::size_t>(root_count) + 2, 0);
  for (const Run& run : runs) {
    ++start[run.first + 1];
    --start[run.last + 2];
  }
  start.pop_back();
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<int> members(start[root_count]), next(start.begin(), start.end() - 1);
  for (const Run& run : runs)
    for (int cell = run.first; cell <= run.last; ++cell)
      members[next[cell]++] = run.sphere;

  nodes_.resize(root_count);
  // Enough for cells that are not split, with their padding.
  const std::size_t entries = members.size() + static_cast<std::size_t>(root_count) * lanes;
  ids_.reserve(entries);
  blocks_.reserve(4 * entries / lanes);
  Builder builder{*this, centres, radii};
  std::vector<int> inside;
  for (int r = 0; r < root_count; ++r) {
    inside.assign(members.begin() + start[r], members.begin() + start[r + 1]);
    const int h = r % roots_[0], i = (r / roots_[0]) % roots_[1], k = r / (roots_[0] * roots_[1]);
    builder.fill(r, origin_ + side * Vector3(h, i, k), side, 0, inside);
  }
}

SphereGrid::Cell SphereGrid::find(const Vector3& x) const {
  std::array<int, 3> root{};
  std::array<double, 3> fraction{}; // position within the current cell, 0 to 1
  for (int a = 0; a < 3; ++a) {
    const double t = (x[a] - origin_[a]) * inverse_side_;
    const double inside = t > 0 ? std::min(t, static_cast<double>(roots_[a])) : 0; // also 0 when t is not a number
    root[a] = std::min(static_cast<int>(inside), roots_[a] - 1);
    fraction[a] = inside - root[a];
  }
  int node = (root[2] * roots_[1] + root[1]) * roots_[0] + root[0];
  while (nodes_[node].first_child >= 0) {
    int octant = 0;
    for (int a = 0; a < 3; ++a) {
      const int upper = fraction[a] >= 0.5 ? 1 : 0;
      octant |= upper << a;
      fraction[a] = 2 * fraction[a] - upper;
    }
    node = nodes_[node].first_child + octant;
  }
  const Node& leaf = nodes_[node];
  const int blocks = (leaf.count + lanes - 1) / lanes;
  const Block* block = blocks_.data() + leaf.first_block;
  if (blocks == 0)
    return {{}, nullptr, nullptr, nullptr, nullptr, 0};
  return {{ids_.data() + leaf.first_id, static_cast<std::size_t>(leaf.count)},
          block[0].lane.data(),
          block[blocks].lane.data(),
          block[2 * blocks].lane.data(),
          block[3 * blocks].lane.data(),
          blocks * lanes};
}

} // namespace spherecut::solvers
