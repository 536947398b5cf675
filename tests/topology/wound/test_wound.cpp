// The surface of a cut organ: closed and manifold for sheets in any position, volume kept, pieces counted and measured.
#include "tests/support/mesh_checks.hpp"
#include "tests/support/sheets.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"
#include "topology/wound/wound.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::flat_sheet;
using spherecut::tests::grid_sheet;

namespace {

/// 100 x 60 x 40 mm on z = 0, edges of 10 mm on a lattice.
SurfaceMesh block_surface() {
  return make_block({0.1, 0.06, 0.04}, 0.01);
}

constexpr double block_volume = 0.1 * 0.06 * 0.04; // m3

/// Cuts, and requires what holds for every wound. Returns it with its pieces' volumes in ascending order.
struct Cut {
  Wound wound;
  std::vector<double> volumes; // m3
};

Cut cut(const SurfaceMesh& organ, const std::vector<SurfaceMesh>& sheets) {
  Cut result{cut_surface(organ, sheets), {}};
  const Wound& wound = result.wound;
  INFO(manifold_defect(wound.surface).value_or("closed and manifold"));
  REQUIRE_FALSE(manifold_defect(wound.surface));
  CHECK(volume(wound.surface) == Approx(volume(organ)).epsilon(1e-9));
  double sum = 0;
  int triangles = 0, euler = 0;
  for (const WoundPiece& piece : wound.pieces) {
    result.volumes.push_back(piece.volume);
    sum += piece.volume;
    triangles += piece.triangles;
    euler += piece.euler;
  }
  std::sort(result.volumes.begin(), result.volumes.end());
  CHECK(sum == Approx(volume(organ)).epsilon(1e-9));
  CHECK(triangles == std::ssize(wound.surface.triangles));
  CHECK(euler == tests::euler_characteristic(wound.surface));
  // Walls face each other: equal areas, opposite normals.
  Vector3 area_vector = Vector3::Zero();
  for (int t = 0; t < std::ssize(wound.part); ++t)
    if (wound.part[t] != WoundPart::organ) {
      const auto& [a, b, c] = wound.surface.triangles[t];
      const std::vector<Vector3>& x = wound.surface.vertices;
      area_vector += (x[b] - x[a]).cross(x[c] - x[a]);
    }
  CHECK(area_vector.norm() < 1e-15);
  return result;
}

double wall_area(const Wound& wound, WoundPart part) {
  SurfaceMesh walls{wound.surface.vertices, {}};
  for (int t = 0; t < std::ssize(wound.part); ++t)
    if (wound.part[t] == part)
      walls.triangles.push_back(wound.surface.triangles[t]);
  return area(walls);
}

int walls(const Wound& wound) {
  return static_cast<int>(
      std::count_if(wound.part.begin(), wound.part.end(), [](WoundPart part) { return part != WoundPart::organ; }));
}

/// A rotation and shift that align nothing with axes or lattice.
Vector3 askew(const Vector3& x) {
  const Eigen::AngleAxisd turn(0.31, Vector3(0.5, -0.3, 0.8).normalized());
  const Vector3 centre(0, 0, 0.02);
  return centre + turn * (x - centre) + Vector3(0.00137, -0.00071, 0.00093);
}

/// Axis parallel sheets and the same askew.
std::vector<SurfaceMesh> placed(std::vector<SurfaceMesh> sheets, bool turned) {
  if (turned)
    for (SurfaceMesh& sheet : sheets)
      sheet = tests::moved(sheet, askew);
  return sheets;
}

} // namespace

TEST_CASE("A cut from the top opens a rim and two walls, and leaves one sphere", "[wound]") {
  const bool turned = GENERATE(false, true);
  // Plane x = 3 mm (off the lattice), 30 mm wide, 25 mm deep from the top.
  const auto sheet = flat_sheet({0.003, -0.015, 0.015}, {0, 0.03, 0}, {0, 0, 0.05}, 15, 20);
  const Cut result = cut(block_surface(), placed({sheet}, turned));
  const Wound& wound = result.wound;
  REQUIRE(wound.components.size() == 1);
  CHECK(wound.components[0].euler == 2);
  REQUIRE(wound.pieces.size() == 1);
  if (!turned) {
    CHECK(wall_area(wound, WoundPart::wall_plus) == Approx(0.03 * 0.025));
    CHECK(wall_area(wound, WoundPart::wall_minus) == Approx(0.03 * 0.025));
  }
  // The lips part inside the rim and nowhere on the front.
  const std::vector<LipPair> lips = lip_pairs(wound);
  REQUIRE_FALSE(lips.empty());
  for (const LipPair& lip : lips) {
    CHECK(wound.surface.vertices[lip.plus] == wound.surface.vertices[lip.minus]);
    if (!turned) {
      CHECK(std::abs(wound.surface.vertices[lip.plus].y()) < 0.015);
      CHECK(wound.surface.vertices[lip.plus].z() > 0.015);
      // The normal of the sheet is +x: the + side lies at larger x.
      CHECK(wound.evaluation[lip.plus].x() > 0.003);
      CHECK(wound.evaluation[lip.minus].x() < 0.003);
      CHECK(wound.evaluation[lip.plus].x() < 0.003 + 1e-5);
    }
  }
  if (!turned) // 14 columns inside times 10 rows at least
    CHECK(lips.size() >= 140);
}

TEST_CASE("A cut through the block leaves two pieces with exact volumes", "[wound]") {
  const bool turned = GENERATE(false, true);
  const auto sheet = flat_sheet({0.013, -0.05, -0.03}, {0, 0.1, 0}, {0, 0, 0.1}, 8, 9);
  const Cut result = cut(block_surface(), placed({sheet}, turned));
  REQUIRE(result.wound.pieces.size() == 2);
  REQUIRE(result.wound.components.size() == 2);
  for (const WoundComponent& component : result.wound.components)
    CHECK(component.euler == 2);
  if (!turned) {
    CHECK(result.volumes[0] == Approx(0.037 * 0.06 * 0.04).epsilon(1e-12));
    CHECK(result.volumes[1] == Approx(0.063 * 0.06 * 0.04).epsilon(1e-12));
  }
  CHECK(lip_pairs(result.wound).size() > 20);
}

TEST_CASE("Wedge off a corner: the plane's exact volume", "[wound]") {
  // Plane through (0.05, y, 0.01), (0.02, y, 0.04): prism of triangle 30 x 30 mm.
  const auto sheet = flat_sheet({0.06, -0.04, 0}, {0, 0.08, 0}, {-0.06, 0, 0.06}, 7, 11);
  const Cut result = cut(block_surface(), {sheet});
  REQUIRE(result.wound.pieces.size() == 2);
  CHECK(result.volumes[0] == Approx(0.5 * 0.03 * 0.03 * 0.06).epsilon(1e-12));
}

TEST_CASE("A buried sheet is a cavity of no volume in the same piece", "[wound]") {
  const int columns = GENERATE(1, 2, 6);
  const auto sheet = flat_sheet({-0.012, -0.009, 0.0173}, {0.02, 0.003, 0.001}, {0.002, 0.02, 0.004}, columns, columns);
  const Cut result = cut(block_surface(), {sheet});
  const Wound& wound = result.wound;
  REQUIRE(wound.components.size() == 2);
  REQUIRE(wound.pieces.size() == 1);
  CHECK(wound.pieces[0].components == 2);
  CHECK(wound.pieces[0].euler == 4);
  CHECK(std::min(wound.components[0].volume, wound.components[1].volume) == 0.0);
  // All vertices on the border of the sheet are single.
  int single = 0;
  for (int v = 0; v < std::ssize(wound.surface.vertices); ++v)
    if (std::find(sheet.vertices.begin(), sheet.vertices.end(), wound.surface.vertices[v]) != sheet.vertices.end())
      single += std::count(wound.point.begin(), wound.point.end(), wound.point[v]) == 1 ? 1 : 0;
  CHECK(single == 4 * columns);
}

TEST_CASE("A buried sheet of a single triangle is cut as well", "[wound]") {
  const SurfaceMesh sheet{{{0.001, 0.002, 0.01}, {0.021, 0.003, 0.012}, {0.004, 0.018, 0.019}}, {{0, 1, 2}}};
  const Cut result = cut(block_surface(), {sheet});
  REQUIRE(result.wound.components.size() == 2);
  CHECK(walls(result.wound) == 6);
}

TEST_CASE("Pieces own the cavities inside them", "[wound]") {
  // Through at x = 0.013; a disc buried in each half, the larger in the smaller half.
  const auto through = flat_sheet({0.013, -0.05, -0.03}, {0, 0.1, 0}, {0, 0, 0.1}, 3, 3);
  const auto left = flat_sheet({-0.03, -0.01, 0.021}, {0.01, 0, 0}, {0, 0.01, 0.001}, 2, 2);
  const auto right = flat_sheet({0.02, -0.01, 0.021}, {0.02, 0, 0}, {0, 0.02, 0.001}, 3, 3);
  const Wound wound = cut(block_surface(), {through, left, right}).wound;
  REQUIRE(wound.pieces.size() == 2);
  for (int t = 0; t < std::ssize(wound.part); ++t) {
    Vector3 middle = Vector3::Zero();
    for (const int v : wound.surface.triangles[t])
      middle += wound.surface.vertices[v] / 3;
    const double volume = wound.pieces[wound.piece_of(t)].volume;
    if (middle.x() < 0.0129)
      CHECK(volume == Approx(0.063 * 0.06 * 0.04));
    if (middle.x() > 0.0131)
      CHECK(volume == Approx(0.037 * 0.06 * 0.04));
  }
}

TEST_CASE("A curved sheet cuts like a flat one", "[wound]") {
  const auto sheet = grid_sheet(24, 20, [](double s, double t) {
    const double y = -0.04 + 0.08 * s, z = 0.012 + 0.05 * t;
    return Vector3(0.0031 + 0.01 * std::sin(60 * y) + 0.004 * std::sin(90 * z), y, z);
  });
  const Cut partial = cut(block_surface(), {sheet});
  REQUIRE(partial.wound.components.size() == 1);
  CHECK(partial.wound.components[0].euler == 2);
}

TEST_CASE("A path that turns: two sheets joined in a corner act as one", "[wound]") {
  const auto first = flat_sheet({-0.0213, 0.0021, 0.0117}, {0.03, 0, 0}, {0, 0, 0.04}, 10, 12);
  const auto second = flat_sheet({0.0087, 0.0021, 0.0117}, {0, 0.02, 0}, {0, 0, 0.04}, 7, 12);
  const Wound wound = cut(block_surface(), {first, second}).wound;
  REQUIRE(wound.components.size() == 1);
  CHECK(wound.components[0].euler == 2);
  // Along the corner inside, each point has one copy in the corner and one around it.
  for (int v = 0; v < std::ssize(wound.surface.vertices); ++v) {
    const Vector3& x = wound.surface.vertices[v];
    if (std::abs(x.x() - 0.0087) < 1e-12 && std::abs(x.y() - 0.0021) < 1e-12 && x.z() > 0.0118)
      CHECK(std::count(wound.point.begin(), wound.point.end(), wound.point[v]) == 2);
  }
}

TEST_CASE("Two cuts that cross leave four pieces when through, and four copies along their line", "[wound]") {
  const bool turned = GENERATE(false, true);
  const auto first = flat_sheet({0.013, -0.06, -0.04}, {0, 0.12, 0}, {0, 0, 0.12}, 8, 9);
  const auto second = flat_sheet({-0.09, 0.0072, -0.04}, {0.18, 0, 0}, {0, 0, 0.12}, 12, 7);
  const Cut result = cut(block_surface(), placed({first, second}, turned));
  REQUIRE(result.wound.pieces.size() == 4);
  for (const WoundComponent& component : result.wound.components)
    CHECK(component.euler == 2);
  if (!turned) {
    CHECK(result.volumes[0] == Approx(0.037 * 0.0228 * 0.04).epsilon(1e-12));
    CHECK(result.volumes[3] == Approx(0.063 * 0.0372 * 0.04).epsilon(1e-12));
  }
  std::vector<int> copies(result.wound.surface.vertices.size() * 10, 0);
  int most = 0;
  for (const int point : result.wound.point)
    if (point >= 0)
      most = std::max(most, ++copies.at(point));
  CHECK(most == 4);
}

TEST_CASE("Two partial cuts that cross leave one piece", "[wound]") {
  const bool turned = GENERATE(false, true);
  const auto first = flat_sheet({0.013, -0.013, 0.011}, {0, 0.03, 0}, {0, 0, 0.05}, 8, 9);
  const auto second = flat_sheet({-0.02, 0.0072, 0.0163}, {0.05, 0, 0}, {0, 0, 0.05}, 12, 7);
  const Wound wound = cut(block_surface(), placed({first, second}, turned)).wound;
  REQUIRE(wound.components.size() == 1);
  CHECK(wound.components[0].euler == 2);
}

TEST_CASE("A closed sheet from the top cuts out a core", "[wound]") {
  // Open tube through the block: core and holed block.
  const int sides = 24;
  const double radius = 0.0121;
  const auto tube = [&](double bottom) {
    SurfaceMesh sheet = grid_sheet(sides, 9, [&](double s, double t) {
      const double angle = 2 * std::numbers::pi * s;
      return Vector3(0.0031 + radius * std::cos(angle), 0.0017 + radius * std::sin(angle),
                     bottom + t * (0.05 - bottom));
    });
    for (Triangle& triangle : sheet.triangles) // close the seam
      for (int& v : triangle)
        v = v >= sides * 10 ? v - sides * 10 : v;
    sheet.vertices.resize(sides * 10);
    return sheet;
  };
  const double base = 0.5 * sides * radius * radius * std::sin(2 * std::numbers::pi / sides);
  SECTION("through") {
    const Cut result = cut(block_surface(), {tube(-0.01)});
    REQUIRE(result.wound.pieces.size() == 2);
    CHECK(result.volumes[0] == Approx(base * 0.04).epsilon(1e-12));
    const bool first_is_core = result.wound.components[0].volume < result.wound.components[1].volume;
    CHECK(result.wound.components[first_is_core ? 0 : 1].euler == 2);
    CHECK(result.wound.components[first_is_core ? 1 : 0].euler == 0); // a ring
  }
  SECTION("partial") {
    const Cut result = cut(block_surface(), {tube(0.0113)});
    REQUIRE(result.wound.pieces.size() == 1);
    CHECK(result.wound.components[0].euler == 2); // one side through the core, one around it
  }
}

TEST_CASE("A closed buried sheet cuts out an inner piece", "[wound]") {
  SurfaceMesh sheet = make_block({0.02, 0.015, 0.01}, 0.004);
  sheet = tests::moved(sheet, [](const Vector3& x) -> Vector3 {
    return Eigen::AngleAxisd(0.4, Vector3(1, 2, 3).normalized()) * x + Vector3(0.001, 0.002, 0.013);
  });
  const Cut result = cut(block_surface(), {sheet});
  REQUIRE(result.wound.components.size() == 3);
  REQUIRE(result.wound.pieces.size() == 2);
  CHECK(result.volumes[0] == Approx(0.02 * 0.015 * 0.01).epsilon(1e-9));
  CHECK(result.volumes[1] == Approx(block_volume - 0.02 * 0.015 * 0.01).epsilon(1e-9));
  for (const WoundPiece& piece : result.wound.pieces)
    if (piece.volume > 0.5 * block_volume)
      CHECK(piece.components == 2);
}

TEST_CASE("Cutting in the same place again changes nothing", "[wound]") {
  const bool turned = GENERATE(false, true);
  const auto sheet = placed({flat_sheet({0.003, -0.015, 0.015}, {0, 0.03, 0}, {0, 0, 0.05}, 15, 20)}, turned)[0];
  const Wound once = cut(block_surface(), {sheet}).wound;
  const Wound twice = cut(block_surface(), {sheet, sheet}).wound;
  CHECK(surface_hash(once.surface) == surface_hash(twice.surface));
  SurfaceMesh reversed = sheet;
  for (Triangle& t : reversed.triangles)
    std::swap(t[1], t[2]);
  const Wound back = cut(block_surface(), {sheet, reversed}).wound;
  CHECK(surface_hash(once.surface) == surface_hash(back.surface));
  CHECK(walls(once) == walls(back));
}

TEST_CASE("A coplanar overlap counts once", "[wound]") {
  // Same plane, other steps, half a step further: the union of both rectangles is cut.
  const auto first = flat_sheet({0.003, -0.0151, 0.0153}, {0, 0.02, 0}, {0, 0, 0.05}, 5, 7);
  const auto second = flat_sheet({0.003, -0.0037, 0.0113}, {0, 0.02, 0}, {0, 0, 0.05}, 6, 9);
  const Wound wound = cut(block_surface(), {first, second}).wound;
  const double overlap = (0.0049 - -0.0037) * 0.0247;
  CHECK(wall_area(wound, WoundPart::wall_plus) == Approx(0.02 * 0.0247 + 0.02 * 0.0287 - overlap));
  REQUIRE(wound.components.size() == 1);
  CHECK(wound.components[0].euler == 2);
}

TEST_CASE("Sheets through vertices and along edges of the organ's mesh", "[wound]") {
  // Lattice planes of the block: x = 0 lies in a row of edges, and z = 0.01 ends the sheet on a row of vertices.
  SECTION("partial, front ends at vertices") {
    const auto sheet = flat_sheet({0, -0.02, 0.01}, {0, 0.04, 0}, {0, 0, 0.03}, 4, 3);
    const Wound wound = cut(block_surface(), {sheet}).wound;
    CHECK(wound.components.size() == 1);
    CHECK(wall_area(wound, WoundPart::wall_plus) == Approx(0.04 * 0.03));
  }
  SECTION("through along edges") {
    const auto sheet = flat_sheet({0, -0.03, 0}, {0, 0.06, 0}, {0, 0, 0.04}, 6, 4);
    const Cut result = cut(block_surface(), {sheet});
    REQUIRE(result.wound.pieces.size() == 2);
    CHECK(result.volumes[0] == Approx(0.5 * block_volume).epsilon(1e-12));
  }
  SECTION("through the diagonal") {
    const auto sheet = flat_sheet({-0.03, -0.03, -0.01}, {0.06, 0.06, 0}, {0, 0, 0.06}, 6, 6);
    const Cut result = cut(block_surface(), {sheet});
    REQUIRE(result.wound.pieces.size() == 2);
    CHECK(result.volumes[0] == Approx(0.5 * block_volume).epsilon(1e-12));
  }
  SECTION("front touches the far face from within") {
    const auto sheet = flat_sheet({0.003, -0.02, 0}, {0, 0.04, 0}, {0, 0, 0.05}, 4, 5);
    const Cut result = cut(block_surface(), {sheet});
    // Cut down to the base on a line: a slit through, but the block still holds on both sides.
    CHECK(result.wound.pieces.size() == 1);
    CHECK(result.wound.components[0].euler == 0);
  }
  SECTION("wider than the slit") {
    const auto sheet = flat_sheet({0.003, -0.03, 0}, {0, 0.06, 0}, {0, 0, 0.05}, 4, 5);
    const Cut result = cut(block_surface(), {sheet});
    REQUIRE(result.wound.pieces.size() == 2);
    CHECK(result.volumes[0] == Approx(0.047 * 0.06 * 0.04).epsilon(1e-12));
  }
}

TEST_CASE("Blades that only touch, lie in the surface or miss cut nothing", "[wound]") {
  const SurfaceMesh organ = block_surface();
  const std::vector<SurfaceMesh> idle = {
      flat_sheet({-0.02, -0.01, 0.04}, {0.03, 0, 0}, {0, 0.02, 0}, 5, 3),    // in the top
      flat_sheet({-0.083, -0.05, 0.04}, {0.17, 0, 0}, {0, 0.1, 0}, 3, 2),    // in the plane of the top, beyond it
      flat_sheet({-0.013, -0.01, 0.04}, {0, 0.02, 0}, {0, 0, 0.02}, 5, 3),   // stands on the top
      flat_sheet({0.05, -0.01, 0.04}, {0.01, 0, 0}, {0, 0.013, 0.01}, 2, 2), // touches an edge at one point
      flat_sheet({0.05, 0.03, 0.04}, {0.01, 0, 0}, {0, 0.013, 0.01}, 2, 2),  // touches a corner
      flat_sheet({0.2, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}, 2, 2)};            // far away
  for (const SurfaceMesh& sheet : idle) {
    const Wound wound = cut(organ, {sheet}).wound;
    CHECK(wound.components.size() == 1);
    CHECK(walls(wound) == 0);
  }
}

TEST_CASE("A grazing plane shaves off what lies above it", "[wound]") {
  const double depth = GENERATE(1e-3, 1e-6, 1e-9, 1e-12);
  const auto sheet = flat_sheet({-0.06, -0.04, 0.04 - depth}, {0.12, 0, 0}, {0, 0.08, 0}, 7, 5);
  const Cut result = cut(block_surface(), {sheet});
  REQUIRE(result.wound.pieces.size() == 2);
  CHECK(result.volumes[0] == Approx(0.1 * 0.06 * (0.04 - (0.04 - depth))).epsilon(1e-2).margin(1e-17));
}

TEST_CASE("A sheet that crosses itself parts material on all sides", "[wound]") {
  // A loop in plan: the blade comes back through its own path.
  const auto sheet = grid_sheet(40, 6, [](double s, double t) {
    const double a = 2 * std::numbers::pi * (1.15 * s);
    return Vector3(0.003 + 0.012 * std::cos(a) * (1 - 0.4 * s), 0.001 + 0.012 * std::sin(a) + 0.006 * s,
                   0.0071 + 0.05 * t);
  });
  const Wound wound = cut(block_surface(), {sheet}).wound;
  CHECK(wound.pieces.size() == 1); // the loop holds at the bottom
  CHECK(wound.components[0].euler == 2);
}

TEST_CASE("Growing step by step gives the surface of the cut at once", "[wound]") {
  const SurfaceMesh organ = make_liver(3000);
  const int columns = 30, rows = 12;
  const SurfaceMesh whole = grid_sheet(columns, rows, [](double s, double t) {
    return Vector3(-0.05 + 0.1 * s, 0.01 + 0.008 * std::sin(7 * s), -0.09 + 0.15 * t);
  });
  const SurfaceMesh crossing = flat_sheet({-0.0213, -0.09, 0.0}, {0.003, 0.16, 0}, {0.001, 0, 0.1}, 9, 6);
  IncrementalWound growing(organ);
  for (int c = 1; c <= columns; ++c) {
    SurfaceMesh part = whole;
    part.triangles.resize(2 * rows * c);
    std::vector<SurfaceMesh> sheets = {part};
    if (c >= 20)
      sheets.push_back(crossing);
    growing.grow(sheets);
    const Wound& now = growing.wound();
    REQUIRE_FALSE(manifold_defect(now.surface));
    if (c % 6 != 0)
      continue;
    const Wound at_once = cut_surface(organ, sheets);
    CHECK(surface_hash(now.surface) == surface_hash(at_once.surface));
    CHECK(now.surface.vertices.size() == at_once.surface.vertices.size());
    CHECK(now.components.size() == at_once.components.size());
    CHECK(now.pieces.size() == at_once.pieces.size());
    double worst = 0;
    for (std::size_t p = 0; p < now.pieces.size(); ++p)
      for (const WoundPiece& other : at_once.pieces)
        if (other.euler == now.pieces[p].euler && now.pieces.size() == 1)
          worst = std::max(worst, std::abs(other.volume / now.pieces[p].volume - 1));
    CHECK(worst < 1e-12);
    CHECK(lip_pairs(now).size() == lip_pairs(at_once).size());
  }
}

TEST_CASE("Growth severs a piece at the increment that passes through", "[wound]") {
  const SurfaceMesh whole = flat_sheet({0.0137, -0.041, -0.013}, {0, 0.082, 0}, {0, 0, 0.07}, 41, 6);
  IncrementalWound growing(block_surface());
  for (int c = 1; c <= 41; ++c) {
    SurfaceMesh part = whole;
    part.triangles.resize(2 * 6 * c);
    growing.grow({part});
    const double reached = -0.041 + 0.002 * c; // m, against the far side at 0.03
    REQUIRE(growing.wound().pieces.size() == (reached > 0.03 ? 2 : 1));
  }
}

TEST_CASE("Refused input leaves the wound as it was", "[wound]") {
  const auto sheet = flat_sheet({0.003, -0.015, 0.015}, {0, 0.03, 0}, {0, 0, 0.05}, 5, 5);
  IncrementalWound wound(block_surface());
  wound.grow({sheet});
  const std::uint64_t before = surface_hash(wound.wound().surface);
  SurfaceMesh bad = sheet;
  bad.vertices[3].x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(wound.grow({sheet, bad}), InputError);
  bad = sheet;
  bad.triangles.push_back({0, 1, 99});
  CHECK_THROWS_AS(wound.grow({bad}), InputError);
  CHECK_THROWS_AS(wound.grow({}), InputError);
  CHECK_THROWS_AS(wound.grow({tests::moved(sheet, [](const Vector3& x) -> Vector3 { return 1.1 * x; })}), InputError);
  CHECK(surface_hash(wound.wound().surface) == before);
  SurfaceMesh open = block_surface();
  open.triangles.pop_back();
  CHECK_THROWS_AS(cut_surface(open, {sheet}), InputError);
  SurfaceMesh inward = block_surface();
  for (Triangle& t : inward.triangles)
    std::swap(t[0], t[1]);
  CHECK_THROWS_AS(cut_surface(inward, {sheet}), InputError);
}

TEST_CASE("Triangles without area in a sheet are left out", "[wound]") {
  SurfaceMesh sheet = flat_sheet({0.003, -0.015, 0.015}, {0, 0.03, 0}, {0, 0, 0.05}, 5, 5);
  const std::uint64_t plain = surface_hash(cut(block_surface(), {sheet}).wound.surface);
  sheet.triangles.push_back({0, 0, 1});
  sheet.triangles.push_back({0, 1, 2});
  CHECK(surface_hash(cut(block_surface(), {sheet}).wound.surface) == plain);
}
