#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace spherecut::topology {

namespace {
constexpr int points_in_leaf = 8;
constexpr int points_looked_through = 64; // within a radius, in place of descending further
} // namespace

PointTree::PointTree(const std::vector<Vector3>& points)
    : points_(points), index_(points.size()), place_(points.size()) {
  std::iota(index_.begin(), index_.end(), 0);
  build(0, static_cast<int>(index_.size()), 0);
  for (std::size_t k = 0; k < index_.size(); ++k) {
    points_[k] = points[index_[k]];
    place_[index_[k]] = static_cast<int>(k);
  }
}

void PointTree::build(int begin, int end, int axis) {
  if (end - begin <= points_in_leaf)
    return;
  const int middle = (begin + end) / 2;
  std::nth_element(index_.begin() + begin, index_.begin() + middle, index_.begin() + end, [&](int a, int b) {
    return points_[a][axis] != points_[b][axis] ? points_[a][axis] < points_[b][axis] : a < b;
  });
  build(begin, middle, (axis + 1) % 3);
  build(middle + 1, end, (axis + 1) % 3);
}

void PointTree::within(const Vector3& x, double radius, std::vector<Found>& found) const {
  within(0, static_cast<int>(points_.size()), 0, x, radius * radius, found);
}

void PointTree::within(int begin, int end, int axis, const Vector3& x, double squared_radius,
                       std::vector<Found>& found) const {
  if (end - begin <= points_looked_through) {
    // Half of them are found, in no pattern that could be foreseen: all are written, and the next over those that are
    // too far.
    const std::size_t already = found.size();
    found.resize(already + static_cast<std::size_t>(end - begin));
    Found* next = found.data() + already;
    for (int k = begin; k < end; ++k) {
      *next = {(points_[k] - x).squaredNorm(), index_[k]};
      next += next->squared_distance < squared_radius ? 1 : 0;
    }
    found.resize(static_cast<std::size_t>(next - found.data()));
    return;
  }
  const int middle = (begin + end) / 2;
  const double squared = (points_[middle] - x).squaredNorm();
  if (squared < squared_radius)
    found.push_back({squared, index_[middle]});
  const double offset = x[axis] - points_[middle][axis];
  const int next = (axis + 1) % 3;
  if (offset <= 0 || offset * offset < squared_radius)
    within(begin, middle, next, x, squared_radius, found);
  if (offset >= 0 || offset * offset < squared_radius)
    within(middle + 1, end, next, x, squared_radius, found);
}

PointTree::Found PointTree::nearest(const Vector3& x) const {
  return nearest(x, -1);
}

PointTree::Found PointTree::nearest(const Vector3& x, int guess) const {
  Found best{std::numeric_limits<double>::infinity(), -1};
  if (guess >= 0)
    best = {(points_[place_[guess]] - x).squaredNorm(), guess};
  nearest(0, static_cast<int>(points_.size()), 0, x, best);
  return best;
}

void PointTree::nearest(int begin, int end, int axis, const Vector3& x, Found& best) const {
  const auto consider = [&](int k) {
    const double squared = (points_[k] - x).squaredNorm();
    if (squared < best.squared_distance || (squared == best.squared_distance && index_[k] < best.index))
      best = {squared, index_[k]};
  };
  while (end - begin > points_in_leaf) {
    const int middle = (begin + end) / 2;
    const double offset = x[axis] - points_[middle][axis];
    axis = (axis + 1) % 3;
    // The half that holds x first; the other only where it may hold something as near.
    if (offset < 0)
      nearest(begin, middle, axis, x, best);
    else
      nearest(middle + 1, end, axis, x, best);
    if (!(offset * offset <= best.squared_distance))
      return;
    consider(middle);
    (offset < 0 ? begin : end) = offset < 0 ? middle + 1 : middle;
  }
  for (int k = begin; k < end; ++k)
    consider(k);
}

} // namespace spherecut::topology
