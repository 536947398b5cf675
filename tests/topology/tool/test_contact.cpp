// First touch, walk and exact closest point: each against geometry known in closed form, and against each other.
#include "tests/support/allocation_counter.hpp"
#include "tests/support/bumpy_sphere.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/domain.hpp"
#include "topology/organ/organs.hpp"
#include "topology/tool/contact.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

namespace spherecut::topology {
namespace {

Vector3 random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Vector3 d;
  do
    d = Vector3::NullaryExpr([&] { return normal(random); });
  while (d.norm() < 0.1);
  return d.normalized();
}

SurfaceMesh read_obj(const std::string& file, double scale) {
  std::ifstream in(file);
  REQUIRE(in);
  SurfaceMesh mesh;
  for (std::string line, kind; std::getline(in, line);) {
    std::istringstream words(line);
    kind.clear();
    words >> kind;
    if (kind == "v") {
      Vector3 v;
      words >> v.x() >> v.y() >> v.z();
      mesh.vertices.emplace_back(scale * v);
    } else if (kind == "f") {
      Triangle t;
      std::string corner;
      for (int& v : t) {
        words >> corner;
        v = std::stoi(corner) - 1; // up to the first slash
      }
      mesh.triangles.push_back(t);
    }
  }
  return mesh;
}

/// Radius about tool_point that the contact's depth refers to.
double skeleton_radius(const ToolShape& tool, const ToolPose& pose, const SurfaceContact& contact) {
  if (const auto* tip = std::get_if<SphereTip>(&tool))
    return tip->radius;
  if (const auto* scope = std::get_if<Laparoscope>(&tool)) {
    const Vector3 centre = pose.point + scope->tip_radius * pose.axis;
    return (contact.tool_point - centre).norm() < 1e-12 ? scope->tip_radius : scope->shaft_radius;
  }
  return 0;
}

/// Greatest depth over a sampling of the tool's skeleton, by exact closest points.
double sampled_depth(const ContactQuery& query, const ToolShape& tool, const ToolPose& pose) {
  double deepest = -std::numeric_limits<double>::infinity();
  const auto sample = [&](const Vector3& x, double radius) {
    deepest = std::max(deepest, radius + query.closest_point(x).depth);
  };
  if (const auto* tip = std::get_if<SphereTip>(&tool)) {
    sample(pose.point + tip->radius * pose.axis, tip->radius);
  } else if (const auto* scope = std::get_if<Laparoscope>(&tool)) {
    const Vector3 centre = pose.point + scope->tip_radius * pose.axis;
    sample(centre, scope->tip_radius);
    for (int i = 0; i <= 60; ++i) // denser near the tip
      sample(centre + i * i / 3600.0 * scope->shaft_length * pose.axis, scope->shaft_radius);
  } else {
    const double radius = std::get<FlatPunch>(tool).radius;
    const Vector3 e1 = pose.axis.unitOrthogonal(), e2 = pose.axis.cross(e1);
    for (int i = 0; i <= 4; ++i)
      for (int k = 0; k < (i == 0 ? 1 : 24); ++k) {
        const double angle = k * 0.26179938779914946;
        sample(pose.point + i / 4.0 * radius * (std::cos(angle) * e1 + std::sin(angle) * e2), 0);
      }
  }
  return deepest;
}

struct Agreement {
  int steps = 0, touching = 0, walk_is_fcl = 0, walk_is_exact = 0, same_point = 0, sunk = 0, nothing_deeper = 0;
  double worst_missed = 0; // m, by which a sampled skeleton point is deeper
};

/// Slides of 60 steps of 0.1 mm over the surface, at depths from 2 mm of clearance to 9 mm of penetration, with the
/// walk always starting from its own last answer.
Agreement slide(const SurfaceMesh& organ, const std::vector<ToolShape>& tools, int slides, unsigned seed) {
  const ContactQuery query(organ);
  const Vector3 centre = bounds(organ).centre();
  const double size = bounds(organ).extent().maxCoeff();
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any_depth(-0.002, 0.009), unit(0, 1);
  std::uniform_int_distribution<int> any_triangle(0, static_cast<int>(organ.triangles.size()) - 1);
  Agreement result;
  for (int i = 0; i < slides; ++i) {
    ToolShape tool = tools[i % tools.size()];
    const int start = any_triangle(random);
    const Vector3 out = triangle_normal(organ, start);
    if (auto* scope = std::get_if<Laparoscope>(&tool)) // a port anywhere about the organ: shafts may cross it
      scope->port =
          unit(random) < 0.5
              ? Vector3(centre + 0.9 * size * random_direction(random))
              : Vector3(organ.vertices[organ.triangles[start][0]] + 0.1 * (out + 0.9 * random_direction(random)));
    const Vector3 tilted = (out + 0.6 * unit(random) * random_direction(random)).normalized();
    const double depth = any_depth(random);
    Vector3 point = organ.vertices[organ.triangles[start][0]] - depth * out, heading = random_direction(random);
    SurfaceContact last = query.first_touch(tool, pose_at(tool, point, tilted));
    for (int step = 0; step < 60; ++step) {
      const SurfaceContact below = query.closest_point(point);
      heading += 0.2 * random_direction(random);
      const Vector3 along = heading - heading.dot(below.normal) * below.normal;
      const Vector3 motion = along.normalized() + std::clamp((below.depth - depth) / 1e-4, -1.0, 1.0) * below.normal;
      point += 1e-4 * motion.normalized();

      const ToolPose pose = pose_at(tool, point, tilted);
      const SurfaceContact walked = query.walk(tool, pose, last), touched = query.first_touch(tool, pose);
      last = walked;
      const SurfaceContact exact = query.closest_point(walked.tool_point);
      const double radius = skeleton_radius(tool, pose, walked);
      ++result.steps;
      result.touching += walked.depth > 0;
      result.walk_is_fcl += std::abs(walked.depth - touched.depth) <= 1e-9;
      result.walk_is_exact += std::abs(walked.depth - (radius + exact.depth)) <= 1e-9 &&
                              std::abs((walked.point - walked.tool_point).norm() - std::abs(exact.depth)) <= 1e-9;
      // The deepest point of a sunk axis lies as near to one side of the body as to another: either may be named.
      const bool sunk = std::holds_alternative<Laparoscope>(tool) &&
                        (walked.tool_point - pose.point).norm() > radius + 1e-9 && exact.depth > 0;
      result.same_point +=
          sunk ? (walked.tool_point - touched.tool_point).norm() <= 1e-6
               : (walked.point - touched.point).norm() <= 1e-9 && (walked.point - exact.point).norm() <= 1e-9;
      result.sunk += sunk;
      const double missed = sampled_depth(query, tool, pose) - walked.depth;
      const double allowed = std::holds_alternative<FlatPunch>(tool) ? 0.2 * tip_radius(tool) : 1e-9;
      result.nothing_deeper += missed <= allowed;
      result.worst_missed = std::max(result.worst_missed, missed);
    }
  }
  return result;
}

void require_agreement(const SurfaceMesh& organ, unsigned seed) {
  struct Family {
    const char* name;
    std::vector<ToolShape> tools;
  };
  const std::vector<Family> families{
      {"sphere", {SphereTip{0.002}, SphereTip{0.005}, SphereTip{0.012}}},
      {"punch", {FlatPunch{0.003, 0.05}, FlatPunch{0.005, 0.05}}},
      {"laparoscope",
       {Laparoscope{0.004, 0.0025, 0.3, Vector3::Zero()}, Laparoscope{0.0025, 0.0025, 0.1, Vector3::Zero()}}}};
  for (const Family& family : families) {
    const Agreement a = slide(organ, family.tools, 36, seed++);
    std::ostringstream report;
    report << family.name << ": " << a.steps << " steps, " << a.touching << " touching, " << a.sunk
           << " with the axis sunk; depth agrees to 1e-9 m: FCL " << 100.0 * a.walk_is_fcl / a.steps << " %, exact "
           << 100.0 * a.walk_is_exact / a.steps << " %; same point " << 100.0 * a.same_point / a.steps
           << " %; deepest sampled point missed by " << a.worst_missed << " m";
    INFO(report.str());
    if (std::getenv("SPHERECUT_TEST_REPORT"))
      WARN(report.str());
    CHECK(a.steps >= 2000);
    CHECK(a.touching > a.steps / 2);
    CHECK(a.walk_is_fcl == a.steps);
    CHECK(a.walk_is_exact == a.steps);
    CHECK(a.nothing_deeper == a.steps);
    CHECK(a.same_point >= 0.995 * a.steps); // the rest are ties between two surface points
  }
}

} // namespace

TEST_CASE("Walk, FCL and exact closest point agree on random slides over a bumpy sphere") {
  require_agreement(tests::bumpy_sphere(30, 0.08, 0.08), 11);
}

TEST_CASE("Walk, FCL and exact closest point agree on random slides over the built-in liver") {
  require_agreement(make_liver(5000), 31);
}

TEST_CASE("Walk, FCL and exact closest point agree on random slides over a liver from a scan") {
  const char* file = std::getenv("SPHERECUT_LIVER_OBJ");
  if (!file) {
    WARN(
        "SKIPPED: set SPHERECUT_LIVER_OBJ to a liver surface (.obj, coordinates times 0.0337 give metres) to run this");
    return;
  }
  require_agreement(read_obj(file, 0.0337), 21);
}

TEST_CASE("Contact with a sphere mesh has the analytic depth, point and normal") {
  const double radius = 0.05;
  const SurfaceMesh organ = tests::bumpy_sphere(60, radius, 0);
  const ContactQuery query(organ);
  // Facets sag below the sphere by (longest edge)^2 / 6 R at most.
  double edge = 0;
  for (const Triangle& t : organ.triangles)
    for (int k = 0; k < 3; ++k)
      edge = std::max(edge, (organ.vertices[t[k]] - organ.vertices[t[(k + 1) % 3]]).norm());
  const double sag = edge * edge / (6 * radius);
  std::mt19937 random(5);
  SurfaceContact last;
  for (int i = 0; i < 200; ++i) {
    const Vector3 u = random_direction(random);
    const double depth = -0.004 + 0.0001 * i; // to 16 mm: the tip's centre is deep inside
    const ToolShape tool = SphereTip{0.006};
    const ToolPose pose = pose_at(tool, (radius - depth) * u, u);
    last = query.walk(tool, pose, last);
    for (const SurfaceContact& c : {last, query.first_touch(tool, pose)}) {
      CHECK(c.depth == Approx(depth - 0.5 * sag).margin(0.5 * sag + 1e-12));
      CHECK(c.normal.dot(u) > 0.998);
      CHECK(std::abs(c.point.norm() - radius) <= sag);
      CHECK((c.point - radius * u).norm() < 0.002);
      CHECK(c.triangle >= 0);
    }
  }
}

TEST_CASE("A flat punch on a block reports its depth at the centre, and at the lowest rim point when tilted") {
  const auto block = make_box_domain({-0.05, -0.05, -0.04}, {0.05, 0.05, 0}, 0.008);
  const ContactQuery query(block->surface());
  const FlatPunch punch{0.005, 0.05};
  for (double depth : {-0.003, 0.0005, 0.004, 0.012}) {
    const ToolPose pose = pose_at(punch, {0.0021, -0.0033, -depth});
    for (const SurfaceContact& c : {query.walk(punch, pose, {}), query.first_touch(punch, pose)}) {
      CHECK(c.depth == Approx(depth).margin(1e-12));
      CHECK((c.point - Vector3(0.0021, -0.0033, 0)).norm() < 1e-12);
      CHECK((c.normal - Vector3::UnitZ()).norm() < 1e-12);
      CHECK((c.tool_point - pose.point).norm() == 0);
    }
    for (double tilt : {0.01, 0.2, 0.7}) {
      const Vector3 axis(std::sin(tilt) * 0.8, std::sin(tilt) * 0.6, std::cos(tilt));
      const ToolPose tilted = pose_at(punch, pose.point, axis);
      const double lowest = depth + punch.radius * std::sin(tilt);
      for (const SurfaceContact& c : {query.walk(punch, tilted, {}), query.first_touch(punch, tilted)}) {
        CHECK(c.depth == Approx(lowest).margin(1e-12));
        CHECK((c.tool_point - pose.point).norm() == Approx(punch.radius));
        CHECK((c.point - c.tool_point).head<2>().norm() < 1e-12);
      }
    }
  }
}

TEST_CASE("A punch pushed askew onto a ball is deepest within its flat end") {
  const double radius = 0.05;
  const ContactQuery query(tests::bumpy_sphere(120, radius, 0));
  const FlatPunch punch{0.006, 0.05};
  // The flat end is tangent to the level set of the ball at 0.003 m from its centre, half way to the rim.
  const Vector3 u = Vector3(0.3, -0.4, 0.8).normalized(), side = u.unitOrthogonal();
  const double depth = 0.002;
  const ToolPose pose = pose_at(punch, (radius - depth) * u + 0.003 * side, u);
  const SurfaceContact c = query.walk(punch, pose, {});
  CHECK(c.depth == Approx(depth).margin(2e-5));
  CHECK((c.tool_point - (radius - depth) * u).norm() < 2e-4);
}

TEST_CASE("A laparoscope lying over an edge of a block touches with its shaft, even when the axis is sunk") {
  const auto block = make_box_domain({-0.05, -0.05, -0.05}, {0, 0.05, 0}, 0.007);
  const ContactQuery query(block->surface());
  for (double gap : {0.003, 0.002, 0.0005, -0.001, -0.006}) { // of the axis over the edge x = z = 0, m
    const Vector3 slope = Vector3(-1, 0, 1).normalized();     // the axis' direction in the plane y = 0.0013
    const Vector3 over = Vector3(0, 0.0013, 0) + gap * Vector3(1, 0, 1).normalized();
    Laparoscope scope{0.004, 0.0025, 0.3, over + 0.12 * slope};
    const ToolPose pose = pose_at(scope, over - 0.06 * slope);
    for (const SurfaceContact& c : {query.walk(scope, pose, {}), query.first_touch(scope, pose)}) {
      CHECK(c.depth == Approx(scope.shaft_radius - (gap > 0 ? gap : gap * std::sqrt(0.5))).margin(1e-11));
      CHECK((c.tool_point - over).norm() < 1e-9);
      if (gap > 0) {
        CHECK((c.point - Vector3(0, 0.0013, 0)).norm() < 1e-9);
        CHECK((c.normal - Vector3(1, 0, 1).normalized()).norm() < 1e-9);
      }
    }
  }
}

TEST_CASE("A tool wholly inside the organ is deeper than its size") {
  const auto block = make_box_domain({-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, 0.02);
  const ContactQuery query(block->surface());
  const SphereTip tip{0.003};
  const ToolPose in_ball = pose_at(tip, {0.001, 0.002, 0.027});
  const Laparoscope scope{0.003, 0.002, 0.02, Vector3(0.001, 0.002, 0.4)};
  const ToolPose in_scope = pose_at(scope, {0.001, 0.002, -0.01}); // axis from z = -0.007 to 0.013
  for (bool walk : {true, false}) {
    const auto contact = [&](const ToolShape& tool, const ToolPose& pose) {
      return walk ? query.walk(tool, pose, {}) : query.first_touch(tool, pose);
    };
    CHECK(contact(tip, in_ball).depth == Approx(0.003 + 0.02));
    CHECK(contact(tip, in_ball).normal.isApprox(Vector3::UnitZ()));
    CHECK(contact(scope, in_scope).depth == Approx(0.002 + 0.048)); // nearest side: y = 0.05; the tip: 0.046
    CHECK(contact(scope, in_scope).point.y() == Approx(0.05));
  }
}

TEST_CASE("Normals at edges and corners are the pseudonormals and give the right side") {
  const auto block = make_box_domain({0, 0, 0}, {0.1, 0.1, 0.1}, 0.03);
  const ContactQuery query(block->surface());
  const SurfaceContact corner = query.closest_point({0.13, 0.14, 0.12});
  CHECK((corner.point - Vector3::Constant(0.1)).norm() < 1e-15);
  CHECK((corner.normal - Vector3::Ones().normalized()).norm() < 1e-9);
  CHECK(corner.depth == Approx(-Vector3(0.03, 0.04, 0.02).norm()));
  const SurfaceContact edge = query.closest_point({0.13, 0.0417, 0.14});
  CHECK((edge.normal - Vector3(1, 0, 1).normalized()).norm() < 1e-9);
  CHECK(edge.depth == Approx(-0.05));
  CHECK(query.closest_point({0.06, 0.05, 0.09}).depth == Approx(0.01));
}

TEST_CASE("The walk crosses a hollow whose other side becomes nearer") {
  // A ball held in the middle of a U: it moves sideways from one wall to the other, with no path over neighbours along
  // which the distance falls.
  SurfaceMesh organ = tests::bumpy_sphere(40, 0.05, 0);
  for (Vector3& v : organ.vertices) // a deep groove along y, 16 mm wide
    if (v.z() > 0)
      v.z() *= 1 - 0.9 * std::exp(-std::pow(v.x() / 0.008, 4));
  const ContactQuery query(organ);
  const SphereTip tip{0.002};
  SurfaceContact last;
  int sides = 0;
  for (int i = 0; i <= 100; ++i) {
    const ToolPose pose = pose_at(tip, {-0.005 + 1e-4 * i, 0.001, 0.025});
    const SurfaceContact now = query.walk(tip, pose, last);
    CHECK(now.depth == Approx(query.first_touch(tip, pose).depth).margin(1e-12));
    sides += i > 0 && now.point.x() * last.point.x() < 0 && now.point.z() > 0.015;
    last = now;
  }
  CHECK(sides == 1);
}

TEST_CASE("The walk neither allocates nor depends on where it starts") {
  const SurfaceMesh organ = tests::bumpy_sphere(40, 0.08, 0.08);
  const ContactQuery query(organ);
  const std::vector<ToolShape> tools{SphereTip{}, FlatPunch{},
                                     Laparoscope{0.004, 0.0025, 0.3, Vector3(0.05, 0.02, 0.2)},
                                     Laparoscope{0.004, 0.0025, 0.3, Vector3(0, 0.01, -0.2)}}; // through the organ
  static_assert(std::is_nothrow_invocable_v<decltype(&ContactQuery::walk), const ContactQuery&, const ToolShape&,
                                            const ToolPose&, const SurfaceContact&>);
  std::mt19937 random(9);
  std::uniform_int_distribution<int> any(-5, static_cast<int>(organ.triangles.size()) + 5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 300; ++i) {
    const ToolShape& tool = tools[i % tools.size()];
    const ToolPose pose = pose_at(tool, 0.1 * random_direction(random), random_direction(random));
    SurfaceContact from;
    from.triangle = any(random);
    for (int& triangle : from.end_triangles)
      triangle = any(random);
    const std::size_t before = tests::allocations();
    const SurfaceContact walked = query.walk(tool, pose, from), again = query.walk(tool, pose, walked);
    const std::size_t after = tests::allocations();
    CHECK(after == before);
    CHECK(walked.depth == Approx(again.depth).margin(1e-12));
    CHECK(walked.triangle >= 0);
  }
  const std::size_t before = tests::allocations();
  const bool survives = query.walk(SphereTip{}, {Vector3::Constant(nan), Vector3::UnitZ()}, {}).triangle >= 0;
  CHECK(tests::allocations() == before);
  CHECK(survives);
  CHECK(std::make_unique<int>(1));
  CHECK(tests::allocations() > before); // the counter counts
}

TEST_CASE("The walk is exact on small surfaces, far from the origin, and from far away") {
  std::mt19937 random(13);
  std::uniform_real_distribution<double> log_reach(-3, 1);
  for (const Vector3& centre : {Vector3(0, 0, 0), Vector3(30, -20, 50)})
    for (int n : {1, 2, 3, 5, 9}) {
      INFO(n << " at " << centre.transpose());
      const ContactQuery query(tests::bumpy_sphere(n, 0.05, 0.08, centre));
      const SphereTip tip{0.003};
      for (int i = 0; i < 200; ++i) {
        const Vector3 axis = random_direction(random);
        const Vector3 x = centre + std::pow(10, log_reach(random)) * random_direction(random);
        const SurfaceContact walked = query.walk(tip, {x - tip.radius * axis, axis}, {});
        CHECK(walked.depth == Approx(tip.radius + query.closest_point(x).depth).margin(1e-12));
      }
      const Laparoscope scope{0.004, 0.0025, 0.08, Vector3(0.01, 0.02, 0.4) + centre};
      for (int i = 0; i < 100; ++i) {
        const ToolPose pose = pose_at(scope, centre + 0.06 * random_direction(random));
        const SurfaceContact walked = query.walk(scope, pose, {});
        CHECK(walked.depth == Approx(query.first_touch(scope, pose).depth).margin(1e-9));
        CHECK(walked.depth >= sampled_depth(query, scope, pose) - 1e-9);
      }
    }
}

TEST_CASE("Contact queries refuse broken surfaces and poses") {
  CHECK_THROWS_AS(ContactQuery(SurfaceMesh{}), InputError);
  const std::vector<Vector3> corners{{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  CHECK_THROWS_WITH(ContactQuery(SurfaceMesh{corners, {{0, 1, 3}}}), Catch::Contains("triangle 0 names vertex 3"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(ContactQuery(SurfaceMesh{{{0, 0, 0}, {nan, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}),
                    Catch::Contains("vertex 1"));
  const ContactQuery one_triangle(SurfaceMesh{corners, {{0, 1, 2}}});
  CHECK(one_triangle.walk(SphereTip{0.01}, pose_at(SphereTip{0.01}, {0.02, 0.03, 0.004}), {}).depth ==
        Approx(0.01 - 0.014));
  CHECK_THROWS_AS(one_triangle.first_touch(SphereTip{-1}, {}), InputError);
  CHECK_THROWS_AS(one_triangle.first_touch(SphereTip{}, {Vector3::Constant(nan), Vector3::UnitZ()}), InputError);
}

} // namespace spherecut::topology
