// Local remeshing of the ledger: a cavity about a growing cut, and what lies far from it condensed.
#include "experiments/remeshing_ledger/cavity.hpp"
#include "experiments/remeshing_ledger/mesh_request.hpp"
#include "experiments/remeshing_ledger/sub_structure.hpp"
#include "experiments/remeshing_ledger/surface_patch.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::experiments::ledger;

namespace {

double volume_of(const TetMesh& mesh) {
  double volume = 0;
  for (const auto& t : mesh.tets)
    volume += six_volumes(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], mesh.vertices[t[3]]) / 6;
  return volume;
}

double area_of_cut(const CutMesh& mesh) {
  double area = 0;
  for (const CutMesh::Face& face : mesh.faces) {
    const Vector3& a = mesh.vertices[face.above[0]];
    area += 0.5 * (mesh.vertices[face.above[1]] - a).cross(mesh.vertices[face.above[2]] - a).norm();
  }
  return area;
}

} // namespace

TEST_CASE("A triangulated part of a surface keeps outline and lines, leaves its hole out and is graded inside") {
  PatchRequest request;
  request.points = {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {1, 1}, {2, 1}, {2, 2}, {1, 2}, {3, 1}, {3, 3}};
  request.outline = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}};
  request.lines = {{8, 9}};
  request.size = [](const Vector2&) { return 0.4; };
  const Patch patch = triangulate_patch(request);
  CHECK(patch.points.size() > 60);
  double area = 0;
  bool line = false;
  for (const Triangle& t : patch.triangles) {
    const Vector2 u = patch.points[t[1]] - patch.points[t[0]], v = patch.points[t[2]] - patch.points[t[0]];
    area += 0.5 * std::abs(u.x() * v.y() - u.y() * v.x());
    line = line || (std::count(t.begin(), t.end(), 8) == 1 && std::count(t.begin(), t.end(), 9) == 1);
  }
  CHECK(area == Approx(15).epsilon(1e-12));
  CHECK(line);
  request.outline = {{0, 2}, {1, 3}};
  CHECK_THROWS_AS(triangulate_patch(request), NumericalError);
}

TEST_CASE("A cavity about a growing cut is filled to the same body, cut by the strip's area more") {
  if (!has_cavity_mesher()) {
    CHECK_THROWS_AS(fill_cavity({}), NumericalError);
    return;
  }
  const Scenario edge = edge_cut(6);
  const double h = 0.007;
  const auto grading = [&](int k) { return Grading{h, 0.35, 4 * h, front_of(edge, k).points}; };
  TetMesh mesh = mesh_volume(mesh_request(edge, 0, grading(0)));
  const double volume = volume_of(mesh);
  for (int k = 1; k <= 3; ++k) {
    const std::size_t tets = mesh.tets.size();
    const Cavity cavity = open_cavity(mesh, edge, k - 1, k, grading(k), 1.1 * h, 1e-3 * h);
    const auto removed = std::count(cavity.removed.begin(), cavity.removed.end(), 1);
    CHECK(removed > 20);
    CHECK(2 * removed < std::ssize(cavity.removed));
    const TetMesh before = mesh;
    const TetMesh filling = fill_cavity(cavity.border);
    close_cavity(mesh, cavity, filling);
    CHECK(mesh.tets.size() == tets - static_cast<std::size_t>(removed) + filling.tets.size());
    CHECK(volume_of(mesh) == Approx(volume).epsilon(1e-5)); // Mesh_3 is off the skin by 1e-6 of the radius
    const CutMesh cut = part(mesh, edge, k, 1e-3 * h);
    // From the side where the cut runs in to the front, down to its depth.
    const std::vector<Vector2> outline = edge.outline(k);
    const double side = (-0.03 - edge.frame.origin.x()) / edge.frame.ahead.x();
    CHECK(area_of_cut(cut) == Approx((outline[1].x() - side) * -outline[1].y()).epsilon(1e-9));
    const Front front = front_of(edge, k);
    for (std::size_t i = 0; i < cut.front.size(); ++i)
      if (cut.front[i] != 0)
        CHECK(distance_to(front.points, cut.vertices[i]) < 1e-9);
    // A border that lacks a triangle is no border.
    Cavity open = cavity;
    open.border.triangles.pop_back();
    open.border.triangles.push_back({0, 1, 2});
    TetMesh other = before;
    CHECK_THROWS_AS(close_cavity(other, open, filling), NumericalError);
  }
}

TEST_CASE("A far part condensed before a cavity was filled gives the displacements of the whole system after it") {
  if (!has_cavity_mesher())
    return;
  const Scenario edge = edge_cut(6);
  const double h = 0.007;
  const auto grading = [&](int k) { return Grading{h, 0.35, 4 * h, front_of(edge, k).points}; };
  TetMesh mesh = mesh_volume(mesh_request(edge, 0, grading(0)));
  const Cavity cavity = open_cavity(mesh, edge, 0, 1, grading(1), 1.1 * h, 1e-3 * h);
  CutMesh cut = part(mesh, edge, 0, 1e-3 * h);
  FemNodes nodes = number_nodes(cut, edge, Element::quarter_point);
  SubStructure body;
  StageTimes times;
  body.condense(nodes, edge, cavity.removed, times);
  body.remember(node_keys(cut, nodes));
  const auto far = std::count_if(cavity.removed.begin(), cavity.removed.end(), [](char c) { return c == 0; });
  REQUIRE_FALSE(body.is_near(
      static_cast<std::size_t>(std::find(cavity.removed.begin(), cavity.removed.end(), 0) - cavity.removed.begin())));
  close_cavity(mesh, cavity, fill_cavity(cavity.border));
  cut = part(mesh, edge, 1, 1e-3 * h);
  nodes = number_nodes(cut, edge, Element::quarter_point);
  std::vector<char> near(mesh.tets.size(), 1);
  std::fill(near.begin(), near.begin() + far, 0); // those kept stand first
  body.renew(nodes, node_keys(cut, nodes), near, times);
  const VectorX found = body.solve(nodes, edge, false, times);
  const VectorX whole = solve_fem(cut, edge, Element::quarter_point, times).displacement;
  CHECK((found - whole).norm() < 1e-9 * whole.norm());
}
