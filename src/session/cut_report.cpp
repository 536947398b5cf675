#include "src/session/cut_report.hpp"

#include "topology/base/errors.hpp"
#include "topology/wound/splinters.hpp"

#include <Eigen/Eigenvalues>
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
  case SystemUpdate::condensed_anew:
    return "condensed anew";
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
  report.seconds.solve = take(body.body->report().factor_seconds);
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

namespace {

// Area, m2, and centre of area times it, of every piece.
struct PieceArea {
  double area = 0;
  Vector3 moment = Vector3::Zero();
};

std::vector<PieceArea> piece_areas(const topology::Wound& wound) {
  std::vector<PieceArea> areas(wound.pieces.size());
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    const Triangle& triangle = wound.surface.triangles[t];
    PieceArea& of = areas[static_cast<std::size_t>(wound.piece_of(static_cast<int>(t)))];
    const double part = area_vector(wound.surface, triangle).norm();
    of.area += part;
    for (const int vertex : triangle)
      of.moment += part / 3 * wound.surface.vertices[vertex];
  }
  return areas;
}

// m; the diameter of a ball of the same volume over area. 0 for what has come to nothing.
double size_of(const topology::WoundPiece& piece, const PieceArea& of) {
  return of.area > 0 ? 6 * piece.volume / of.area : 0;
}

} // namespace

void refine_small_pieces(const topology::Wound& wound, solvers::SpacingField& spacing) {
  if (wound.pieces.size() < 2)
    return;
  const std::vector<PieceArea> areas = piece_areas(wound);
  for (std::size_t piece = 0; piece < wound.pieces.size(); ++piece) {
    if (areas[piece].area <= 0)
      continue;
    const Vector3 middle = areas[piece].moment / areas[piece].area;
    const double size = size_of(wound.pieces[piece], areas[piece]);
    if (size >= spacing(middle) || size < spacing.fine)
      continue;
    Matrix3 spread = Matrix3::Zero();
    std::vector<Vector3> corners;
    for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t)
      if (wound.piece_of(static_cast<int>(t)) == static_cast<int>(piece))
        for (const int vertex : wound.surface.triangles[t]) {
          corners.push_back(wound.surface.vertices[vertex] - middle);
          spread += corners.back() * corners.back().transpose();
        }
    const Vector3 axis = Eigen::SelfAdjointEigenSolver<Matrix3>(spread).eigenvectors().col(2);
    double lower = 0, upper = 0;
    for (const Vector3& corner : corners) {
      lower = std::min(lower, axis.dot(corner));
      upper = std::max(upper, axis.dot(corner));
    }
    spacing.segments.push_back({middle + lower * axis, middle + upper * axis});
  }
}

void require_pieces(const topology::Wound& wound, const solvers::SpacingField& spacing) {
  if (wound.pieces.size() < 2)
    return;
  const std::vector<topology::PieceShape> shapes = topology::piece_shapes(wound);
  for (std::size_t piece = 0; piece < shapes.size(); ++piece) {
    const auto& [size, middle] = shapes[piece];
    if (const double h = spacing(middle); size < h)
      throw InputError(
          fmt::format("the cut leaves a piece of {:.3g} m3 at [{:.4g}, {:.4g}, {:.4g}] m that is smaller "
                      "than the node spacing there: {:.3g} m across; allowed: at least {:.3g} m. Finer nodes "
                      "(cut.front_spacing, nodes.fine_spacing, nodes.count) or a cut elsewhere do",
                      wound.pieces[piece].volume, middle.x(), middle.y(), middle.z(), size, h));
  }
}

std::vector<int> unheld_pieces(const topology::Wound& wound, const std::vector<FixedRegion>& fixed) {
  std::vector<char> held(wound.pieces.size(), 0);
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    char& mark = held[static_cast<std::size_t>(wound.piece_of(static_cast<int>(t)))];
    if (mark != 0 || wound.part[t] != topology::WoundPart::organ)
      continue;
    const Triangle& triangle = wound.surface.triangles[t];
    const std::vector<Vector3>& vertices = wound.surface.vertices;
    const Vector3 middle = (vertices[triangle[0]] + vertices[triangle[1]] + vertices[triangle[2]]) / 3;
    mark = std::any_of(fixed.begin(), fixed.end(), [&](const FixedRegion& region) { return region.holds(middle); });
  }
  std::vector<int> unheld;
  for (std::size_t piece = 0; piece < held.size(); ++piece)
    if (held[piece] == 0)
      unheld.push_back(static_cast<int>(piece));
  return unheld;
}

void require_clear_of_tool(const topology::Incision& incision, const BodyModel& before,
                           solvers::ContactCondition condition) {
  if (!before.state || before.state->tool.active_nodes == 0)
    return;
  if (condition == solvers::ContactCondition::bonded)
    throw InputError(
        "the tool sticks to the tissue (contact.condition = bonded), and a cut would forget where; allowed: "
        "a frictionless tool, or cutting while the tool is away");
  for (std::size_t c = 0; c < before.patch.nodes.size(); ++c) {
    if (before.state->tool.active[c] == 0)
      continue;
    const Vector3& x = before.patch.rest[c];
    const double reach = before.patch.spacings[c];
    if (incision.closest(x, reach) && !(before.incision != nullptr && before.incision->closest(x, reach)))
      throw InputError(
          fmt::format("the blade cuts where the tool is pressing: within {:.3g} m of the contact at [{:.4g}, "
                      "{:.4g}, {:.4g}] m; allowed: a node spacing away, or lift the tool first",
                      reach, x.x(), x.y(), x.z()));
  }
}

} // namespace spherecut::app
