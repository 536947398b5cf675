// What segmentations leave: islands, cavities, voxels that touch along an edge or in a corner.
#include "tests/support/mesh_checks.hpp"
#include "topology/domain/domain.hpp"
#include "topology/domain/level_set.hpp"
#include "topology/organ/organs.hpp"
#include "topology/organ/surface_check.hpp"
#include "topology/surface/distance.hpp"
#include "topology/surface/pieces.hpp"
#include "topology/surface/self_intersections.hpp"
#include "topology/wound/wound.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

SurfaceMesh cube(const Vector3& lower, double side, double edge = 1) {
  return make_block(lower, lower + Vector3::Constant(side), edge);
}

SurfaceMesh joined(SurfaceMesh a, const SurfaceMesh& b) {
  const int offset = static_cast<int>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles)
    a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

SurfaceMesh turned_inside_out(SurfaceMesh mesh) {
  for (Triangle& t : mesh.triangles)
    std::swap(t[1], t[2]);
  return mesh;
}

CheckedSurface checked_with(const SurfaceMesh& mesh, const SurfaceChoices& choices = {}) {
  PolygonSoup soup;
  soup.vertices = mesh.vertices;
  for (const Triangle& t : mesh.triangles)
    soup.polygons.push_back({t[0], t[1], t[2]});
  return check_surface(soup, "test.obj", choices);
}

bool tells(const std::vector<std::string>& sentences, const std::string& part) {
  return std::any_of(sentences.begin(), sentences.end(),
                     [&](const std::string& sentence) { return sentence.find(part) != std::string::npos; });
}

constexpr double whole_cube = 0.02 * 0.02 * 0.02; // m3

SurfaceMesh cube_with_cavity() {
  return joined(cube(Vector3::Zero(), 0.02, 0.004), turned_inside_out(cube(Vector3::Constant(0.006), 0.008, 0.004)));
}

} // namespace

TEST_CASE("Separate pieces are refused with a way out, or one or all are kept", "[surface_pieces]") {
  const SurfaceMesh two = joined(cube(Vector3(0.03, 0, 0), 0.002), cube(Vector3::Zero(), 0.02, 0.01));
  CHECK_THROWS_WITH(checked_with(two), Catch::Contains("2 separate pieces") && Catch::Contains("12 triangles") &&
                                           Catch::Contains("organ.pieces = \"largest\"") && Catch::Contains("\"all\""));
  const CheckedSurface largest = checked_with(two, {.pieces = PieceChoice::largest});
  tests::require_closed_sphere(largest.mesh);
  CHECK(volume(largest.mesh) == Approx(whole_cube));
  CHECK(tells(largest.mended, "left out 1 of 2 separate pieces, 0.0999 % of the volume"));
  const CheckedSurface all = checked_with(two, {.pieces = PieceChoice::all});
  CHECK(volume(all.mesh) == Approx(whole_cube + 8e-9));
  CHECK(all.mended.empty());
  CHECK(tells(all.warnings, "in 2 separate pieces"));
  CHECK(cut_surface(all.mesh, {}).pieces.size() == 2);
}

TEST_CASE("A flat scrap beside an organ is left out and said", "[surface_pieces]") {
  SurfaceMesh scrap;
  scrap.vertices = {{0.03, 0, 0}, {0.03, 0.01, 0}, {0.03, 0, 0.01}};
  scrap.triangles = {{0, 1, 2}};
  const CheckedSurface result = checked_with(joined(cube(Vector3::Zero(), 0.02, 0.01), scrap));
  tests::require_closed_sphere(result.mesh);
  CHECK(tells(result.mended, "left out 1 parts of the surface that enclose no volume"));
}

TEST_CASE("Closed cavities stay, are filled or refused, however they are oriented", "[surface_pieces]") {
  const double hole = 0.008 * 0.008 * 0.008;
  const SurfaceMesh outside = cube(Vector3::Zero(), 0.02, 0.004), inside = cube(Vector3::Constant(0.006), 0.008, 0.004);
  for (const bool as_told : {true, false}) {
    const SurfaceMesh hollow = joined(outside, as_told ? turned_inside_out(inside) : inside);
    const CheckedSurface kept = checked_with(hollow);
    CHECK(volume(kept.mesh) == Approx(whole_cube - hole));
    CHECK(tells(kept.warnings, "1 closed cavity: 0.512 ml"));
    CHECK(tells(kept.mended, "towards the cavities") != as_told);
    const CheckedSurface filled = checked_with(hollow, {.cavities = CavityChoice::fill});
    tests::require_closed_sphere(filled.mesh);
    CHECK(volume(filled.mesh) == Approx(whole_cube));
    CHECK(tells(filled.mended, "filled 1 closed cavity"));
    CHECK_THROWS_WITH(checked_with(hollow, {.cavities = CavityChoice::refuse}),
                      Catch::Contains("1 closed cavity") && Catch::Contains("organ.cavities = \"keep\""));
  }
}

TEST_CASE("What floats in a cavity is a piece of its own", "[surface_pieces]") {
  const SurfaceMesh nested = joined(cube_with_cavity(), cube(Vector3::Constant(0.009), 0.002, 0.002));
  CHECK_THROWS_WITH(checked_with(nested), Catch::Contains("2 separate pieces"));
  const CheckedSurface all = checked_with(nested, {.pieces = PieceChoice::all});
  CHECK(volume(all.mesh) == Approx(whole_cube - 5.12e-7 + 8e-9));
  const auto filled = checked_with(nested, {PieceChoice::all, CavityChoice::fill});
  CHECK(volume(filled.mesh) == Approx(whole_cube));
}

TEST_CASE("The solid of a body with cavities has their walls for its surface", "[surface_pieces]") {
  const auto domain = make_organ_domain(checked_with(cube_with_cavity()).mesh);
  const SurfaceDistance exact(domain->surface());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> coordinate(-0.002, 0.022);
  for (int k = 0; k < 4000; ++k) {
    const Vector3 x(coordinate(random), coordinate(random), coordinate(random));
    const auto within = [&](double lower, double upper) {
      return (x.array() > lower).all() && (x.array() < upper).all();
    };
    const bool is_inside = within(0, 0.02) && !within(0.006, 0.014);
    CHECK((domain->signed_distance(x) < 0) == is_inside);
    CHECK((exact.nearest(x).distance < 0) == is_inside);
  }
  // A shell within a shell: the level set alone has to know.
  const SurfaceMesh nested = joined(cube_with_cavity(), cube(Vector3::Constant(0.008), 0.004, 0.004));
  const LevelSet level_set(checked_with(nested, {.pieces = PieceChoice::all}).mesh, 2.5e-4);
  CHECK(level_set.inside(Vector3(0.003, 0.01, 0.01)));
  CHECK_FALSE(level_set.inside(Vector3(0.007, 0.01, 0.01)));
  CHECK(level_set.inside(Vector3(0.01, 0.01, 0.01)));
}

TEST_CASE("Voxels that touch along an edge or in a corner are parted, and it is said", "[surface_pieces]") {
  const double side = 0.1;
  const SurfaceMesh block = cube(Vector3::Zero(), side, side);
  const auto parted = [&](const Vector3& at) {
    return checked_with(joined(block, cube(at, side, side)), {.pieces = PieceChoice::all});
  };
  const CheckedSurface hinged = parted(Vector3(side, side, 0));
  CHECK(tells(hinged.mended, "at 1 edges with more than two faces and at 2 vertices"));
  const CheckedSurface touching = parted(Vector3(side, side, side));
  CHECK(tells(touching.mended, "at 0 edges with more than two faces and at 1 vertices"));
  for (const CheckedSurface& result : {hinged, touching}) {
    CHECK(find_components(result.mesh).components.size() == 2);
    CHECK(volume(result.mesh) == Approx(2e-3).epsilon(2e-3));
    CHECK_FALSE(manifold_defect(result.mesh));
    CHECK(self_intersections(result.mesh).empty());
    // What is written and read again is sound as it is.
    CHECK(checked_with(result.mesh, {.pieces = PieceChoice::all}).mended.empty());
  }
}

TEST_CASE("An edge with four faces in the middle of a body is parted at its own vertices or in between",
          "[surface_pieces]") {
  // A slab of 4 x 4 x 3 voxels without two that share an edge: its ends lie in the wall, or within the body.
  const auto slab_without = [](const std::vector<std::array<int, 3>>& gone) {
    const auto is_full = [&](int i, int j, int k) {
      const std::array<int, 3> here{i, j, k};
      return i >= 0 && j >= 0 && k >= 0 && i < 4 && j < 4 && k < 3 &&
             std::find(gone.begin(), gone.end(), here) == gone.end();
    };
    SurfaceMesh mesh;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 3; ++k)
          for (int d = 0; d < 3 && is_full(i, j, k); ++d)
            for (const int side : {0, 1}) {
              std::array<int, 3> beside{i, j, k};
              beside[d] += side == 0 ? -1 : 1;
              if (is_full(beside[0], beside[1], beside[2]))
                continue;
              const int first = static_cast<int>(mesh.vertices.size());
              for (const auto& [a, b] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1), std::pair(0, 1)}) {
                Vector3 corner(i, j, k);
                corner[d] += side;
                corner[(d + 1) % 3] += a;
                corner[(d + 2) % 3] += b;
                mesh.vertices.emplace_back(0.01 * corner);
              }
              mesh.triangles.push_back(side == 1 ? Triangle{first, first + 1, first + 2}
                                                 : Triangle{first, first + 2, first + 1});
              mesh.triangles.push_back(side == 1 ? Triangle{first, first + 2, first + 3}
                                                 : Triangle{first, first + 3, first + 2});
            }
    return mesh;
  };
  for (const std::vector<std::array<int, 3>>& gone : {std::vector<std::array<int, 3>>{{1, 1, 2}, {2, 2, 2}},
                                                      {{1, 1, 1}, {2, 2, 1}},
                                                      {{1, 1, 0}, {2, 2, 0}},
                                                      {{1, 1, 1}, {2, 2, 1}, {1, 1, 2}, {2, 2, 2}},
                                                      {{1, 1, 1}, {2, 2, 2}}}) {
    const CheckedSurface result = checked_with(slab_without(gone));
    CHECK(tells(result.mended, "parted the surface"));
    CHECK_FALSE(manifold_defect(result.mesh));
    CHECK(self_intersections(result.mesh).empty());
    CHECK(volume(result.mesh) == Approx(1e-6 * (48.0 - static_cast<double>(gone.size()))).epsilon(1e-3));
    CHECK(cut_surface(result.mesh, {}).pieces.size() == 1);
  }
}
