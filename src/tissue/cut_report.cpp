#include "src/tissue/cut_report.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <fmt/format.h>
#include <optional>

namespace spherecut::app {
namespace {

// Half the cross product of two sides: area times outward normal, m2.
Vector3 area_vector(const std::array<Vector3, 3>& corners) {
  return 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]);
}

Vector3 area_vector(const topology::SurfaceMesh& surface, const Triangle& triangle) {
  return area_vector({surface.vertices[triangle[0]], surface.vertices[triangle[1]], surface.vertices[triangle[2]]});
}

} // namespace

std::string_view to_string(SystemUpdate update) {
  switch (update) {
  case SystemUpdate::none:
    return "";
  case SystemUpdate::updated:
    return "updated";
  case SystemUpdate::taken_over:
    return "taken over";
  case SystemUpdate::rebuilt:
    return "rebuilt";
  }
  return "";
}

void report_body(const BodyModel& body, double sight, BodyUpdate& report) {
  // What is told to have taken longer than all of the stage was spent beside it, on another thread or before.
  double left = std::max(0.0, report.seconds.assembly);
  const auto take = [&left](double seconds) {
    const double part = std::clamp(seconds, 0.0, left);
    left -= part;
    return part;
  };
  report.seconds.visibility = take(sight);
  report.seconds.solve = body.body != nullptr ? take(body.body->report().factor_seconds) : 0;
  report.seconds.assembly = left;
  report.nodes = body.sprinkling.nodes.size();
  const std::vector<int>& from = body.sprinkling.kept_from;
  report.kept_nodes = static_cast<int>(std::count_if(from.begin(), from.end(), [](int i) { return i >= 0; }));
}

void CutReport::add(const CutReport& later) {
  triangles += later.triangles;
  if (later.refused || !refused)
    reason = later.reason.empty() ? reason : later.reason;
  refused = refused || later.refused;
  if (later.update != SystemUpdate::none) {
    update = later.update;
    update_reason = later.update_reason;
    has_grown = later.has_grown;
    nodes = later.nodes;
    kept_nodes = later.kept_nodes;
  }
  seconds.topology += later.seconds.topology;
  seconds.level_sets += later.seconds.level_sets;
  seconds.visibility += later.seconds.visibility;
  seconds.sprinkling += later.seconds.sprinkling;
  seconds.assembly += later.seconds.assembly;
  seconds.solve += later.seconds.solve;
}

void refuse_cut(double time, const char* why, CutReport& report, SessionLog& log) {
  report.triangles = 0;
  report.refused = true;
  report.reason = why;
  report.update = SystemUpdate::none;
  report.update_reason.clear();
  report.nodes = report.kept_nodes = 0;
  log.warn("refused", fmt::format("a cut was refused at t = {:g} s: {}", time, why));
}

namespace {

/// Mean over a triangle of a displacement that is known at its corners, some of them on the front of the cut: from
/// there on a face moves with the root of the distance.
Vector3 mean_moved(const std::array<Vector3, 3>& moved, const std::array<bool, 3>& on_front) {
  // Means of the root over a triangle, of its largest value: from one corner to the side across, from a side to the
  // corner across.
  constexpr double from_corner = 4.0 / 5, from_side = 8.0 / 15;
  const auto count = std::count(on_front.begin(), on_front.end(), true);
  if (count == 0 || count == 3)
    return (moved[0] + moved[1] + moved[2]) / 3;
  Vector3 at_front = Vector3::Zero(), off_it = Vector3::Zero();
  for (std::size_t corner = 0; corner < 3; ++corner)
    (on_front[corner] ? at_front : off_it) += moved[corner];
  at_front /= static_cast<double>(count);
  off_it /= static_cast<double>(3 - count);
  return at_front + (count == 1 ? from_corner : from_side) * (off_it - at_front);
}

} // namespace

// At finite strain the faces have turned and been stretched: what they sweep is measured on the mean of their area over
// the way from rest (Simpson's rule is exact for it), and how far they are apart along their normals as they are.
Opening opening_of(const topology::Wound& wound, const BodyModel& model) {
  std::vector<std::optional<Vector3>> displacement(wound.surface.vertices.size());
  const auto moved = [&](int vertex) {
    if (!displacement[vertex])
      displacement[vertex] = model.at(wound.evaluation[vertex]).displacement;
    return *displacement[vertex];
  };
  Opening opening;
  std::vector<Vector3> into_plus(wound.surface.vertices.size(), Vector3::Zero()); // m2, along the normal of the sheet
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    if (wound.part[t] == topology::WoundPart::organ)
      continue;
    const Triangle& triangle = wound.surface.triangles[t];
    const Vector3 area = area_vector(wound.surface, triangle);
    std::array<Vector3, 3> at_corners;
    std::array<bool, 3> on_front{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const int vertex = triangle[corner];
      at_corners[corner] = moved(vertex);
      on_front[corner] = wound.evaluation[vertex] == wound.surface.vertices[vertex];
    }
    Vector3 swept = area, now = area;
    if (model.finite != nullptr) {
      const auto moved_by = [&](double part) {
        return area_vector({wound.surface.vertices[triangle[0]] + part * at_corners[0],
                            wound.surface.vertices[triangle[1]] + part * at_corners[1],
                            wound.surface.vertices[triangle[2]] + part * at_corners[2]});
      };
      now = moved_by(1);
      swept = (area + 4 * moved_by(0.5) + now) / 6;
    }
    opening.volume -= mean_moved(at_corners, on_front).dot(swept); // outward is into the cut
    if (wound.part[t] == topology::WoundPart::wall_plus)
      for (const int vertex : triangle)
        into_plus[vertex] -= now;
  }
  for (const topology::LipPair& pair : topology::lip_pairs(wound))
    if (const Vector3& normal = into_plus[pair.plus]; !normal.isZero(0))
      opening.largest = std::max(opening.largest, normal.normalized().dot(moved(pair.plus) - moved(pair.minus)));
  return opening;
}

} // namespace spherecut::app
