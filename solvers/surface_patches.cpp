#include "solvers/surface_patches.hpp"

#include "topology/errors.hpp"
#include "topology/point_tree.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

DisplacementMean mean_over(const std::vector<SurfacePoint>& points, const std::vector<int>& chosen,
                           const Spheres& spheres) {
  DisplacementMean mean;
  std::vector<std::pair<int, double>> terms;
  ShapeFunctions shape;
  for (int p : chosen) {
    if (!evaluate(spheres, points[p].position, shape))
      throw NumericalError(fmt::format("no sound support covers the surface point ({:.6g}, {:.6g}, {:.6g}) m",
                                       points[p].position.x(), points[p].position.y(), points[p].position.z()));
    mean.area += points[p].weight;
    mean.centroid += points[p].weight * points[p].position;
    for (int k = 0; k < shape.size(); ++k)
      terms.emplace_back(shape.nodes[k], points[p].weight * shape.value[k]);
  }
  mean.centroid /= mean.area;
  std::stable_sort(terms.begin(), terms.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [node, weight] : terms) {
    if (mean.nodes.empty() || mean.nodes.back() != node) {
      mean.nodes.push_back(node);
      mean.weights.push_back(0);
    }
    mean.weights.back() += weight / mean.area;
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
    : nodes_(nodes), points_(surface_quadrature(domain, nodes)), points_of_node_(nodes.size()) {
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
