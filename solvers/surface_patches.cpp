#include "solvers/surface_patches.hpp"

#include "topology/errors.hpp"
#include "topology/point_tree.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

/// Edge of the surface quadrature's triangles in spacings: a mean over a share needs less than a traction does.
constexpr double share_edge = 0.6, share_centroid_below = 0.36;

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

Vector3 DisplacementMean::of(const VectorX& coefficients) const {
  Vector3 value = Vector3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k)
    value += weights[k] * coefficients.segment<3>(3 * nodes[k]);
  return value;
}

DisplacementMean value_at(const Spheres& spheres, const Vector3& x) {
  ShapeFunctions shape;
  if (!evaluate(spheres, x, shape))
    throw NumericalError(
        fmt::format("no sound support covers the point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
  return {shape.nodes, shape.value, x, 0};
}

SurfacePatches::SurfacePatches(const topology::Domain& domain, const NodeCloud& nodes)
    : nodes_(nodes), points_(surface_quadrature(domain, nodes, share_edge, share_centroid_below)),
      points_of_node_(nodes.size()) {
  std::vector<Vector3> positions;
  std::vector<int> ids;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] != NodeKind::interior) {
      positions.push_back(nodes.positions[i]);
      ids.push_back(i);
    }
  if (ids.empty())
    return;
  const topology::PointTree tree(positions);
  for (int p = 0; p < std::ssize(points_); ++p)
    points_of_node_[ids[tree.nearest(points_[p].position).index]].push_back(p);
}

DisplacementMean SurfacePatches::mean(int node, const Spheres& spheres,
                                      const std::function<bool(const Vector3&, const Vector3&)>& held) const {
  std::vector<int> chosen;
  for (int p : points_of_node_[node])
    if (!held || !held(points_[p].position, points_[p].normal))
      chosen.push_back(p);
  return chosen.empty() ? value_at(spheres, nodes_.positions[node]) : mean_over(points_, chosen, spheres);
}

std::vector<DisplacementMean>
SurfacePatches::means(const std::vector<int>& nodes, const Spheres& spheres,
                      const std::function<bool(const Vector3&, const Vector3&)>& held) const {
  std::vector<Vector3> positions;
  positions.reserve(nodes.size());
  for (int node : nodes)
    positions.push_back(nodes_.positions[node]);
  const topology::PointTree tree(positions);
  std::vector<std::vector<int>> chosen(nodes.size());
  for (int p = 0; p < std::ssize(points_); ++p)
    if (held(points_[p].position, points_[p].normal))
      chosen[tree.nearest(points_[p].position).index].push_back(p);
  std::vector<DisplacementMean> result;
  result.reserve(nodes.size());
  for (std::size_t k = 0; k < nodes.size(); ++k)
    result.push_back(chosen[k].empty() ? value_at(spheres, positions[k]) : mean_over(points_, chosen[k], spheres));
  return result;
}

} // namespace spherecut::solvers
