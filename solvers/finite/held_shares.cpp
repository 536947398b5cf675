#include "solvers/finite/held_shares.hpp"

#include "topology/search/point_tree.hpp"

#include <algorithm>

namespace spherecut::solvers {

namespace {

constexpr double one_side = 0.7; // cosine between normals of one side of an edge

/// The side of a share that has most area: its mean normal.
Vector3 main_side(std::span<const SurfacePoint> points, const std::vector<int>& share) {
  double most = -1;
  Vector3 best = Vector3::Zero();
  for (const int p : share) {
    double area = 0;
    Vector3 mean = Vector3::Zero();
    for (const int q : share)
      if (points[q].normal.dot(points[p].normal) > one_side) {
        area += points[q].weight;
        mean += points[q].weight * points[q].normal;
      }
    if (area > most * (1 + 1e-9)) {
      most = area;
      best = mean.normalized();
    }
  }
  return best;
}

/// Shares of `chosen` points for nodes at `positions`.
std::vector<std::vector<int>> share_out(std::span<const SurfacePoint> points, const std::vector<int>& chosen,
                                        const std::vector<Vector3>& positions, const topology::Incision* incision) {
  std::vector<std::vector<int>> shares(positions.size());
  const topology::PointTree tree(positions);
  for (const int p : chosen)
    shares[nearest_in_sight(tree, positions, incision, points[p].position, -1)].push_back(p);
  std::vector<Vector3> side(positions.size(), Vector3::Zero());
  std::vector<int> left;
  for (std::size_t k = 0; k < shares.size(); ++k) {
    if (shares[k].empty())
      continue;
    side[k] = main_side(points, shares[k]);
    const auto other = std::stable_partition(shares[k].begin(), shares[k].end(),
                                             [&](int p) { return points[p].normal.dot(side[k]) > one_side; });
    left.insert(left.end(), other, shares[k].end());
    shares[k].erase(other, shares[k].end());
  }
  for (const int p : left) {
    std::size_t nearest = positions.size();
    double least = 0;
    for (std::size_t k = 0; k < positions.size(); ++k) {
      const double distance = (positions[k] - points[p].position).squaredNorm();
      if (points[p].normal.dot(side[k]) > one_side && (nearest == positions.size() || distance < least) &&
          (incision == nullptr || !incision->blocks(points[p].position, positions[k]))) {
        nearest = k;
        least = distance;
      }
    }
    if (nearest < positions.size())
      shares[nearest].push_back(p);
    else // no node has this side: it stays where it was
      shares[nearest_in_sight(tree, positions, incision, points[p].position, -1)].push_back(p);
  }
  return shares;
}

} // namespace

std::vector<DisplacementMean> held_shares(const Problem& problem, const Spheres& spheres,
                                          const SurfacePatches& patches) {
  const std::vector<Prescribed>& entries = problem.prescribed;
  const HeldRegion& held = problem.prescribed_region;
  std::vector<DisplacementMean> result(entries.size());
  const std::span<const SurfacePoint> points = patches.points().first(patches.skin_points());
  std::vector<char> found(entries.size(), 0);
  for (std::size_t first = 0; first < entries.size(); ++first) {
    if (found[first] != 0)
      continue;
    const std::array<bool, 3> axes = entries[first].components;
    std::vector<std::size_t> alike;
    std::vector<Vector3> positions;
    for (std::size_t k = first; k < entries.size(); ++k)
      if (found[k] == 0 && (!held.by_axis() || entries[k].components == axes)) {
        alike.push_back(k);
        positions.push_back(problem.nodes.positions[entries[k].node]);
        found[k] = 1;
      }
    std::vector<int> chosen;
    for (int p = 0; p < std::ssize(points); ++p)
      if (held && (held.by_axis() ? held.holds(points[p].position, points[p].normal, axes)
                                  : held(points[p].position, points[p].normal)))
        chosen.push_back(p);
    const std::vector<std::vector<int>> shares = share_out(points, chosen, positions, problem.incision.get());
    for (std::size_t k = 0; k < alike.size(); ++k) {
      DisplacementMean mean;
      mean.centroid = positions[k];
      for (const int p : shares[k])
        mean.area += points[p].weight;
      for (const int p : shares[k])
        mean.share.push_back({points[p].position, points[p].weight / mean.area});
      result[alike[k]] = reweighed(mean, spheres); // without a share: the node itself
    }
  }
  return result;
}

} // namespace spherecut::solvers
