#include "solvers/shapes/sphere_grid.hpp"

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
constexpr int octants = 8;
constexpr double face_slack = 1e-9; // of the cell's side: a point on a face may be sorted to either side of it

} // namespace

struct SphereGrid::Builder {
  SphereGrid& grid;
  const std::vector<Vector3>& centres;
  const std::vector<double>& radii;
  std::array<std::vector<int>, deepest> inside_at{}; // members of the octants of a cell, by its depth

  void fill(int node, const Vector3& lower, double side, int depth, std::span<const int> members) {
    if (!wants_split(side, depth, members)) {
      store(grid.nodes_[node], members);
      return;
    }
    const int first = static_cast<int>(grid.nodes_.size());
    grid.nodes_[node].first_child = first;
    grid.nodes_.resize(grid.nodes_.size() + octants);
    std::vector<int>& inside = inside_at[depth];
    inside.resize(octants * members.size());
    const std::array<std::size_t, octants> counts = sort_into_octants(lower, side, members, inside.data());
    for (int o = 0; o < octants; ++o)
      fill(first + o, lower + 0.5 * side * Vector3(o & 1, o >> 1 & 1, o >> 2 & 1), 0.5 * side, depth + 1,
           std::span(inside).subspan(static_cast<std::size_t>(o) * members.size(), counts[o]));
  }

  /// Octant o (bits 0, 1, 2: the upper half along x, y, z) gets the members that touch it from
  /// inside[o * members.size()] on; returns how many.
  [[nodiscard]] std::array<std::size_t, octants> sort_into_octants(const Vector3& lower, double side,
                                                                   std::span<const int> members, int* inside) const {
    const double half = 0.5 * side, tolerance = face_slack * half;
    std::array<std::size_t, octants> counts{};
    for (const int j : members) {
      double squared[3][2]; // of the distance to either half, along each axis
      for (int a = 0; a < 3; ++a) {
        const double from_lower = centres[j][a] - lower[a];
        const double below = std::max(-tolerance - from_lower, 0.0),
                     above = std::max(from_lower - side - tolerance, 0.0);
        const double past_middle = from_lower - half;
        const double to_lower_half = std::max(below, past_middle - tolerance);
        const double to_upper_half = std::max(above, -tolerance - past_middle);
        squared[a][0] = to_lower_half * to_lower_half;
        squared[a][1] = to_upper_half * to_upper_half;
      }
      const double square = radii[j] * radii[j];
      for (int o = 0; o < octants; ++o) { // written everywhere, kept where it touches: no branches
        inside[static_cast<std::size_t>(o) * members.size() + counts[o]] = j;
        counts[o] += squared[0][o & 1] + squared[1][o >> 1 & 1] + squared[2][o >> 2 & 1] < square ? 1 : 0;
      }
    }
    return counts;
  }

  [[nodiscard]] bool wants_split(double side, int depth, std::span<const int> members) const {
    if (depth >= deepest || std::ssize(members) <= few_members)
      return false;
    double sum = 0;
    for (int j : members)
      sum += radii[j];
    return side > 1.2 * side_over_radius * sum / static_cast<double>(members.size());
  }

  void store(Node& leaf, std::span<const int> members) const {
    leaf.count = static_cast<int>(members.size());
    leaf.first_id = static_cast<int>(grid.ids_.size());
    grid.ids_.insert(grid.ids_.end(), members.begin(), members.end());
    grid.ids_.resize((grid.ids_.size() + lanes - 1) / lanes * lanes, members.empty() ? 0 : members.back());
  }

  /// Once all leaves are known, so that their room is asked for once.
  void copy_spheres() const {
    struct Sphere {
      double x, y, z, inverse_square_radius;
    };
    std::vector<Sphere> spheres(centres.size());
    for (std::size_t j = 0; j < centres.size(); ++j)
      spheres[j] = {centres[j].x(), centres[j].y(), centres[j].z(), 1 / (radii[j] * radii[j])};
    grid.blocks_.reset(new Block[4 * grid.ids_.size() / lanes]);
    for (const Node& leaf : grid.nodes_) {
      const int blocks = (leaf.count + lanes - 1) / lanes;
      Block* block = grid.blocks_.get() + leaf.first_block();
      const int* ids = grid.ids_.data() + leaf.first_id;
      for (int b = 0; b < blocks; ++b)
        for (int l = 0; l < lanes; ++l) {
          const Sphere& sphere = spheres[ids[b * lanes + l]];
          block[b].lane[l] = sphere.x;
          block[blocks + b].lane[l] = sphere.y;
          block[2 * blocks + b].lane[l] = sphere.z;
          block[3 * blocks + b].lane[l] = sphere.inverse_square_radius;
        }
      for (int k = leaf.count; k < blocks * lanes; ++k)
        block[4 * blocks - 1].lane[k % lanes] = std::numeric_limits<double>::infinity();
    }
  }
};

/// A sphere covers a run of root cells in each row of cells that it meets. `side`: of a root cell, m.
std::vector<SphereGrid::Run> SphereGrid::runs_of(const std::vector<Vector3>& centres, const std::vector<double>& radii,
                                                 double side) const {
  const auto n = static_cast<int>(centres.size());
  std::vector<Run> runs;
  runs.reserve(centres.size() * 40);
  const auto cells_between = [&](int axis, double low, double high) {
    const double from = (low - origin_[axis]) * inverse_side_ - face_slack;
    const double to = (high - origin_[axis]) * inverse_side_ + face_slack;
    return std::array<int, 2>{std::clamp(static_cast<int>(std::floor(from)), 0, roots_[axis] - 1),
                              std::clamp(static_cast<int>(std::floor(to)), 0, roots_[axis] - 1)};
  };
  // Squared distance from a coordinate to the layer of cells `i` along an axis.
  const auto layer_distance = [&](int axis, int i, double coordinate) {
    const double low = origin_[axis] + i * side, tolerance = face_slack * side;
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
  return runs;
}

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

  // Members of the root cells as compressed rows: the runs are found first, then counted, then written.
  const std::vector<Run> runs = runs_of(centres, radii, side);
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
  ids_.reserve(2 * (members.size() + static_cast<std::size_t>(root_count) * lanes));
  Builder builder{*this, centres, radii};
  for (int r = 0; r < root_count; ++r) {
    const int h = r % roots_[0], i = (r / roots_[0]) % roots_[1], k = r / (roots_[0] * roots_[1]);
    builder.fill(r, origin_ + side * Vector3(h, i, k), side, 0,
                 std::span(members).subspan(start[r], start[r + 1] - start[r]));
  }
  builder.copy_spheres();
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
  const Block* block = blocks_.get() + leaf.first_block();
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
