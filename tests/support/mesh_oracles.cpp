#include "tests/support/mesh_oracles.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::tests {

namespace {

/// Closest point of one triangle to x [Ericson, Real-Time Collision Detection, sec. 5.1.5].
Vector3 closest_on_triangle(const Vector3& x, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax), d3 = ab.dot(bx), d4 = ac.dot(bx), d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d1 <= 0 && d2 <= 0)
    return a;
  if (d3 >= 0 && d4 <= d3)
    return b;
  if (d6 >= 0 && d5 <= d6)
    return c;
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0)
    return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0)
    return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  return a + (vb * ab + vc * ac) / (va + vb + vc);
}

} // namespace

double brute_force_distance(const topology::SurfaceMesh& mesh, const Vector3& x) {
  double best = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles)
    best = std::min(
        best,
        (x - closest_on_triangle(x, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]])).squaredNorm());
  return std::sqrt(best);
}

bool inside_by_winding(const topology::SurfaceMesh& mesh, const Vector3& x) {
  double angle = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3 a = mesh.vertices[t[0]] - x, b = mesh.vertices[t[1]] - x, c = mesh.vertices[t[2]] - x;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle > 6;
}

Vector3 random_point(const BoundingBox& box, std::mt19937& random, double margin) {
  std::uniform_real_distribution<double> unit(-margin, 1 + margin);
  const double u = unit(random), v = unit(random), w = unit(random);
  return box.lower + Vector3(u, v, w).cwiseProduct(box.extent());
}

} // namespace spherecut::tests
