#include "topology/organ/organs.hpp"

#include "tests/support/mesh_checks.hpp"
#include "topology/base/errors.hpp"
#include "topology/domain/domain.hpp"
#include "topology/surface/remeshing.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::angle_range;
using spherecut::tests::require_closed_sphere;

namespace {

/// Volume of the part with x below `bound`, by prisms over the midpoints of the triangles.
double volume_left_of(const SurfaceMesh& mesh, double bound) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vector3 centre = (a + b + c) / 3;
    if (centre.x() < bound)
      sum += 0.5 * (b - a).cross(c - a).z() * centre.z();
  }
  return sum;
}

} // namespace

TEST_CASE("The liver has the size and shape of an adult's at every resolution", "[liver]") {
  double finest = 0;
  for (const int target : {80000, 20000, 5000}) {
    INFO(target);
    const SurfaceMesh liver = make_liver(target);
    CHECK(static_cast<double>(liver.triangles.size()) == Approx(target).epsilon(0.05));
    const double litres = 1e3 * volume(liver);
    CHECK(litres > 1.2);
    CHECK(litres < 1.8);
    const BoundingBox box = bounds(liver);
    CHECK(box.centre().norm() < 1e-12);
    CHECK(box.extent().x() == Approx(0.22).epsilon(0.05));
    CHECK(box.extent().y() == Approx(0.15).epsilon(0.1));
    CHECK(box.extent().z() == Approx(0.12).epsilon(0.1));
    // One shape at all resolutions: the volume converges with the square of the edge, so by a factor of four.
    if (target == 80000) {
      finest = litres;
      continue;
    }
    CHECK(litres < finest);
    CHECK(litres == Approx(finest).epsilon(20.0 / target));
    require_closed_sphere(liver);
    const auto angles = angle_range(liver);
    CHECK(angles.smallest > 25);
    CHECK(angles.largest < 110);
  }
}

TEST_CASE("The liver's right lobe is the larger, its left lobe thins to an edge, its underside is the flatter one",
          "[liver]") {
  const SurfaceMesh liver = make_liver(5000);
  CHECK(volume_left_of(liver, 0) > 0.6 * volume(liver));
  const auto domain = make_organ_domain(liver);
  // Thickness along vertical lines.
  const auto thickness = [&](double x, double y) {
    double sum = 0;
    for (double z = -0.07; z < 0.07; z += 0.0005)
      sum += domain->signed_distance(Vector3(x, y, z)) < 0 ? 0.0005 : 0;
    return sum;
  };
  CHECK(thickness(-0.05, 0) > 0.08);
  CHECK(thickness(0.06, -0.01) < 0.05);
  CHECK(thickness(0.095, -0.01) < 0.35 * thickness(-0.05, 0));
  CHECK(thickness(0.095, -0.01) > 0.005);
  // The dome's top looks up; the underside looks down over an area smaller than the dome's, being flatter.
  double up = 0, down = 0;
  for (int t = 0; t < std::ssize(liver.triangles); ++t) {
    const Triangle& v = liver.triangles[t];
    const double triangle_area =
        0.5 * (liver.vertices[v[1]] - liver.vertices[v[0]]).cross(liver.vertices[v[2]] - liver.vertices[v[0]]).norm();
    (triangle_normal(liver, t).z() > 0 ? up : down) += triangle_area;
  }
  CHECK(up > down);
}

TEST_CASE("The liver is the same bits every time and refuses absurd sizes", "[liver]") {
  const SurfaceMesh first = make_liver(3000), second = make_liver(3000);
  CHECK(first.vertices == second.vertices);
  CHECK(first.triangles == second.triangles);
  CHECK_THROWS_WITH(make_liver(10), Catch::Contains("10") && Catch::Contains("1000"));
  CHECK_THROWS_AS(make_liver(100000000), InputError);
}

TEST_CASE("Remeshing keeps the volume and the topology and refuses what is no manifold", "[liver]") {
  const SurfaceMesh liver = make_liver(4000);
  const SurfaceMesh coarse = remesh_isotropic(liver, 0.012);
  require_closed_sphere(coarse);
  CHECK(coarse.triangles.size() < liver.triangles.size() / 2);
  CHECK(volume(coarse) == Approx(volume(liver)).epsilon(0.02));
  CHECK_THROWS_AS(remesh_isotropic(liver, -1), InputError);
  SurfaceMesh bow_tie = liver;
  bow_tie.triangles.push_back(bow_tie.triangles.front());
  CHECK_THROWS_AS(remesh_isotropic(bow_tie, 0.01), InputError);
}
