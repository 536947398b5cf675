#include "topology/domain/domain.hpp"
#include "topology/tool/contact.hpp"

#include "tests/support/mesh_oracles.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/level_set.hpp"
#include "topology/organ/organs.hpp"
#include "topology/surface/distance.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <thread>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::brute_force_distance;
using spherecut::tests::inside_by_winding;
using spherecut::tests::random_point;

namespace {

/// A spiky star: a block whose face centres are pulled far out, so that edges and vertices are sharp and re-entrant.
SurfaceMesh star() {
  SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 0.5);
  for (Vector3& v : mesh.vertices) {
    v.z() -= 0.5;
    const int zeros = (std::abs(v.x()) < 1e-12) + (std::abs(v.y()) < 1e-12) + (std::abs(v.z()) < 1e-12);
    v *= zeros == 2 ? 3.0 : zeros == 1 ? 0.6 : 1.0;
  }
  return mesh;
}

} // namespace

TEST_CASE("The exact signed distance has the brute-force value and the sign of the winding number", "[domain]") {
  for (const SurfaceMesh& mesh : {star(), make_hemisphere(1, 0.3), make_block(Vector3(1, 2, 0.3), 0.4)}) {
    const SurfaceDistance surface(mesh);
    std::mt19937 random(3);
    for (int i = 0; i < 2000; ++i) {
      const Vector3 x = random_point(bounds(mesh), random);
      INFO(x.transpose());
      const NearestPoint near = surface.nearest(x);
      CHECK(std::abs(near.distance) == Approx(brute_force_distance(mesh, x)).epsilon(1e-12));
      CHECK((near.distance < 0) == inside_by_winding(mesh, x));
      CHECK((near.point + near.distance * near.normal - x).norm() < 1e-12);
      CHECK(surface.nearest(x, i % static_cast<int>(mesh.triangles.size())).distance ==
            Approx(near.distance).epsilon(1e-12));
    }
  }
}

TEST_CASE("The sign is right straight off every vertex and edge of a spiky star", "[domain]") {
  const SurfaceMesh mesh = star();
  const SurfaceDistance surface(mesh);
  std::mt19937 random(5);
  for (const Triangle& t : mesh.triangles)
    for (int e = 0; e < 3; ++e)
      for (const double along : {0.0, 0.5}) {
        const Vector3 on = (1 - along) * mesh.vertices[t[e]] + along * mesh.vertices[t[(e + 1) % 3]];
        CHECK(std::abs(surface.nearest(on).distance) < 1e-15);
        CHECK(surface.nearest(on).normal.norm() == Approx(1));
        for (int i = 0; i < 20; ++i) {
          const Vector3 offset = random_point({-Vector3::Ones(), Vector3::Ones()}, random, 0);
          const Vector3 x = on + 0.01 * offset;
          CHECK((surface.nearest(x).distance < 0) == inside_by_winding(mesh, x));
        }
      }
}

TEST_CASE("Surfaces without a signed distance are refused", "[domain]") {
  SurfaceMesh open = make_block(Vector3(1, 1, 1), 0.5);
  open.triangles.pop_back();
  CHECK_THROWS_WITH(SurfaceDistance(open), Catch::Contains("open"));
  SurfaceMesh out_of_range = make_block(Vector3(1, 1, 1), 0.5);
  out_of_range.triangles[4][1] = 4000;
  CHECK_THROWS_WITH(SurfaceDistance(out_of_range), Catch::Contains("4000") && Catch::Contains("triangle 4"));
  CHECK_THROWS_AS(SurfaceDistance(SurfaceMesh{}), InputError);
  SurfaceMesh flat = make_block(Vector3(1, 1, 1), 5);
  for (Vector3& v : flat.vertices)
    v = Vector3(v.x(), 0, 0);
  CHECK_THROWS_WITH(SurfaceDistance(flat), Catch::Contains("no area"));
}

TEST_CASE("The level set agrees with the exact distance within a fraction of a voxel", "[level_set]") {
  const SurfaceMesh mesh = make_hemisphere(0.05, 0.004);
  const SurfaceDistance exact(mesh);
  double last_mean = 0;
  for (const double voxel : {0.002, 0.001}) {
    const LevelSet level_set(mesh, voxel);
    CHECK(level_set.voxel_size() == voxel);
    std::mt19937 random(17);
    double worst_near = 0, sum = 0;
    int count = 0, over_a_voxel = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vector3 x = random_point(bounds(mesh), random);
      INFO(x.transpose());
      const NearestPoint near = exact.nearest(x);
      if (near.distance > 0.9 * level_set.outside_band()) {
        CHECK(level_set.distance(x) <= level_set.outside_band() * (1 + 1e-6));
        CHECK(level_set.distance(x) > 0.5 * level_set.outside_band());
        continue;
      }
      const double error = std::abs(level_set.distance(x) - near.distance);
      if (near.distance > -10 * voxel)
        worst_near = std::max(worst_near, error);
      over_a_voxel += error > voxel;
      sum += error;
      ++count;
      if (std::abs(near.distance) > voxel)
        CHECK(level_set.inside(x) == (near.distance < 0));
      if (near.distance < 0)
        CHECK(level_set.near_triangle(x) >= 0);
    }
    CHECK(worst_near < voxel);
    CHECK(over_a_voxel <= count / 500);
    const double mean = sum / count;
    CHECK(mean < 0.1 * voxel);
    if (last_mean > 0)
      CHECK(mean < 0.6 * last_mean);
    last_mean = mean;
  }
}

TEST_CASE("The level set's gradient is the outward direction where the distance is smooth", "[level_set]") {
  const SurfaceMesh mesh = make_block(Vector3(0.1, 0.1, 0.1), 0.05);
  const LevelSet level_set(mesh, 0.002);
  CHECK((level_set.gradient(Vector3(0.04, 0, 0.05)) - Vector3::UnitX()).norm() < 1e-4);
  CHECK((level_set.gradient(Vector3(0.01, 0.01, 0.003)) + Vector3::UnitZ()).norm() < 1e-4);
  CHECK(level_set.gradient(Vector3(1, 1, 1)) == Vector3::Zero());
  CHECK(level_set.gradient(Vector3(1e12, 0, 0)) == Vector3::Zero());
  CHECK(level_set.distance(Vector3(1e12, 0, 0)) == level_set.outside_band());
  CHECK_FALSE(level_set.inside(Vector3(1, 1, 1)));
  CHECK(level_set.inside(Vector3(0, 0, 0.05)));
}

TEST_CASE("Voxel sizes that cannot hold the organ, or that fill memory, are refused", "[level_set]") {
  const SurfaceMesh mesh = make_block(Vector3(0.1, 0.1, 0.02), 0.01);
  CHECK_THROWS_WITH(LevelSet(mesh, 0.006), Catch::Contains("0.006") && Catch::Contains("0.005"));
  CHECK_THROWS_AS(LevelSet(mesh, -1), InputError);
  CHECK_THROWS_AS(LevelSet(mesh, std::numeric_limits<double>::quiet_NaN()), InputError);
  CHECK_THROWS_WITH(LevelSet(mesh, 1e-5), Catch::Contains("GB"));
  CHECK_THROWS_AS(LevelSet(SurfaceMesh{}), InputError);

  const LevelSet derived(mesh);
  CHECK(derived.voxel_size() == Approx(0.1 / 128));
  CHECK(derived.active_voxels() * std::pow(derived.voxel_size(), 3) > volume(mesh));
  CHECK(derived.memory_bytes() > derived.active_voxels() * sizeof(float));
  CHECK_NOTHROW(LevelSet(mesh, 0, derived.memory_bytes() * 2));
}

TEST_CASE("A surface that is oriented inwards is refused as an organ and for contact", "[domain]") {
  SurfaceMesh mesh = make_hemisphere(0.05, 0.01);
  CHECK_NOTHROW(make_organ_domain(mesh));
  CHECK_NOTHROW(ContactQuery(mesh));
  for (Triangle& t : mesh.triangles)
    std::swap(t[0], t[1]);
  CHECK_THROWS_WITH(make_organ_domain(mesh), Catch::Contains("oriented inwards"));
  CHECK_THROWS_WITH(ContactQuery(mesh), Catch::Contains("oriented inwards"));
}

TEST_CASE("An organ domain is exact near its surface and within a voxel ten voxels deep", "[domain]") {
  const SurfaceMesh mesh = make_hemisphere(0.05, 0.004);
  const auto organ = make_organ_domain(mesh, 0.001);
  CHECK(organ->planes().empty());
  CHECK(organ->surface().triangles == mesh.triangles);
  CHECK(organ->bounds().upper == bounds(mesh).upper);
  const SurfaceDistance exact(mesh);
  std::mt19937 random(23);
  for (int i = 0; i < 5000; ++i) {
    const Vector3 x = random_point(bounds(mesh), random);
    INFO(x.transpose());
    const NearestPoint near = exact.nearest(x);
    const double d = organ->signed_distance(x);
    CHECK((d < 0) == (near.distance < 0));
    if (std::abs(near.distance) < 0.0009 || near.distance > 0.004)
      CHECK(d == Approx(near.distance).epsilon(1e-12));
    else if (std::abs(near.distance) < 0.01)
      CHECK(std::abs(d - near.distance) < 0.001);
    CHECK(organ->curved_distance(x) == d);
    CHECK(organ->normal(x).norm() == Approx(1));
    const Vector3 p = organ->closest_surface_point(x);
    CHECK((x - p).norm() == Approx(std::abs(near.distance)).epsilon(1e-12));
    CHECK(std::abs(organ->signed_distance(p)) < 1e-15);

    const double h = 1e-7;
    if (std::abs(d) < 0.0008 &&
        (organ->closest_surface_point(x + Vector3(h, h, h)) - organ->closest_surface_point(x - Vector3(h, h, h)))
                .norm() < 1e-5) {
      Vector3 difference;
      for (int k = 0; k < 3; ++k)
        difference[k] =
            (organ->signed_distance(x + h * Vector3::Unit(k)) - organ->signed_distance(x - h * Vector3::Unit(k))) /
            (2 * h);
      CHECK((difference - organ->curved_gradient(x)).norm() < 1e-4);
    }
  }
}

TEST_CASE("An organ domain's sign is right all over a liver and at every one of its vertices", "[domain]") {
  const SurfaceMesh liver = make_liver(1000);
  const auto organ = make_organ_domain(liver);
  std::mt19937 random(31);
  for (int i = 0; i < 5000; ++i) {
    const Vector3 x = random_point(organ->bounds(), random, 0.1);
    INFO(x.transpose());
    CHECK((organ->signed_distance(x) < 0) == inside_by_winding(liver, x));
  }
  for (const Vector3& v : liver.vertices) {
    CHECK(std::abs(organ->signed_distance(v)) < 1e-15);
    const Vector3 x = v + 1e-4 * organ->normal(v);
    INFO(x.transpose());
    CHECK((organ->signed_distance(x) < 0) == inside_by_winding(liver, x));
  }
}

TEST_CASE("An organ domain answers the same from several threads at once", "[domain]") {
  const auto organ = make_organ_domain(make_hemisphere(0.05, 0.006), 0.002);
  const auto answers = [&organ] {
    std::mt19937 random(29);
    std::vector<double> result;
    for (int i = 0; i < 4000; ++i) {
      const Vector3 x = random_point(organ->bounds(), random);
      result.push_back(organ->signed_distance(x));
      result.push_back(organ->normal(x).sum());
    }
    return result;
  };
  const std::vector<double> expected = answers();
  std::vector<std::vector<double>> results(4);
  std::vector<std::thread> threads;
  for (auto& result : results)
    threads.emplace_back([&answers, &result] { result = answers(); });
  for (std::thread& thread : threads)
    thread.join();
  for (const auto& result : results)
    CHECK(result == expected);
}

TEST_CASE("A voxel is no smaller than what the level set can hold, and a body too small for that is told",
          "[level_set]") {
  const auto cube = [](double side) { return make_block(Vector3::Constant(side), side / 4); };
  CHECK(LevelSet(cube(0.0018), 0).voxel_size() == 2e-5);
  CHECK_THROWS_WITH(LevelSet(cube(0.0018), 1e-5), Catch::Contains("1e-05") && Catch::Contains("at least 2e-05"));
  CHECK_THROWS_WITH(LevelSet(cube(6e-5), 0), Catch::Contains("scale"));
}
