#include "topology/cells/cell_clipper.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace spherecut::topology {

PolygonMeasure measure(const std::vector<Vector3>& polygon) {
  PolygonMeasure result;
  const Vector3& origin = polygon.front();
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k)
    result.area += 0.5 * (polygon[k] - origin).cross(polygon[k + 1] - origin);
  const double total = result.area.norm();
  if (total <= 0)
    return {};
  const Vector3 normal = result.area / total;
  // Signed weights: a polygon bent inwards by its arc vertices stays right.
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
    const double weight = 0.5 * (polygon[k] - origin).cross(polygon[k + 1] - origin).dot(normal);
    result.centroid += weight / total * (origin + polygon[k] + polygon[k + 1]) / 3;
  }
  return result;
}

bool CurvedClipper::clip(CellPolygon& polygon) {
  const std::size_t count = polygon.vertices.size();
  const bool outside = std::all_of(polygon.phi.begin(), polygon.phi.end(), [](double v) { return v >= 0; });
  if (outside)
    return false;
  if (std::all_of(polygon.phi.begin(), polygon.phi.end(), [](double v) { return v < 0; }))
    return true;
  std::vector<Vector3> kept;
  Vector3 exit = Vector3::Zero();
  bool have_exit = false;
  std::size_t start = 0; // begin at an inside vertex so that every exit precedes its entry
  while (polygon.phi[start] >= 0)
    ++start;
  const Vector3 normal = measure(polygon.vertices).area.normalized();
  for (std::size_t step = 0; step < count; ++step) {
    const std::size_t k = (start + step) % count, next = (k + 1) % count;
    if (polygon.phi[k] < 0)
      kept.push_back(polygon.vertices[k]);
    if ((polygon.phi[k] < 0) == (polygon.phi[next] < 0))
      continue;
    const Vector3 crossing = root(polygon.vertices[k], polygon.phi[k], polygon.vertices[next], polygon.phi[next]);
    if (polygon.phi[k] < 0) {
      exit = crossing;
      have_exit = true;
      kept.push_back(crossing);
    } else {
      if (have_exit)
        add_arc(exit, crossing, normal, kept);
      kept.push_back(crossing);
    }
    surface_sum_ += crossing;
    ++surface_count_;
  }
  polygon.vertices = std::move(kept);
  return polygon.vertices.size() >= 3;
}

/// Crossing of the edge a b with phi = 0 by the Illinois form of false position: the value at an end that stays for a
/// second time is halved.
Vector3 CurvedClipper::root(Vector3 a, double phi_a, Vector3 b, double phi_b) const {
  Vector3 x = a;
  int stayed = 0; // +1: b stayed last time, -1: a did
  for (int iteration = 0; iteration < 12; ++iteration) {
    x = a + phi_a / (phi_a - phi_b) * (b - a);
    const double value = phi(x);
    if (std::abs(value) < 1e-10 || (b - a).squaredNorm() < 1e-20)
      break;
    if ((value < 0) == (phi_a < 0)) {
      a = x;
      phi_a = value;
      if (stayed > 0)
        phi_b *= 0.5;
      stayed = 1;
    } else {
      b = x;
      phi_b = value;
      if (stayed < 0)
        phi_a *= 0.5;
      stayed = -1;
    }
  }
  return x;
}

/// The surface bends between two crossings: one vertex on the arc, in the polygon's plane, makes the cut second
/// order.
void CurvedClipper::add_arc(const Vector3& from, const Vector3& to, const Vector3& normal,
                            std::vector<Vector3>& kept) const {
  const Vector3 chord = to - from;
  if (chord.squaredNorm() < 1e-12)
    return;
  const Vector3 outward = chord.cross(normal).normalized();
  const Vector3 middle = 0.5 * (from + to);
  Vector3 x = middle;
  for (int iteration = 0; iteration < 4; ++iteration) {
    const double value = phi(x);
    const double slope = domain_.curved_gradient(node_ + spacing_ * x).dot(outward);
    if (std::abs(slope) < 0.2)
      return;
    x -= value / slope * outward;
    if (std::abs(value) < 1e-8)
      break;
  }
  if ((x - middle).norm() < 0.5 * chord.norm())
    kept.push_back(x);
}

} // namespace spherecut::topology
