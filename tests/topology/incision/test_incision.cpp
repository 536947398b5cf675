#include "topology/incision/incision.hpp"
#include "topology/incision/sight_work.hpp"

#include "tests/support/allocation_counter.hpp"
#include "tests/support/sheets.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/lip_lift.hpp"
#include "topology/search/proximity.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <span>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

using Random = std::mt19937_64;

double uniform(Random& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

Vector3 in_box(Random& random, const Vector3& lower, const Vector3& upper) {
  return Vector3::NullaryExpr([&](Eigen::Index d) { return uniform(random, lower[d], upper[d]); });
}

SurfaceMesh rectangle(const Vector3& corner, const Vector3& u, const Vector3& v, int n, int m) {
  return tests::grid_sheet(n, m, [&](double s, double t) { return Vector3(corner + s * u + t * v); });
}

/// Disc of the given radius as `rings` rings of 6 i triangles, polygon of 6 rings sides.
SurfaceMesh disc(const Vector3& centre, const Vector3& normal, double radius, int rings) {
  const Vector3 u = normal.unitOrthogonal(), v = normal.normalized().cross(u);
  SurfaceMesh mesh;
  mesh.vertices.push_back(centre);
  for (int r = 1; r <= rings; ++r)
    for (int i = 0; i < 6 * r; ++i) {
      const double angle = 2 * M_PI * i / (6 * r);
      mesh.vertices.push_back(centre + radius * r / rings * (std::cos(angle) * u + std::sin(angle) * v));
    }
  const auto vertex = [](int r, int i) { return r == 0 ? 0 : 1 + 3 * r * (r - 1) + i % (6 * r); };
  for (int r = 1; r <= rings; ++r)
    for (int side = 0; side < 6; ++side)
      for (int k = 0; k < r; ++k) {
        mesh.triangles.push_back(
            {vertex(r, side * r + k), vertex(r, side * r + k + 1), vertex(r - 1, side * (r - 1) + k)});
        if (k + 1 < r)
          mesh.triangles.push_back(
              {vertex(r - 1, side * (r - 1) + k), vertex(r, side * r + k + 1), vertex(r - 1, side * (r - 1) + k + 1)});
      }
  return mesh;
}

std::shared_ptr<const Domain> unit_box() {
  return make_box_domain(Vector3(0, 0, 0), Vector3(1, 1, 1), 0.25);
}

SurfaceMesh wavy(Random& random, int along = 12, int across = 9) {
  const double p = uniform(random, 0, 6), q = uniform(random, 0, 6);
  const Eigen::Quaterniond turn = Eigen::Quaterniond::UnitRandom();
  return tests::grid_sheet(along, across, [&](double s, double t) {
    return Vector3(turn * Vector3(0.8 * s - 0.4, 0.6 * t - 0.3, 0.08 * std::sin(5 * s + p) * std::cos(4 * t + q)) +
                   Vector3(0.5, 0.5, 0.5));
  });
}

/// Signed volumes in long double: whether the open segment passes through the triangle, zero when too close to tell.
int crosses(const Vector3& a, const Vector3& b, const std::array<Vector3, 3>& p) {
  using Long = Eigen::Matrix<long double, 3, 1>;
  const auto volume = [](const Vector3& x, const Vector3& y, const Vector3& z, const Vector3& w) {
    const Long o = x.cast<long double>();
    return (y.cast<long double>() - o).dot((z.cast<long double>() - o).cross(w.cast<long double>() - o));
  };
  const long double at_a = volume(a, p[0], p[1], p[2]), at_b = volume(b, p[0], p[1], p[2]);
  const long double u = volume(a, b, p[0], p[1]), v = volume(a, b, p[1], p[2]), w = volume(a, b, p[2], p[0]);
  constexpr long double noise = 1e-12L;
  if (std::min({std::abs(at_a), std::abs(at_b), std::abs(u), std::abs(v), std::abs(w)}) < noise)
    return 0;
  const bool through = (u > 0) == (v > 0) && (v > 0) == (w > 0);
  return (at_a > 0) != (at_b > 0) && through ? 1 : -1;
}

template <class Visit>
void for_triangles(const std::vector<SurfaceMesh>& sheets, const Visit& visit) {
  for (const SurfaceMesh& sheet : sheets)
    for (const Triangle& t : sheet.triangles)
      visit(std::array<Vector3, 3>{sheet.vertices[t[0]], sheet.vertices[t[1]], sheet.vertices[t[2]]});
}

} // namespace

TEST_CASE("Sight lines are blocked where a search through all triangles says so", "[incision]") {
  Random random(1);
  const auto box = unit_box();
  int blocked = 0, open = 0;
  for (int trial = 0; trial < 8; ++trial) {
    // Narrow strips, too, as small steps of a blade leave.
    const Incision incision({wavy(random), trial % 2 == 0 ? wavy(random) : wavy(random, 150, 2)}, box);
    int wall = -1; // the last one that blocked
    for (int i = 0; i < 2000; ++i) {
      const Vector3 a = in_box(random, Vector3(0, 0, 0), Vector3(1, 1, 1));
      const double length = i % 3 == 0 ? 1 : 0.15;
      const Vector3 b = a + length * in_box(random, Vector3(-1, -1, -1), Vector3(1, 1, 1));
      int expected = -1;
      for_triangles(incision.sheets(), [&](const std::array<Vector3, 3>& p) {
        const int here = crosses(a, b, p);
        expected = expected == 1 || here == 1 ? 1 : std::max(expected, here);
      });
      if (expected == 0)
        continue;
      (expected == 1 ? blocked : open) += 1;
      REQUIRE(incision.blocks(a, b) == (expected == 1));
      REQUIRE(incision.blocks(b, a) == (expected == 1));
      REQUIRE(incision.blocks(a, b, wall) == (expected == 1));
      if (expected == 1)
        REQUIRE(incision.blocks(a, b, std::span(&wall, 1)));
    }
  }
  CHECK(blocked > 1000);
  CHECK(open > 1000);
}

TEST_CASE("From a box of points the walls before a point block as the whole sheets do", "[incision]") {
  Random random(31);
  const auto box = unit_box();
  int blocked = 0, free = 0, clear = 0, many = 0;
  for (int scene = 0; scene < 10; ++scene) {
    const Incision incision({wavy(random), scene % 2 == 0 ? wavy(random) : wavy(random, 150, 2)}, box);
    constexpr std::size_t most = 8;
    std::vector<int> walls, few;
    for (int trial = 0; trial < 300; ++trial) {
      const Vector3 centre = in_box(random, Vector3::Constant(-0.5), Vector3::Constant(1.5));
      const Vector3 half = in_box(random, Vector3::Zero(), Vector3::Constant(trial % 2 == 0 ? 0.2 : 0.02));
      Vector3 y = centre + in_box(random, Vector3::Constant(-0.6), Vector3::Constant(0.6));
      if (const auto face = incision.closest(y, 1); face && trial % 3 == 0) // as a node of a lip, on either face
        y = face->point + (trial % 2 == 0 ? 1e-5 : -1e-5) * face->normal;
      REQUIRE(incision.walls_between(centre, half, y, 1000, walls));
      clear += walls.empty() ? 1 : 0;
      REQUIRE(incision.walls_between(centre, half, y, most, few) == (walls.size() <= most));
      REQUIRE(few.size() == std::min(most, walls.size()));
      REQUIRE(incision.walls_between(centre, half, y, 0, few) == walls.empty());
      many += walls.size() > most ? 1 : 0;
      for (int k = 0; k < 24; ++k) {
        Vector3 x = in_box(random, centre - half, centre + half);
        if (k < 8) // a corner
          x = centre + half.cwiseProduct(Vector3((k & 1) != 0 ? 1 : -1, (k & 2) != 0 ? 1 : -1, (k & 4) != 0 ? 1 : -1));
        const bool expected = incision.blocks(x, y);
        REQUIRE(incision.blocks(x, y, walls) == expected);
        (expected ? blocked : free) += 1;
      }
    }
  }
  CHECK(blocked > 3000);
  CHECK(free > 3000);
  CHECK(clear > 300);
  CHECK(many > 100);
}

TEST_CASE("No sight line slips between triangles through an edge or a vertex they share", "[incision]") {
  Random random(2);
  const SurfaceMesh sheet = wavy(random);
  const Incision incision({sheet}, unit_box());
  const auto neighbours = triangle_neighbours(sheet);
  int through = 0;
  for (int i = 0; i < 20000; ++i) {
    const int t = static_cast<int>(random() % sheet.triangles.size()), e = static_cast<int>(random() % 3);
    if (neighbours[t][e] < 0)
      continue;
    const Vector3 a = sheet.vertices[sheet.triangles[t][e]], b = sheet.vertices[sheet.triangles[t][(e + 1) % 3]];
    const double s = i % 4 == 0 ? 0 : uniform(random, 0, 1);
    const Vector3 x = a + s * (b - a);
    // From nearly along the sheet to across it.
    const Vector3 n = triangle_normal(sheet, t), m = triangle_normal(sheet, neighbours[t][e]);
    const Vector3 along = (n + m).normalized().unitOrthogonal();
    const double angle = uniform(random, 0, 2 * M_PI), tilt = std::pow(10, uniform(random, -2, 1));
    const Vector3 direction =
        (Eigen::AngleAxisd(angle, (n + m).normalized()) * along + tilt * (n + m).normalized()).normalized();
    const double back = 0.01 * uniform(random, 0.01, 1), forth = 0.01 * uniform(random, 0.01, 1);
    if (n.dot(direction) * m.dot(direction) <= 0)
      continue; // grazes the ridge of the two triangles
    ++through;
    REQUIRE(incision.blocks(x - back * direction, x + forth * direction));
  }
  CHECK(through > 10000);
}

TEST_CASE("Touching a sheet blocks, stopping short of it by a lip's offset does not", "[incision]") {
  const Vector3 u(0.6, 0.1, -0.05), v(-0.1, 0.55, 0.2), corner(0.2, 0.2, 0.45);
  const Incision incision({rectangle(corner, u, v, 5, 7)}, unit_box());
  const Vector3 normal = u.cross(v).normalized();
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Vector3 on = corner + uniform(random, 0, 1) * u + uniform(random, 0, 1) * v;
    const Vector3 far = on + 0.1 * normal + 0.05 * in_box(random, Vector3(-1, -1, -1), Vector3(1, 1, 1));
    REQUIRE(incision.blocks(far, on));
    REQUIRE(incision.blocks(on, far));
    REQUIRE_FALSE(incision.blocks(far, on + 1e-7 * normal));
    REQUIRE(incision.blocks(far, on - 1e-7 * normal));
    REQUIRE(incision.blocks(on, on));
    // Along the sheet: in its plane, and just off it on one side.
    const Vector3 other = corner + uniform(random, 0, 1) * u + uniform(random, 0, 1) * v;
    REQUIRE(incision.blocks(on, other));
    REQUIRE_FALSE(incision.blocks(on + 1e-7 * normal, other + 1e-7 * normal));
    REQUIRE(incision.blocks(on + 1e-7 * normal, other - 1e-7 * normal));
  }
  // In the plane, past the border.
  CHECK(incision.blocks(corner - 0.1 * u + 0.5 * v, corner + 1.1 * u + 0.5 * v));
  CHECK_FALSE(incision.blocks(corner - 0.1 * u, corner - 0.1 * u + v));
}

TEST_CASE("The nearest point of the sheets is that of a search through all triangles", "[incision]") {
  Random random(4);
  const Incision incision({wavy(random), wavy(random)}, unit_box());
  for (int i = 0; i < 2000; ++i) {
    const Vector3 x = in_box(random, Vector3(-0.5, -0.5, -0.5), Vector3(1.5, 1.5, 1.5));
    double distance = 1e9;
    for_triangles(incision.sheets(), [&](const std::array<Vector3, 3>& p) {
      distance = std::min(distance, (closest_on_triangle(x, p[0], p[1], p[2]).point - x).norm());
    });
    const double reach = uniform(random, 0, 1);
    const auto nearest = incision.closest(x, reach);
    REQUIRE(nearest.has_value() == (distance <= reach));
    if (!nearest)
      continue;
    CHECK(nearest->distance == Approx(distance).margin(1e-12));
    CHECK((nearest->point - x).norm() == Approx(distance).margin(1e-12));
    const SurfaceMesh& sheet = incision.sheets()[nearest->sheet];
    CHECK(nearest->normal.isApprox(triangle_normal(sheet, nearest->triangle), 1e-12));
    CHECK(incision.near(x, distance));
    CHECK(incision.blocks(x, x + 1.000001 * (nearest->point - x)));
    // A point of the face proper is head-on; a border point is reached from beyond the border.
    if (!nearest->on_border && distance > 1e-3)
      CHECK(std::abs((x - nearest->point).normalized().dot(nearest->normal)) > 0.9);
  }
  for (int i = 0; i < 2000; ++i) {
    const Vector3 x = in_box(random, Vector3(-1, -1, -1), Vector3(2, 2, 2));
    const double radius = uniform(random, 0, 0.5);
    if (!incision.near(x, radius))
      CHECK_FALSE(incision.closest(x, radius));
  }
  CHECK_FALSE(incision.near(Vector3(5, 5, 5), 1));
}

TEST_CASE("A disc in a box: length and area of the polygon, frames that point outwards", "[incision]") {
  const Vector3 centre(0.48, 0.51, 0.53), normal = Vector3(0.3, -0.4, 0.8).normalized();
  const double radius = 0.3;
  const int sides = 60;
  const Incision incision({disc(centre, normal, radius, sides / 6)}, unit_box(), 7);
  CHECK(incision.revision() == 7);
  CHECK(incision.front().size() == sides);
  CHECK(incision.front_length() == Approx(2 * sides * radius * std::sin(M_PI / sides)).epsilon(1e-12));
  CHECK(incision.area() == Approx(0.5 * sides * radius * radius * std::sin(2 * M_PI / sides)).epsilon(1e-9));
  for (std::size_t i = 0; i < incision.front().size(); ++i) { // one closed chain, the sheet on its left
    const FrontSegment& segment = incision.front()[i];
    CHECK(segment.to.isApprox(incision.front()[(i + 1) % sides].from, 1e-12));
    CHECK(normal.cross(segment.to - segment.from).dot(centre - segment.from) > 0);
  }
  Random random(5);
  for (int i = 0; i < 1000; ++i) {
    const double angle = uniform(random, 0, 2 * M_PI), r = uniform(random, 0.001, 0.1),
                 theta = uniform(random, -3.1, 3.1);
    const Vector3 u = normal.unitOrthogonal();
    const Vector3 out = Eigen::AngleAxisd(angle, normal) * u;
    const Vector3 x = centre + radius * out + r * (std::cos(theta) * out + std::sin(theta) * normal);
    const auto frame = incision.front_frame(x, 1);
    REQUIRE(frame);
    const double sagitta = radius * (1 - std::cos(M_PI / sides));
    CHECK(frame->distance == Approx(r).margin(1.5 * sagitta));
    CHECK(frame->distance == Approx((x - frame->point).norm()));
    CHECK(frame->ahead.dot(out) > 1 - 1e-3);
    CHECK(frame->normal.isApprox(normal, 1e-12));
    CHECK(frame->tangent.isApprox(frame->normal.cross(frame->ahead), 1e-12));
    const FrontSegment& segment = incision.front()[frame->segment];
    CHECK(frame->tangent.dot((segment.to - segment.from).normalized()) > 0.99);
    // From the vertex of the polygon to the middle of a side the point lies by the sagitta within the circle.
    const Vector3 away = x - frame->point;
    CHECK(std::abs(std::atan2(away.dot(frame->normal), away.dot(frame->ahead)) - theta) < 1.5 * sagitta / r + 1e-3);
  }
  // On the two faces, a lip's offset from the sheet.
  for (const double side : {-1.0, 1.0}) {
    const Vector3 x = centre + 0.27 * normal.unitOrthogonal() + side * 1e-6 * normal;
    const auto frame = incision.front_frame(x, 1);
    const Vector3 away = x - frame->point;
    CHECK(std::atan2(away.dot(frame->normal), away.dot(frame->ahead)) == Approx(side * M_PI).margin(1e-4));
  }
  CHECK_FALSE(incision.front_frame(centre, 0.25));
}

TEST_CASE("Frames do not jump along a polygonal front", "[incision]") {
  const Vector3 centre(0.5, 0.5, 0.5);
  const Incision incision({disc(centre, Vector3::UnitZ(), 0.3, 4)}, unit_box());
  Vector3 last = incision.front_frame(centre + Vector3(0.32, 0, 0.01), 1)->ahead;
  for (int i = 1; i <= 20000; ++i) {
    const double angle = 2 * M_PI * i / 20000;
    const Vector3 x = centre + 0.32 * Vector3(std::cos(angle), std::sin(angle), 0) + Vector3(0, 0, 0.01);
    const Vector3 ahead = incision.front_frame(x, 1)->ahead;
    REQUIRE((ahead - last).norm() < 20 * 2 * M_PI / 20000);
    last = ahead;
  }
}

TEST_CASE("Around a corner of a sheet the way ahead turns from one side to the other", "[incision]") {
  const Incision incision({rectangle(Vector3(0.3, 0.3, 0.5), Vector3(0.4, 0, 0), Vector3(0, 0.4, 0), 2, 2)},
                          unit_box());
  for (double angle = 0.05; angle < M_PI / 2; angle += 0.1) {
    const Vector3 direction(std::cos(angle), std::sin(angle), 0);
    const auto frame = incision.front_frame(Vector3(0.7, 0.7, 0.5) + 0.1 * direction + Vector3(0, 0, 0.03), 1);
    CHECK(frame->point.isApprox(Vector3(0.7, 0.7, 0.5)));
    CHECK(frame->ahead.isApprox(direction, 1e-9));
  }
  CHECK(incision.front_frame(Vector3(0.8, 0.69, 0.5), 1)->ahead.isApprox(Vector3::UnitX(), 1e-12));
  CHECK(incision.front_frame(Vector3(0.69, 0.8, 0.5), 1)->ahead.isApprox(Vector3::UnitY(), 1e-12));
}

TEST_CASE("The front of an edge cut ends at the surface of the body", "[incision]") {
  // Enters through x = 0 and reaches past both sides y = 0 and y = 1.
  const SurfaceMesh sheet = rectangle(Vector3(-0.2, -0.3, 0.52), Vector3(0.65, 0, 0.05), Vector3(0, 1.6, 0), 3, 1);
  const Incision incision({sheet}, unit_box());
  REQUIRE(incision.front().size() == 1);
  const FrontSegment& front = incision.front()[0];
  CHECK(front.from.isApprox(Vector3(0.45, 0, 0.57), 1e-7));
  CHECK(front.to.isApprox(Vector3(0.45, 1, 0.57), 1e-7));
  CHECK(incision.front_length() == Approx(1).epsilon(1e-7));
  CHECK(incision.area() == Approx(0.45 * std::hypot(0.65, 0.05) / 0.65).epsilon(1e-3));
  const auto frame = incision.front_frame(Vector3(0.6, 0.01, 0.6), 1);
  CHECK(frame->ahead.isApprox(Vector3(0.65, 0, 0.05).normalized(), 1e-9)); // not bent by the corner outside
  const SurfaceMesh coarse = rectangle(Vector3(-3, -4, 0.5), Vector3(3.5, 0, 0), Vector3(0, 9, 0), 1, 1);
  const Incision large({coarse}, unit_box()); // all vertices far outside
  CHECK(large.front_length() == Approx(1).epsilon(1e-7));
  CHECK(large.area() == Approx(0.5).epsilon(1e-3));
}

TEST_CASE("A through cut, a closed cut and a border on the surface have no front", "[incision]") {
  const Incision through({rectangle(Vector3(-0.1, -0.1, 0.4), Vector3(1.2, 0, 0.1), Vector3(0, 1.2, 0.1), 4, 4)},
                         unit_box());
  CHECK(through.front().empty());
  CHECK(through.front_length() == 0);
  CHECK_FALSE(through.front_frame(Vector3(0.5, 0.5, 0.5), 10));
  CHECK_FALSE(through.detour(Vector3(0.5, 0.5, 0.2), Vector3(0.5, 0.5, 0.8), 10));
  const Incision closed({make_box_domain(Vector3(0.3, 0.3, 0.3), Vector3(0.6, 0.7, 0.6), 0.1)->surface()}, unit_box());
  CHECK(closed.front().empty());
  CHECK(closed.area() == Approx(2 * (0.3 * 0.4 + 0.3 * 0.3 + 0.4 * 0.3)));
  const Incision flush({rectangle(Vector3(0, 0, 0.5), Vector3(1, 0, 0), Vector3(0, 1, 0), 3, 3)}, unit_box());
  CHECK(flush.front().empty());
  CHECK(flush.area() == Approx(1).epsilon(1e-4));
}

TEST_CASE("A border that lies on another sheet is no front", "[incision]") {
  const SurfaceMesh first = rectangle(Vector3(0.2, 0.2, 0.5), Vector3(0.3, 0, 0), Vector3(0, 0.6, 0), 2, 4);
  const SurfaceMesh going_on = rectangle(Vector3(0.5, 0.2, 0.5), Vector3(0.2, 0, 0), Vector3(0, 0.6, 0), 2, 3);
  const Incision abutting({first, going_on}, unit_box());
  CHECK(abutting.front_length() == Approx(2 * (0.5 + 0.6)));
  const SurfaceMesh turned = rectangle(Vector3(0.5, 0.2, 0.5), Vector3(0, 0, 0.2), Vector3(0, 0.6, 0), 2, 3);
  const Incision bent({first, turned}, unit_box());
  CHECK(bent.front_length() == Approx(2 * (0.3 + 0.2) + 2 * 0.6));
  // Crossing in the middle takes away nothing, a T takes away one border.
  const SurfaceMesh across = rectangle(Vector3(0.35, 0.2, 0.4), Vector3(0, 0, 0.2), Vector3(0, 0.6, 0), 2, 3);
  CHECK(Incision({first, across}, unit_box()).front_length() == Approx(2 * 0.9 + 2 * 0.8));
  const SurfaceMesh foot = rectangle(Vector3(0.35, 0.3, 0.5), Vector3(0, 0, 0.2), Vector3(0, 0.4, 0), 2, 3);
  CHECK(Incision({first, foot}, unit_box()).front_length() == Approx(2 * 0.9 + 2 * 0.2 + 0.4));
}

TEST_CASE("The detour is the shortest clear way over the front", "[incision]") {
  const Vector3 centre(0.5, 0.5, 0.5);
  const Incision incision({disc(centre, Vector3::UnitZ(), 0.3, 6)}, unit_box());
  Random random(6);
  int found = 0;
  for (int i = 0; i < 400; ++i) {
    const Vector3 x = centre + in_box(random, Vector3(-0.4, -0.4, 0.0001), Vector3(0.4, 0.4, 0.2));
    const Vector3 y = centre + in_box(random, Vector3(-0.4, -0.4, -0.2), Vector3(0.4, 0.4, -0.0001));
    if (!incision.blocks(x, y))
      continue;
    // Over a planar convex front every way is clear.
    double shortest = 1e9;
    for (const FrontSegment& segment : incision.front())
      for (int k = 0; k <= 200; ++k) {
        const Vector3 over = segment.from + k / 200.0 * (segment.to - segment.from);
        shortest = std::min(shortest, (x - over).norm() + (over - y).norm());
      }
    const double reach = uniform(random, 0.3, 1);
    const auto detour = incision.detour(x, y, reach);
    if (std::abs(shortest - reach) < 1e-4)
      continue;
    REQUIRE(detour.has_value() == (shortest < reach));
    if (!detour)
      continue;
    ++found;
    CHECK(detour->length <= shortest + 1e-12);
    CHECK(detour->length > shortest - 1e-4);
    CHECK(detour->length == Approx((x - detour->over).norm() + (detour->over - y).norm()));
  }
  CHECK(found > 100);
  // Lip partners near the centre: twice the radius of the polygon's side.
  const auto around = incision.detour(Vector3(centre + Vector3(0, 0, 1e-6)), Vector3(centre - Vector3(0, 0, 1e-6)), 1);
  REQUIRE(around);
  CHECK(around->length == Approx(2 * 0.3 * std::cos(M_PI / 36)).epsilon(1e-6));
}

TEST_CASE("From the face of a rough cut there is a detour over the front") {
  // What a blade leaves that is drawn in small steps while the tissue moves: bumps of 0.4 % of the width.
  const auto rough = [](double height) {
    return tests::grid_sheet(40, 40, [&](double s, double t) {
      const bool bump = (std::lround(40 * s) * 7 + std::lround(40 * t) * 3) % 5 < 2;
      return Vector3(0.2 + 0.4 * s, 0.2 + 0.6 * t, 0.5 + (bump ? height : 0));
    });
  };
  const Incision smooth({rough(0)}, unit_box()), bumpy({rough(0.0016)}, unit_box());
  Random random(9);
  for (int i = 0; i < 200; ++i) {
    const Vector3 place(uniform(random, 0.45, 0.58), uniform(random, 0.3, 0.7), 0.5);
    const auto on = bumpy.closest(place, 0.01);
    REQUIRE(on);
    const Vector3 x = on->point + 1e-5 * on->normal, y = on->point - 1e-5 * on->normal;
    REQUIRE(bumpy.blocks(x, y));
    const auto around = bumpy.detour(eye_at(bumpy, x, 0.4), eye_at(bumpy, y, 0.4), 0.4);
    const auto flat = smooth.detour(Vector3(place + Vector3(0, 0, 1e-5)), Vector3(place - Vector3(0, 0, 1e-5)), 0.4);
    REQUIRE(flat);
    REQUIRE(around);
    CHECK(around->length == Approx(flat->length).epsilon(0.02).margin(0.003));
  }
}

TEST_CASE("A detour whose legs another sheet blocks is not taken", "[incision]") {
  const SurfaceMesh cut = rectangle(Vector3(0.2, 0.2, 0.5), Vector3(0.4, 0, 0), Vector3(0, 0.6, 0), 4, 6);
  const Vector3 x(0.55, 0.5, 0.55), y(0.55, 0.5, 0.45);
  const Incision open({cut}, unit_box());
  REQUIRE(open.detour(x, y, 1));
  CHECK(open.detour(x, y, 1)->over.isApprox(Vector3(0.6, 0.5, 0.5), 1e-12));
  const SurfaceMesh wall = rectangle(Vector3(0.58, 0.1, 0.505), Vector3(0, 0.8, 0), Vector3(0, 0, 0.2), 3, 3);
  const Incision walled({cut, wall}, unit_box());
  const auto detour = walled.detour(x, y, 2);
  REQUIRE(detour);
  CHECK(detour->length > open.detour(x, y, 1)->length + 0.1);
  CHECK_FALSE(walled.blocks(x, x + 0.999 * (detour->over - x)));
}

TEST_CASE("However fine the front is, a detour far from the shortest way is found with bounded work", "[incision]") {
  const Vector3 x(0.55, 0.5, 0.55), y(0.55, 0.5, 0.45);
  const SurfaceMesh wall = rectangle(Vector3(0.58, 0.1, 0.505), Vector3(0, 0.8, 0), Vector3(0, 0, 0.2), 3, 3);
  const auto walled = [&](int cells) {
    return Incision({rectangle(Vector3(0.2, 0.2, 0.5), Vector3(0.4, 0, 0), Vector3(0, 0.6, 0), cells, cells), wall},
                    unit_box());
  };
  const auto coarse = walled(6).detour(x, y, 2);
  REQUIRE(coarse);
  for (const int cells : {30, 150}) {
    CAPTURE(cells);
    const Incision fine = walled(cells);
    const std::uint64_t before = sight_lines_walked();
    const auto detour = fine.detour(x, y, 2);
    CHECK(sight_lines_walked() - before <= 2 * 65);
    REQUIRE(detour);
    CHECK(detour->length >= coarse->length - 1e-9);         // all are as short or longer than the shortest clear one
    CHECK(detour->length <= coarse->length + 2 * 0.03 * 2); // by what the places that are looked at lie apart
    CHECK_FALSE(fine.blocks(x, x + 0.999 * (detour->over - x)));
    CHECK_FALSE(fine.blocks(y, y + 0.999 * (detour->over - y)));
  }
}

TEST_CASE("Queries do not allocate after a thread's first", "[incision]") {
  Random random(7);
  const Incision incision({wavy(random), disc(Vector3(0.5, 0.5, 0.5), Vector3::UnitX(), 0.2, 6)}, unit_box());
  int hits = incision.blocks(Vector3(0.5, 0.5, 0), Vector3(0.5, 0.5, 1)) ? 1 : 0; // this thread's first
  const auto before = tests::allocations();
  for (int i = 0; i < 200; ++i) {
    const Vector3 x = in_box(random, Vector3(0, 0, 0), Vector3(1, 1, 1)),
                  y = in_box(random, Vector3(0, 0, 0), Vector3(1, 1, 1));
    hits += incision.blocks(x, y) ? 1 : 0;
    hits += incision.near(x, 0.1) ? 1 : 0;
    hits += incision.closest(x, 0.5) ? 1 : 0;
    hits += incision.front_frame(x, 0.5) ? 1 : 0;
    hits += incision.detour(x, y, 1) ? 1 : 0;
  }
  CHECK(tests::allocations() == before);
  CHECK(hits > 0);
}

TEST_CASE("What is not a sheet in the body is refused by name", "[incision]") {
  const SurfaceMesh good = rectangle(Vector3(0.2, 0.2, 0.5), Vector3(0.3, 0, 0), Vector3(0, 0.6, 0), 2, 2);
  const auto box = unit_box();
  const auto refused = [&](const SurfaceMesh& bad, const std::string& part) {
    CHECK_THROWS_WITH(Incision({good, bad}, box), Catch::Contains("sheet 1") && Catch::Contains(part));
  };
  refused({}, "no triangles");
  SurfaceMesh bad = good;
  bad.vertices[4].x() = NAN;
  refused(bad, "vertex 4");
  bad = good;
  bad.triangles[3][1] = 99;
  refused(bad, "triangle 3");
  bad = good;
  bad.vertices[bad.triangles[0][1]] = 0.5 * (bad.vertices[bad.triangles[0][0]] + bad.vertices[bad.triangles[0][2]]);
  refused(bad, "triangle 0");
  bad = good;
  std::swap(bad.triangles[2][0], bad.triangles[2][1]);
  refused(bad, "not consistently oriented");
  bad = good;
  bad.vertices.emplace_back(0.4, 0.4, 0.8);
  bad.triangles.push_back({bad.triangles[0][0], bad.triangles[0][2], 9});
  refused(bad, "not manifold");
  bad = good; // two triangles tip to tip
  bad.triangles = {{0, 1, 4}, {4, 8, 7}};
  refused(bad, "only touch at vertex 4");
  refused(rectangle(Vector3(2, 2, 2), Vector3(1, 0, 0), Vector3(0, 1, 0), 2, 2), "outside the body");
  CHECK_THROWS_AS(Incision({good}, nullptr), InputError);
  CHECK_NOTHROW(Incision({}, box));
  const Incision none({}, box);
  CHECK_FALSE(none.blocks(Vector3(0, 0, 0), Vector3(1, 1, 1)));
  CHECK_FALSE(none.near(Vector3(0, 0, 0), 10));
  CHECK(none.area() == 0);
}
