#include "src/tissue/cut_checks.hpp"

#include "src/model/finite_model.hpp"
#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/wound/splinters.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
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
    const std::vector<Vector3>& x = wound.surface.vertices;
    const double part = (0.5 * (x[triangle[1]] - x[triangle[0]]).cross(x[triangle[2]] - x[triangle[0]])).norm();
    of.area += part;
    for (const int vertex : triangle)
      of.moment += part / 3 * x[vertex];
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
  std::vector<FiniteModel::Touch> touches;
  if (before.finite != nullptr && condition != solvers::ContactCondition::frictionless)
    touches = before.finite->touches();
  for (std::size_t c = 0; before.state && c < before.patch.nodes.size(); ++c)
    if (before.state->tool.active[c] != 0)
      touches.push_back({before.patch.rest[c], before.patch.spacings[c]});
  if (touches.empty())
    return;
  if (condition == solvers::ContactCondition::bonded)
    throw InputError(
        "the tool sticks to the tissue (contact.condition = bonded), and a cut would forget where; allowed: "
        "a frictionless tool, or cutting while the tool is away");
  for (const auto& [x, reach] : touches) {
    if (incision.closest(x, reach) && !(before.incision != nullptr && before.incision->closest(x, reach)))
      throw InputError(
          fmt::format("the blade cuts where the tool is pressing: within {:.3g} m of the contact at [{:.4g}, "
                      "{:.4g}, {:.4g}] m; allowed: a node spacing away, or lift the tool first",
                      reach, x.x(), x.y(), x.z()));
  }
}

void check_held(const Scenario& scenario, const topology::Wound& wound, double time, SessionLog& log) {
  const std::vector<int> unheld = unheld_pieces(wound, scenario.fixed);
  if (unheld.empty())
    return;
  const double volume = wound.pieces[static_cast<std::size_t>(unheld.front())].volume;
  const std::string what = fmt::format("{} of {} pieces ({:.3g} m3) {} severed and held by no fixed region",
                                       unheld.size(), wound.pieces.size(), volume, unheld.size() == 1 ? "is" : "are");
  const bool none_with_law = is_nonlinear(scenario.law);
  if (none_with_law || scenario.cut.unheld == solvers::UnheldPieces::refuse)
    throw InputError(
        fmt::format("{}{}; {}. A region of [[fixed]] that holds {} does, or a cut ({}) that ends before {}",
                    scenario.blade || scenario.precuts.empty()
                        ? std::string() // a motion or a tear is refused, not a line
                        : fmt::format("{}:{}: ", scenario.file.string(), scenario.precuts.front().line),
                    what,
                    none_with_law ? fmt::format("material.law = \"{}\" allows none, whatever cut.unheld "
                                                "says: \"hold\" and \"drop\" go with law linear",
                                                name_of(scenario.law))
                                  : std::string("cut.unheld = \"refuse\" allows none, \"hold\" and "
                                                "\"drop\" do"),
                    unheld.size() == 1 ? "it" : "them",
                    scenario.blade             ? "blade.path"
                    : scenario.precuts.empty() ? "tool.path"
                                               : "precut",
                    unheld.size() == 1 ? "it comes off" : "they come off"));
  log.warn(fmt::format("unheld {}", unheld.size()),
           fmt::format("t = {:g} s: {}: {}", time, what,
                       scenario.cut.unheld == solvers::UnheldPieces::hold ? "soft springs hold it"
                                                                          : "it leaves the computation"));
}

} // namespace spherecut::app
