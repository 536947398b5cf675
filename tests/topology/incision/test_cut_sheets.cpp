#include "topology/incision/cut_sheets.hpp"

#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/files/surface_io.hpp"
#include "topology/incision/incision.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <set>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

/// Smallest angle of any triangle, degrees, and the edges' range; no bridges; all normals as given.
void require_even(const SurfaceMesh& sheet, const Vector3& normal, double edge, double smallest_angle) {
  const auto neighbours = triangle_neighbours(sheet);
  std::set<int> border;
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e)
      if (neighbours[t][e] < 0) {
        border.insert(sheet.triangles[t][e]);
        border.insert(sheet.triangles[t][(e + 1) % 3]);
      }
  for (std::size_t t = 0; t < sheet.triangles.size(); ++t) {
    CHECK(triangle_normal(sheet, static_cast<int>(t)).dot(normal) == Approx(1));
    for (int e = 0; e < 3; ++e) {
      const int i = sheet.triangles[t][e], j = sheet.triangles[t][(e + 1) % 3], k = sheet.triangles[t][(e + 2) % 3];
      const Vector3 a = sheet.vertices[j] - sheet.vertices[i], b = sheet.vertices[k] - sheet.vertices[i];
      CHECK(std::acos(a.dot(b) / a.norm() / b.norm()) * 180 / M_PI > smallest_angle);
      CHECK(a.norm() < 1.8 * edge);
      CHECK(a.norm() > 0.3 * edge);
      if (neighbours[t][e] >= 0)
        CHECK_FALSE((border.count(i) && border.count(j)));
    }
  }
}

std::shared_ptr<const Domain> box() {
  return make_box_domain(Vector3(-1, -1, -1), Vector3(1, 1, 1), 0.5);
}

} // namespace

TEST_CASE("A disc sheet has the area and border of its polygon, at any tilt", "[cut_sheets]") {
  const Vector3 normal(0.2, -2, 0.7), centre(0.1, 0.2, 0.1);
  for (const double edge : {0.3, 0.1, 0.04}) {
    const SurfaceMesh sheet = make_disc_sheet(centre, normal, 0.5, edge);
    require_even(sheet, normal.normalized(), edge, 35);
    const Incision incision({sheet}, box());
    const auto sides = static_cast<double>(incision.front().size());
    CHECK(area(sheet) == Approx(sides / 2 * 0.25 * std::sin(2 * M_PI / sides)));
    for (const FrontSegment& segment : incision.front())
      CHECK((segment.from - centre).norm() == Approx(0.5));
    CHECK(incision.front_length() == Approx(M_PI).epsilon(0.5 * edge));
  }
}

TEST_CASE("A rectangle sheet lies along its normal and up", "[cut_sheets]") {
  const Vector3 normal(1, 2, 3), up(0, 0.3, 1);
  const SurfaceMesh sheet = make_rectangle_sheet(Vector3(0, 0, 0), normal, up, 0.6, 0.33, 0.08);
  require_even(sheet, normal.normalized(), 0.08, 35);
  CHECK(area(sheet) == Approx(0.6 * 0.33));
  const Vector3 v = (up - up.dot(normal) / normal.squaredNorm() * normal).normalized();
  double height = 0;
  for (const Vector3& x : sheet.vertices)
    height = std::max(height, x.dot(v));
  CHECK(height == Approx(0.165));
  const Incision incision({sheet}, box());
  CHECK(incision.front_length() == Approx(2 * (0.6 + 0.33)));
}

TEST_CASE("A polygon sheet fills a hollow outline with even triangles", "[cut_sheets]") {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Vector3(1, 1, 0.3).normalized()));
  std::vector<Vector3> corners;
  for (const auto& [x, y] : {std::pair(0.0, 0.0), {0.8, 0.0}, {0.8, 0.6}, {0.5, 0.6}, {0.5, 0.25}, {0.0, 0.25}})
    corners.push_back(turn * Vector3(x - 0.4, y - 0.3, 0.05));
  const SurfaceMesh sheet = make_polygon_sheet(corners, 0.06);
  require_even(sheet, turn * Vector3::UnitZ(), 0.06, 15);
  CHECK(area(sheet) == Approx(0.8 * 0.25 + 0.3 * 0.35));
  const Incision incision({sheet}, box());
  CHECK(incision.front_length() == Approx(2 * (0.8 + 0.6)));
  const SurfaceMesh triangle = make_polygon_sheet({corners[0], corners[1], corners[2]}, 0.3);
  CHECK(area(triangle) == Approx(0.24));
}

TEST_CASE("A sheet in a file may be open and have quads", "[cut_sheets]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "sheet.obj";
  std::ofstream(file) << "v 0 0 0\nv 100 0 0\nv 200 0 10\nv 0 100 0\nv 100 100 0\nv 200 100 10\nv 7 7 7\n"
                         "f 1 2 5 4\nf 2 3 6 5\n";
  const SurfaceMesh sheet = read_sheet(file, 0.001);
  CHECK(area(sheet) == Approx(0.01 + 0.1 * std::hypot(0.1, 0.01)));
  CHECK(Incision({sheet}, box()).front_length() == Approx(2 * (0.1 + std::hypot(0.1, 0.01)) + 0.2));
  const SurfaceMesh disc = make_disc_sheet(Vector3(0, 0, 0), Vector3(0, 0, 1), 0.2, 0.05);
  write_surface(folder.path() / "disc.ply", disc);
  CHECK(read_sheet(folder.path() / "disc.ply").triangles.size() == disc.triangles.size());
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n";
  CHECK_THROWS_WITH(read_sheet(file), Catch::Contains("degenerate"));
  CHECK_THROWS_AS(read_sheet(folder.path() / "absent.obj"), InputError);
}

TEST_CASE("A sheet in a file is mended as an organ is, and that is said", "[cut_sheets]") {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "sheet.obj";
  std::vector<std::string> said;
  const auto says = [&](const std::string& part) {
    return std::any_of(said.begin(), said.end(), [&](const std::string& one) { return one.find(part) != one.npos; });
  };
  // A square of four triangles with corners of its own each, one of them turned over and one there twice.
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv .5 .5 0\nv 1 0 0\nv 1 1 0\nv .5 .5 0\nv 1 1 0\nv 0 1 0\nv .5 .5 0\n"
                         "v 0 1 0\nv 0 0 0\nv .5 .5 0\nf 1 2 3\nf 5 4 6\nf 7 8 9\nf 10 11 12\nf 1 2 3\n";
  const SurfaceMesh square = read_sheet(file, 1, &said);
  CHECK(square.vertices.size() == 5);
  CHECK(area(square) == Approx(1));
  for (int t = 0; t < std::ssize(square.triangles); ++t)
    CHECK(triangle_normal(square, t).z() == Approx(1));
  CHECK(says("joined 7 vertices"));
  CHECK(says("removed 1 faces that repeat"));
  CHECK(says("turned 1 of 4 triangles"));
  CHECK(Incision({square}, box()).front_length() == Approx(4 * 0.5).margin(2.1));
  // Three squares that meet along an edge: two go on in one another, the third ends there.
  said.clear();
  std::ofstream(file) << "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv -1 0 0\nv -1 1 0\nv 0 0 1\nv 0 1 1\n"
                         "f 1 3 4 2\nf 5 1 2 6\nf 1 2 8 7\n";
  const SurfaceMesh branched = read_sheet(file, 1, &said);
  CHECK(area(branched) == Approx(3));
  CHECK(says("parted the surface at 1 edges with more than two faces and at 2 vertices"));
  const auto neighbours = triangle_neighbours(branched);
  int borders = 0;
  for (const auto& of : neighbours)
    borders += static_cast<int>(std::count(of.begin(), of.end(), -1));
  CHECK(borders >= 6 + 4);
}

TEST_CASE("No edge inside a sheet joins two border vertices after splitting", "[cut_sheets]") {
  // A strip one quad wide, and a triangle whose three sides are inside.
  SurfaceMesh strip;
  for (int i = 0; i <= 4; ++i) {
    strip.vertices.emplace_back(0.1 * i, 0, 0);
    strip.vertices.emplace_back(0.1 * i, 0.1, 0);
  }
  for (int i = 0; i < 4; ++i) {
    strip.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 3});
    strip.triangles.push_back({2 * i, 2 * i + 3, 2 * i + 1});
  }
  const double before = area(strip);
  CHECK(split_bridges(strip) == 7);
  CHECK(area(strip) == Approx(before));
  CHECK(split_bridges(strip) == 0);
  CHECK_NOTHROW(Incision({strip}, box()));
  SurfaceMesh star;
  star.vertices = {{0, 0, 0}, {0.4, 0, 0}, {0.2, 0.3, 0}, {0.2, -0.3, 0}, {0.5, 0.3, 0}, {-0.1, 0.3, 0}};
  star.triangles = {{0, 1, 2}, {1, 0, 3}, {2, 1, 4}, {0, 2, 5}};
  CHECK(split_bridges(star) == 3);
  CHECK(split_bridges(star) == 0);
  CHECK_NOTHROW(Incision({star}, box()));
}

TEST_CASE("Sheets that cannot be are refused with the argument at fault", "[cut_sheets]") {
  const Vector3 o(0, 0, 0), z(0, 0, 1);
  CHECK_THROWS_WITH(make_disc_sheet(o, o, 1, 0.1), Catch::Contains("normal"));
  CHECK_THROWS_WITH(make_disc_sheet(o, z, -1, 0.1), Catch::Contains("radius = -1"));
  CHECK_THROWS_WITH(make_disc_sheet(o, z, 1, 2), Catch::Contains("edge = 2"));
  CHECK_THROWS_WITH(make_disc_sheet(o, z, 1, 1e-5), Catch::Contains("triangles"));
  CHECK_THROWS_WITH(make_disc_sheet(Vector3(0, NAN, 0), z, 1, 0.1), Catch::Contains("centre"));
  CHECK_THROWS_WITH(make_rectangle_sheet(o, z, z, 1, 1, 0.1), Catch::Contains("parallel"));
  CHECK_THROWS_WITH(make_rectangle_sheet(o, z, Vector3(1, 0, 0), 1, 0, 0.1), Catch::Contains("height = 0"));
  const std::vector<Vector3> square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  CHECK_THROWS_WITH(make_polygon_sheet({square[0], square[1]}, 0.1), Catch::Contains("at least 3"));
  CHECK_THROWS_WITH(make_polygon_sheet({square[0], square[1], Vector3(1, 1, 0.01), square[3]}, 0.1),
                    Catch::Contains("off the plane"));
  CHECK_THROWS_WITH(make_polygon_sheet({square[0], square[2], square[1], Vector3(0, 1.2, 0)}, 0.1),
                    Catch::Contains("cross"));
  CHECK_THROWS_WITH(make_polygon_sheet({square[0], square[1], square[1], square[2]}, 0.1), Catch::Contains("coincide"));
  CHECK_THROWS_WITH(make_polygon_sheet({square[0], square[1], Vector3(2, 0, 0)}, 0.1), Catch::Contains("no area"));
}
