#include "experiments/remeshing_ledger/mesh_request.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::experiments::ledger {

std::vector<std::vector<Vector3>> mesh_features(const Scenario& scenario, int increment) {
  std::vector<std::vector<Vector3>> features;
  const Front front = front_of(scenario, increment);
  const std::vector<Vector3> border = border_in_plane(scenario);
  // Sharp edges, parted where the plane crosses them: there the border has its corners.
  for (const auto& edge : scenario.sharp_edges) {
    const double a = scenario.height(edge.front()), b = scenario.height(edge.back());
    if ((a < 0) == (b < 0)) {
      features.push_back(edge);
      continue;
    }
    const Vector3 crossing = edge.front() + a / (a - b) * (edge.back() - edge.front());
    features.push_back({edge.front(), crossing});
    features.push_back({crossing, edge.back()});
  }
  // The border with the ends of the front in it.
  std::vector<Vector3> loop = border;
  std::vector<Vector3> ends;
  if (!front.closed)
    ends = {front.points.front(), front.points.back()};
  for (const Vector3& end : ends) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i + 1 < loop.size(); ++i)
      if (const double d = distance_to({loop[i], loop[i + 1]}, end); d < least) {
        least = d;
        best = i;
      }
    loop.insert(loop.begin() + static_cast<std::ptrdiff_t>(best) + 1, end);
  }
  // It begins anew at every corner of the organ and every end of the front.
  const auto breaks = [&](const Vector3& x) {
    return !scenario.sharp_edges.empty() ? true : std::find(ends.begin(), ends.end(), x) != ends.end();
  };
  if (scenario.sharp_edges.empty() && !ends.empty()) {
    loop.pop_back();
    std::rotate(loop.begin(), std::find(loop.begin(), loop.end(), ends.front()), loop.end());
    loop.push_back(loop.front());
  }
  std::vector<Vector3> piece{loop.front()};
  for (std::size_t i = 1; i < loop.size(); ++i) {
    piece.push_back(loop[i]);
    if (breaks(loop[i]) || i + 1 == loop.size()) {
      // Of a curved border only the mouth of the cut counts: long polylines about thin margins hold the mesher up.
      const Vector3 middle = 0.5 * (piece[piece.size() / 2] + piece[(piece.size() - 1) / 2]);
      if (!scenario.sharp_edges.empty() || inside(scenario.outline(increment), scenario.in_plane(middle)))
        features.push_back(piece);
      piece = {loop[i]};
    }
  }
  // The front begins anew at its corners.
  piece = {front.points.front()};
  for (std::size_t i = 1; i < front.points.size(); ++i) {
    piece.push_back(front.points[i]);
    const bool last = i + 1 == front.points.size();
    if (last ||
        (front.points[i] - front.points[i - 1]).normalized().dot((front.points[i + 1] - front.points[i]).normalized()) <
            0.9) {
      features.push_back(piece);
      piece = {front.points[i]};
    }
  }
  return features;
}

CutCurves cut_curves(const Scenario& scenario, int increment) {
  const std::vector<Vector3> front = front_of(scenario, increment).points;
  const std::vector<Vector2> outline = scenario.outline(increment);
  const double rounding = 1e-9 * scenario.size;
  CutCurves curves;
  for (auto& piece : mesh_features(scenario, increment)) {
    if (std::any_of(piece.begin(), piece.end(),
                    [&](const Vector3& x) { return std::abs(scenario.height(x)) > rounding; }))
      continue;
    const Vector3 middle = 0.5 * (piece[piece.size() / 2] + piece[(piece.size() - 1) / 2]);
    if (distance_to(front, middle) < rounding)
      curves.front.push_back(std::move(piece));
    else if (inside(outline, scenario.in_plane(middle)))
      curves.border.push_back(std::move(piece));
  }
  return curves;
}

MeshRequest mesh_request(const Scenario& scenario, int increment, const Grading& grading) {
  MeshRequest request;
  // Where the plane leaves a curved organ at a thin margin the faces meet at sharp angles, and refinement would not
  // end: there the plane parts no more than a ball about the cut.
  double reach = std::numeric_limits<double>::infinity();
  Vector3 middle = Vector3::Zero();
  if (scenario.sharp_edges.empty()) {
    const std::vector<Vector3> front = front_of(scenario, increment).points;
    middle = 0.5 * (front.front() + front.back()); // at the mouth
    reach = 0;
    for (const Vector3& x : front)
      reach = std::max(reach, (x - middle).norm());
    reach += std::max(4 * grading.fine, 0.3 * reach);
  }
  request.label = [&scenario, middle, reach](const Vector3& x) {
    if (!scenario.contains(x))
      return 0;
    return scenario.height(x) < 0 && (x - middle).squaredNorm() < reach * reach ? 2 : 1;
  };
  const BoundingBox box = scenario.domain->bounds();
  request.centre = scenario.inner;
  request.radius = (scenario.inner - box.centre()).norm() + 0.6 * box.extent().norm();
  request.features = mesh_features(scenario, increment);
  request.size = grading;
  request.distance = 0.3 * grading.fine;
  return request;
}

} // namespace spherecut::experiments::ledger
