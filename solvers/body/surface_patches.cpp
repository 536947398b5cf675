#include "solvers/body/surface_patches.hpp"

#include "solvers/algebra/parallel.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::solvers {

namespace {

/// Edge of the surface quadrature's triangles in spacings: a mean over a share needs less than a traction does.
constexpr double share_edge = 0.6, share_centroid_below = 0.36, share_finest = 1;

DisplacementMean mean_over(const std::vector<SurfacePoint>& points, const std::vector<int>& chosen,
                           const Spheres& spheres) {
  DisplacementMean mean;
  thread_local std::vector<int> place; // of a node in the mean, -1 outside
  place.resize(std::max(place.size(), static_cast<std::size_t>(spheres.size())), -1);
  ShapeFunctions shape;
  for (int p : chosen) {
    if (!evaluate(spheres, points[p].position, shape)) {
      for (int node : mean.nodes)
        place[node] = -1;
      throw NumericalError(fmt::format("no sound support covers the surface point ({:.6g}, {:.6g}, {:.6g}) m",
                                       points[p].position.x(), points[p].position.y(), points[p].position.z()));
    }
    mean.area += points[p].weight;
    mean.centroid += points[p].weight * points[p].position;
    mean.share.push_back({points[p].position, points[p].weight});
    for (int k = 0; k < shape.size(); ++k) {
      int& at = place[shape.nodes[k]];
      if (at < 0) {
        at = static_cast<int>(mean.nodes.size());
        mean.nodes.push_back(shape.nodes[k]);
        mean.weights.push_back(0);
      }
      mean.weights[at] += points[p].weight * shape.value[k];
    }
  }
  mean.centroid /= mean.area;
  for (QuadraturePoint& point : mean.share)
    point.weight /= mean.area;
  std::vector<std::pair<int, double>> terms;
  terms.reserve(mean.nodes.size());
  for (std::size_t k = 0; k < mean.nodes.size(); ++k) {
    terms.emplace_back(mean.nodes[k], mean.weights[k] / mean.area);
    place[mean.nodes[k]] = -1;
  }
  std::sort(terms.begin(), terms.end());
  for (std::size_t k = 0; k < terms.size(); ++k) {
    mean.nodes[k] = terms[k].first;
    mean.weights[k] = terms[k].second;
  }
  return mean;
}

} // namespace

int nearest_in_sight(const topology::PointTree& tree, const std::vector<Vector3>& positions,
                     const topology::Incision* incision, const Vector3& x, int guess) {
  const topology::PointTree::Found nearest = tree.nearest(x, guess);
  const double distance = std::sqrt(nearest.squared_distance);
  const auto hidden = [&](int k) { return incision->blocks(x, positions[k]); };
  if (incision == nullptr || distance == 0 || !incision->near(x, distance) || !hidden(nearest.index))
    return nearest.index;
  std::vector<topology::PointTree::Found> found;
  double reach = 2 * distance;
  for (std::size_t seen = 0; seen < positions.size(); reach *= 2) {
    found.clear();
    tree.within(x, reach, found);
    std::sort(found.begin(), found.end());
    for (; seen < found.size(); ++seen)
      if (!hidden(found[seen].index))
        return found[seen].index;
  }
  return nearest.index;
}

namespace {

/// The same for some of the points.
std::vector<int> owners_in_sight(const topology::PointTree& tree, const std::vector<Vector3>& positions,
                                 const topology::Incision* incision, const std::vector<SurfacePoint>& points,
                                 const std::vector<int>& chosen) {
  std::vector<int> nearest(chosen.size());
  parallel_ranges(static_cast<int>(chosen.size()), 256, [&](int begin, int end) {
    for (int k = begin; k < end; ++k)
      nearest[k] =
          nearest_in_sight(tree, positions, incision, points[chosen[k]].position, k > begin ? nearest[k - 1] : -1);
  });
  return nearest;
}

} // namespace

Vector3 DisplacementMean::of(const VectorX& coefficients) const {
  Vector3 value = Vector3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k)
    value += weights[k] * coefficients.segment<3>(3 * nodes[k]);
  return value;
}

Vector3 DisplacementMean::of(const std::function<Vector3(const Vector3& x)>& field) const {
  Vector3 value = Vector3::Zero();
  for (const QuadraturePoint& point : share)
    value += point.weight * field(point.position);
  return value;
}

DisplacementMean reweighed(const DisplacementMean& mean, const Spheres& spheres) {
  if (mean.area == 0)
    return value_at(spheres, mean.centroid);
  std::vector<SurfacePoint> points;
  std::vector<int> all(mean.share.size());
  std::iota(all.begin(), all.end(), 0);
  points.reserve(all.size());
  for (const QuadraturePoint& point : mean.share)
    points.push_back({point.position, Vector3::Zero(), mean.area * point.weight});
  return mean_over(points, all, spheres);
}

DisplacementMean value_at(const Spheres& spheres, const Vector3& x) {
  ShapeFunctions shape;
  if (!evaluate(spheres, x, shape))
    throw NumericalError(
        fmt::format("no sound support covers the point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
  return {shape.nodes, shape.value, x, 0, {{x, 1}}};
}

SurfacePatches::SurfacePatches(const topology::Domain& domain, const NodeCloud& nodes,
                               const std::shared_ptr<const topology::Incision>& incision,
                               const std::optional<BoundingBox>& part, Of of,
                               const std::shared_ptr<const topology::Incision>& opaque)
    : nodes_(nodes), incision_(opaque ? opaque : incision), points_of_node_(nodes.size()) {
  if (of == Of::skin_and_faces)
    points_ =
        surface_quadrature(domain, nodes, share_edge, share_centroid_below, incision.get(), part ? &*part : nullptr);
  faces_begin_ = static_cast<int>(points_.size());
  if (incision != nullptr) {
    const std::vector<SurfacePoint> faces =
        lip_quadrature(*incision, nodes, share_edge, share_centroid_below, part ? &*part : nullptr, share_finest);
    points_.insert(points_.end(), faces.begin(), faces.end());
  }
  for (const bool lips : {false, true}) {
    const int begin = lips ? faces_begin_ : 0, end = lips ? static_cast<int>(points_.size()) : faces_begin_;
    if (begin == end)
      continue;
    std::vector<Vector3> positions;
    std::vector<int> ids;
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] != NodeKind::interior && (nodes.kinds[i] == NodeKind::lip) == lips) {
        positions.push_back(nodes.positions[i]);
        ids.push_back(i);
      }
    if (ids.empty())
      continue;
    const topology::PointTree tree(positions);
    std::vector<int> all(static_cast<std::size_t>(end - begin));
    std::iota(all.begin(), all.end(), begin);
    const std::vector<int> owners = owners_in_sight(tree, positions, incision_.get(), points_, all);
    owners_.resize(static_cast<std::size_t>(end), -1);
    for (std::size_t k = 0; k < all.size(); ++k) {
      owners_[all[k]] = ids[owners[k]];
      points_of_node_[ids[owners[k]]].push_back(all[k]);
    }
  }
}

namespace {

/// Of the points of a share those of the side that faces `facing`; none where sides face it alike.
std::vector<int> facing_side(const std::vector<SurfacePoint>& points, const std::vector<int>& share,
                             const Vector3& facing) {
  constexpr double same_side = 0.7; // cosine between normals of one side of an edge
  constexpr double alike = 0.5;     // of how much the side that faces most does: another one is pressed as well
  const auto turned = [&](int p) { return points[p].normal.dot(facing); };
  const int best = *std::max_element(share.begin(), share.end(), [&](int a, int b) { return turned(a) < turned(b); });
  if (turned(best) <= 0)
    return share;
  std::vector<int> side;
  for (const int p : share)
    if (points[p].normal.dot(points[best].normal) > same_side)
      side.push_back(p);
    else if (turned(p) > alike * turned(best))
      return {};
  return side;
}

} // namespace

DisplacementMean SurfacePatches::mean(int node, const Spheres& spheres, const HeldRegion& held,
                                      const std::optional<Vector3>& facing) const {
  std::vector<int> chosen;
  for (int p : points_of_node_[node])
    if (!held || p >= faces_begin_ || !held(points_[p].position, points_[p].normal))
      chosen.push_back(p);
  if (facing && !chosen.empty() && chosen.front() < faces_begin_)
    chosen = facing_side(points_, chosen, *facing);
  return chosen.empty() ? value_at(spheres, nodes_.positions[node]) : mean_over(points_, chosen, spheres);
}

std::vector<DisplacementMean>
SurfacePatches::means(const std::vector<int>& nodes, const Spheres& spheres,
                      const std::function<bool(const Vector3&, const Vector3&)>& held) const {
  std::vector<Vector3> positions;
  positions.reserve(nodes.size());
  for (int node : nodes)
    positions.push_back(nodes_.positions[node]);
  // The nearest surface node of all is the nearest of these, too, where it is one of them.
  std::vector<int> place(nodes_.size(), -1);
  bool on_surface = true;
  for (int k = 0; k < std::ssize(nodes); ++k) {
    if (place[nodes[k]] < 0) // of two entries the first, as the search has it
      place[nodes[k]] = k;
    on_surface = on_surface && nodes_.kinds[nodes[k]] != NodeKind::interior && nodes_.kinds[nodes[k]] != NodeKind::lip;
  }
  std::vector<std::vector<int>> chosen(nodes.size());
  std::vector<int> others;
  for (int p = 0; p < faces_begin_; ++p)
    if (held(points_[p].position, points_[p].normal)) {
      if (on_surface && owners_[p] >= 0 && place[owners_[p]] >= 0)
        chosen[place[owners_[p]]].push_back(p);
      else
        others.push_back(p);
    }
  if (!others.empty()) {
    const topology::PointTree tree(positions);
    const std::vector<int> owners = owners_in_sight(tree, positions, incision_.get(), points_, others);
    for (std::size_t k = 0; k < others.size(); ++k)
      chosen[owners[k]].push_back(others[k]);
    for (std::vector<int>& points : chosen)
      std::sort(points.begin(), points.end());
  }
  std::vector<DisplacementMean> result(nodes.size());
  parallel_ranges(static_cast<int>(nodes.size()), 4, [&](int begin, int end) {
    for (int k = begin; k < end; ++k)
      result[k] = chosen[k].empty() ? value_at(spheres, positions[k]) : mean_over(points_, chosen[k], spheres);
  });
  return result;
}

std::vector<DisplacementMean> SurfacePatches::means(const std::vector<Prescribed>& entries, const Spheres& spheres,
                                                    const HeldRegion& held) const {
  if (!held.by_axis()) { // one region, shared out among all, whatever axes each holds its share along
    std::vector<int> nodes;
    nodes.reserve(entries.size());
    for (const Prescribed& entry : entries)
      nodes.push_back(entry.node);
    return means(nodes, spheres, [&](const Vector3& x, const Vector3& normal) { return held(x, normal); });
  }
  std::vector<DisplacementMean> result(entries.size());
  std::vector<char> found(entries.size(), 0);
  for (std::size_t first = 0; first < entries.size(); ++first) {
    if (found[first] != 0)
      continue;
    const std::array<bool, 3>& axes = entries[first].components;
    std::vector<int> nodes;
    std::vector<std::size_t> alike;
    for (std::size_t k = first; k < entries.size(); ++k)
      if (entries[k].components == axes) {
        nodes.push_back(entries[k].node);
        alike.push_back(k);
        found[k] = 1;
      }
    std::vector<DisplacementMean> of_nodes =
        means(nodes, spheres, [&](const Vector3& x, const Vector3& normal) { return held.holds(x, normal, axes); });
    for (std::size_t k = 0; k < alike.size(); ++k)
      result[alike[k]] = std::move(of_nodes[k]);
  }
  return result;
}

} // namespace spherecut::solvers
