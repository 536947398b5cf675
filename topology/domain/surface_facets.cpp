#include "topology/domain/surface_facets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace spherecut::topology {

namespace {

BoundingBox box_around(const Vector3& a, const Vector3& b) {
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

double distance_to_segment(const Vector3& x, const Vector3& a, const Vector3& b) {
  const Vector3 ab = b - a;
  const double along = ab.squaredNorm() > 0 ? std::clamp(ab.dot(x - a) / ab.squaredNorm(), 0.0, 1.0) : 0;
  return (a + along * ab - x).norm();
}

} // namespace

SurfaceFacets::SurfaceFacets(const SurfaceMesh& mesh) : mesh_(mesh) {
  const int count = static_cast<int>(mesh.triangles.size());
  const auto neighbours = triangle_neighbours(mesh);
  std::vector<Vector3> normals(mesh.triangles.size());
  std::vector<BoundingBox> boxes;
  for (int t = 0; t < count; ++t) {
    normals[t] = triangle_normal(mesh, t);
    const Triangle& v = mesh.triangles[t];
    BoundingBox box = box_around(mesh.vertices[v[0]], mesh.vertices[v[1]]);
    box.lower = box.lower.cwiseMin(mesh.vertices[v[2]]);
    box.upper = box.upper.cwiseMax(mesh.vertices[v[2]]);
    boxes.push_back(box);
  }
  triangles_ = BoxTree(boxes);
  const double limit = std::cos(sharp_facets * std::numbers::pi / 180);
  const auto is_sharp = [&](int t, int other) { return other < 0 || normals[t].dot(normals[other]) < limit; };
  std::vector<BoundingBox> edge_boxes;
  pieces_.assign(mesh.triangles.size(), -1);
  int pieces = 0;
  for (int seed = 0; seed < count; ++seed) {
    if (pieces_[seed] >= 0)
      continue;
    std::vector<int> open{seed};
    pieces_[seed] = pieces;
    while (!open.empty()) {
      const int t = open.back();
      open.pop_back();
      for (int e = 0; e < 3; ++e) {
        const int other = neighbours[t][e];
        if (!is_sharp(t, other)) {
          if (pieces_[other] < 0) {
            pieces_[other] = pieces;
            open.push_back(other);
          }
          continue;
        }
        if (other < t)
          continue;
        const Vector3 &a = mesh.vertices[mesh.triangles[t][e]], &b = mesh.vertices[mesh.triangles[t][(e + 1) % 3]];
        sharp_.push_back({a, b, normals[t].cross(normals[other]).dot(b - a) > 0});
        edge_boxes.push_back(box_around(a, b));
      }
    }
    ++pieces;
  }
  if (!edge_boxes.empty())
    edges_ = BoxTree(edge_boxes);
}

std::vector<int> SurfaceFacets::near(const BoundingBox& box) const {
  std::vector<int> found;
  (void)triangles_.any_between(box.centre(), 0.5 * box.extent(), box.centre(), [&](int place) {
    found.push_back(triangles_.order()[static_cast<std::size_t>(place)]);
    return false; // all of them
  });
  std::sort(found.begin(), found.end());
  return found;
}

SurfaceFacets::SharpNear SurfaceFacets::sharp_near(const Vector3& x, double radius) const {
  SharpNear near;
  if (edges_.empty())
    return near;
  (void)edges_.any_between(x, Vector3::Constant(radius), x, [&](int place) {
    const SharpSegment& edge = sharp_[static_cast<std::size_t>(edges_.order()[static_cast<std::size_t>(place)])];
    if (distance_to_segment(x, edge.from, edge.to) < radius) {
      near.any = true;
      near.concave = near.concave || !edge.convex;
    }
    return near.any && near.concave;
  });
  return near;
}

} // namespace spherecut::topology
