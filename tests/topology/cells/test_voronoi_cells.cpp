#include "topology/cells/voronoi_cells.hpp"

#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"
#include "topology/search/point_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

using namespace spherecut;
using topology::BoundaryFace;
using topology::CellComplex;
using topology::CellFace;
using topology::voronoi_cells;

namespace {

struct Nodes {
  std::vector<Vector3> positions;
  std::vector<double> spacings;
  double smallest = 0; // distance kept to nodes placed before
  void add(const Vector3& x, double spacing) {
    for (const Vector3& other : positions)
      if ((other - x).squaredNorm() < smallest * smallest * spacing * spacing)
        return;
    positions.push_back(x);
    spacings.push_back(spacing);
  }
};

/// Random places in a box.
Nodes scattered(int count, const Vector3& lower, const Vector3& upper, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Nodes nodes;
  const double h = std::cbrt((upper - lower).prod() / count);
  for (int i = 0; i < count; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    nodes.add(lower + Vector3(x, y, z).cwiseProduct(upper - lower), h);
  }
  return nodes;
}

/// Surface nodes on the body's own tessellation at least 0.8 h apart, then jittered grid points inside.
Nodes filled(const topology::Domain& domain, double h, std::uint64_t seed) {
  Nodes nodes;
  nodes.smallest = 0.8;
  for (const Vector3& vertex : domain.surface().vertices)
    nodes.add(vertex, h);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-0.2 * h, 0.2 * h);
  const BoundingBox box = domain.bounds();
  const Vector3 cells = (box.extent() / h).array().ceil();
  for (int a = 0; a < cells.x(); ++a)
    for (int b = 0; b < cells.y(); ++b)
      for (int c = 0; c < cells.z(); ++c) {
        const double x = shift(random), y = shift(random), z = shift(random);
        const Vector3 place = box.lower + h * Vector3(a + 0.5, b + 0.5, c + 0.5) + Vector3(x, y, z);
        if (domain.signed_distance(place) < -0.4 * h)
          nodes.add(place, h);
      }
  return nodes;
}

double total_volume(const CellComplex& cells) {
  double total = 0;
  for (double volume : cells.volumes)
    total += volume;
  return total;
}

/// Largest sum of a cell's area vectors, in units of h2.
double worst_closure(const CellComplex& cells, const Nodes& nodes) {
  std::vector<Vector3> sum(nodes.positions.size(), Vector3::Zero());
  for (const CellFace& face : cells.faces) {
    sum[face.first] += face.area;
    sum[face.second] -= face.area;
  }
  for (const BoundaryFace& face : cells.boundary)
    sum[face.node] += face.area;
  double worst = 0;
  for (std::size_t i = 0; i < sum.size(); ++i)
    worst = std::max(worst, sum[i].norm() / (nodes.spacings[i] * nodes.spacings[i]));
  return worst;
}

/// Every face lies in the bisecting plane of its two nodes.
void check_faces(const CellComplex& cells, const Nodes& nodes) {
  REQUIRE(cells.face_start.size() == cells.faces.size() + 1);
  REQUIRE(cells.boundary_start.size() == cells.boundary.size() + 1);
  double off_normal = 0, off_plane = 0, corners_off = 0;
  int reversed = 0;
  for (std::size_t f = 0; f < cells.faces.size(); ++f) {
    const CellFace& face = cells.faces[f];
    const double h = nodes.spacings[face.first];
    const Vector3 d = nodes.positions[face.second] - nodes.positions[face.first];
    const Vector3 direction = d.normalized(), middle = nodes.positions[face.first] + 0.5 * d;
    reversed += face.area.dot(d) <= 0;
    off_normal = std::max(off_normal, face.area.cross(direction).norm() / (h * h));
    off_plane = std::max(off_plane, std::abs((face.centroid - middle).dot(direction)) / h);
    for (int k = cells.face_start[f]; k < cells.face_start[f + 1]; ++k)
      corners_off = std::max(corners_off, std::abs((cells.face_corners[k] - middle).dot(direction)) / h);
  }
  CHECK(reversed == 0);
  CHECK(off_normal < 1e-9);
  CHECK(off_plane < 1e-9);
  CHECK(corners_off < 1e-9);
}

double curved_area(const CellComplex& cells) {
  double area = 0;
  for (const BoundaryFace& face : cells.boundary)
    if (face.plane < 0)
      area += face.area.norm();
  return area;
}

double planar_area(const CellComplex& cells, int plane) {
  double area = 0;
  for (const BoundaryFace& face : cells.boundary)
    if (face.plane == plane)
      area += face.area.norm();
  return area;
}

} // namespace

TEST_CASE("Cells of scattered nodes fill a box and close, with faces on bisecting planes") {
  const Vector3 lower(-0.02, 0.01, 0), upper(0.03, 0.04, 0.06); // centimetres: sizes are not of order one
  const auto domain = topology::make_box_domain(lower, upper, 0.01);
  for (int count : {1, 2, 7, 300}) {
    const Nodes nodes = scattered(count, lower, upper, 5);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
    CHECK(cells.empty_cells == 0);
    CHECK(total_volume(cells) == Approx((upper - lower).prod()).epsilon(1e-10));
    CHECK(worst_closure(cells, nodes) < 1e-10);
    check_faces(cells, nodes);
    const Vector3 size = upper - lower;
    for (int p = 0; p < 6; ++p) {
      CHECK(planar_area(cells, p) == Approx(size.prod() / size[p / 2]).epsilon(1e-10));
      for (const BoundaryFace& face : cells.boundary)
        if (face.plane == p)
          CHECK(face.area.normalized().dot(domain->planes()[p].normal) == Approx(1));
    }
    // First moment of the body by its cells.
    Vector3 moment = Vector3::Zero();
    for (int i = 0; i < count; ++i)
      moment += cells.volumes[i] * cells.centroids[i];
    CHECK((moment / size.prod() - 0.5 * (lower + upper)).norm() < 1e-10);
  }
}

TEST_CASE("Cells of nodes on faces, edges and corners of a box close as well") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.25);
  const Nodes nodes = filled(*domain, 0.25, 3);
  const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
  CHECK(cells.empty_cells == 0);
  CHECK(total_volume(cells) == Approx(1).epsilon(1e-10));
  CHECK(worst_closure(cells, nodes) < 1e-10);
  check_faces(cells, nodes);
}

TEST_CASE("A cell holds the points that are nearest to its node") {
  const Vector3 lower(0, 0, 0), upper(1, 2, 0.5);
  const auto domain = topology::make_box_domain(lower, upper, 0.25);
  const Nodes nodes = scattered(12, lower, upper, 8);
  const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
  std::mt19937_64 random(17);
  std::uniform_real_distribution<double> unit(0, 1);
  const int samples = 200000;
  std::vector<int> owned(nodes.positions.size(), 0);
  std::vector<Vector3> sum(nodes.positions.size(), Vector3::Zero());
  for (int s = 0; s < samples; ++s) {
    const double a = unit(random), b = unit(random), c = unit(random);
    const Vector3 x = lower + Vector3(a, b, c).cwiseProduct(upper - lower);
    int nearest = 0;
    for (int i = 1; i < std::ssize(nodes.positions); ++i)
      if ((nodes.positions[i] - x).squaredNorm() < (nodes.positions[nearest] - x).squaredNorm())
        nearest = i;
    ++owned[nearest];
    sum[nearest] += x;
  }
  const double body = (upper - lower).prod();
  for (std::size_t i = 0; i < nodes.positions.size(); ++i) {
    const double share = static_cast<double>(owned[i]) / samples, exact = cells.volumes[i] / body;
    const double deviation = std::sqrt(exact * (1 - exact) / samples);
    CHECK(std::abs(share - exact) < 4 * deviation);
    CHECK((sum[i] / owned[i] - cells.centroids[i]).norm() < 5 * 0.4 / std::sqrt(owned[i]));
  }
}

TEST_CASE("Cells of a half ball converge in volume and area") {
  const auto domain = topology::make_hemisphere_domain(1, 0.05);
  std::vector<double> volume_error, area_error;
  for (double h : {0.3, 0.15}) {
    const Nodes nodes = filled(*domain, h, 2);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
    CHECK(cells.empty_cells == 0);
    CHECK(worst_closure(cells, nodes) < 1e-10);
    check_faces(cells, nodes);
    volume_error.push_back(std::abs(total_volume(cells) / (2 * std::numbers::pi / 3) - 1));
    area_error.push_back(std::abs(curved_area(cells) / (2 * std::numbers::pi) - 1));
    const double base = std::abs(planar_area(cells, 0) / std::numbers::pi - 1);
    CHECK(base < 0.1 * h * h);
    for (const BoundaryFace& face : cells.boundary)
      if (face.plane < 0) {
        CHECK(std::abs(face.centroid.norm() - 1) < 1e-8);
        if (face.area.norm() > 0.1 * h * h)
          CHECK(face.area.normalized().dot(face.centroid) > 1 - 0.5 * h * h);
      }
  }
  CHECK(volume_error[0] < 0.01);
  CHECK(volume_error[1] < 0.35 * volume_error[0]);
  CHECK(area_error[1] < 0.35 * area_error[0]);
}

TEST_CASE("Cells of a cylinder converge in volume and keep its planar ends") {
  const auto domain = topology::make_cylinder_domain(0.05, 0.08, 0.003);
  std::vector<double> error;
  for (double h : {0.018, 0.009}) {
    const Nodes nodes = filled(*domain, h, 4);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
    CHECK(cells.empty_cells == 0);
    CHECK(worst_closure(cells, nodes) < 1e-10);
    check_faces(cells, nodes);
    error.push_back(std::abs(total_volume(cells) / (std::numbers::pi * 0.05 * 0.05 * 0.08) - 1));
    for (int end : {0, 1})
      CHECK(planar_area(cells, end) == Approx(std::numbers::pi * 0.05 * 0.05).epsilon(0.05 * h * h / (0.05 * 0.05)));
  }
  CHECK(error[0] < 0.01);
  CHECK(error[1] < 0.3 * error[0]);
}

TEST_CASE("Cells of a triangulated organ hold its volume and surface") {
  // The half ball's own mesh without its plane, and a shape with hollows.
  const auto half_ball = topology::make_organ_domain(topology::make_hemisphere(0.05, 0.004));
  const auto liver = topology::make_organ_domain(topology::make_liver(2000));
  for (const auto& [domain, h] : {std::pair{half_ball, 0.01}, std::pair{liver, 0.02}}) {
    const Nodes nodes = filled(*domain, h, 6);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
    const double volume = topology::volume(domain->surface()), area = topology::area(domain->surface());
    CHECK(cells.empty_cells == 0);
    CHECK(worst_closure(cells, nodes) < 1e-10);
    check_faces(cells, nodes);
    CHECK(total_volume(cells) == Approx(volume).epsilon(0.015));
    CHECK(curved_area(cells) == Approx(area).epsilon(0.05));
  }
}

TEST_CASE("Cells do not depend on the unit of length or on the spacing that guides the search") {
  const auto metres = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.25);
  const auto small = topology::make_box_domain(Vector3::Zero(), 1e-3 * Vector3::Ones(), 0.25e-3);
  Nodes nodes = scattered(60, Vector3::Zero(), Vector3::Ones(), 9);
  const CellComplex reference = voronoi_cells(nodes.positions, nodes.spacings, *metres);
  Nodes scaled = nodes;
  for (std::size_t i = 0; i < nodes.positions.size(); ++i) {
    scaled.positions[i] *= 1e-3;
    scaled.spacings[i] *= 1e-3;
    nodes.spacings[i] *= 0.6 + 0.02 * static_cast<double>(i);
  }
  const CellComplex in_millimetres = voronoi_cells(scaled.positions, scaled.spacings, *small);
  const CellComplex guided = voronoi_cells(nodes.positions, nodes.spacings, *metres);
  for (std::size_t i = 0; i < nodes.positions.size(); ++i) {
    CHECK(in_millimetres.volumes[i] == Approx(1e-9 * reference.volumes[i]).epsilon(1e-9));
    CHECK(guided.volumes[i] == Approx(reference.volumes[i]).epsilon(1e-9));
  }
}

TEST_CASE("Coincident nodes are refused by name") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.25);
  Nodes nodes = scattered(20, Vector3::Zero(), Vector3::Ones(), 1);
  nodes.positions[13] = nodes.positions[4];
  CHECK_THROWS_AS(voronoi_cells(nodes.positions, nodes.spacings, *domain), InputError);
  CHECK_THROWS_WITH(voronoi_cells(nodes.positions, nodes.spacings, *domain),
                    Catch::Contains("nodes 4 and 13 coincide"));
}

TEST_CASE("A node outside the body has no cell and takes nothing from the others") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.25);
  Nodes nodes = scattered(40, Vector3::Zero(), Vector3::Ones(), 1);
  nodes.add({0.5, 0.5, 3.0}, nodes.spacings.front());
  const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
  CHECK(cells.empty_cells == 1);
  CHECK(cells.volumes.back() == 0);
  CHECK(total_volume(cells) == Approx(1).epsilon(1e-10));
  CHECK(worst_closure(cells, nodes) < 1e-10);
}

TEST_CASE("Cells that would reach beyond the search box are refused instead of being cut short") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.25);
  const std::vector<Vector3> nodes{{0.1, 0.5, 0.5}, {0.9, 0.5, 0.5}};
  CHECK_THROWS_AS(voronoi_cells(nodes, {0.01, 0.01}, *domain), InputError);
}

TEST_CASE("At the sharp edges of a mesh cells end as they do at planes") {
  const Vector3 upper(0.02, 0.024, 0.016);
  const auto planes = topology::make_box_domain(Vector3::Zero(), upper, 0.002);
  const auto mesh = topology::make_organ_domain(topology::make_block(Vector3::Zero(), upper, 0.004));
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Nodes nodes = filled(*planes, 0.0025, seed);
    const CellComplex exact = voronoi_cells(nodes.positions, nodes.spacings, *planes);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *mesh);
    CHECK(cells.empty_cells == 0);
    CHECK(cells.faces.size() >= exact.faces.size());
    CHECK(worst_closure(cells, nodes) < 1e-9);
    double off = 0;
    for (std::size_t i = 0; i < nodes.positions.size(); ++i)
      off = std::max(off, std::abs(cells.volumes[i] - exact.volumes[i]) / std::pow(0.0025, 3));
    CHECK(off < 2e-3);
    CHECK(total_volume(cells) == Approx(upper.prod()).epsilon(1e-4));
    // Edge nodes have a part of the surface on each side of the edge.
    std::vector<int> parts(nodes.positions.size(), 0);
    for (const BoundaryFace& face : cells.boundary)
      ++parts[face.node];
    for (std::size_t i = 0; i < nodes.positions.size(); ++i) {
      const Vector3& x = nodes.positions[i];
      int sides = 0;
      for (int d = 0; d < 3; ++d)
        sides += x[d] < 1e-9 || x[d] > upper[d] - 1e-9 ? 1 : 0;
      CHECK(parts[i] >= sides);
    }
  }
}

TEST_CASE("A notch in a mesh takes nothing from the cells beside it") {
  // An L of three cubes of 8 mm, from quads of 2 mm.
  topology::SurfaceMesh mesh;
  const double step = 0.002;
  const auto full = [](int i, int j, int k) {
    return i >= 0 && j >= 0 && k >= 0 && i < 8 && j < 4 && k < 8 && (i < 4 || k < 4);
  };
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 8; ++k)
        for (int d = 0; d < 3 && full(i, j, k); ++d)
          for (const int side : {0, 1}) {
            std::array<int, 3> beside{i, j, k};
            beside[d] += side == 0 ? -1 : 1;
            if (full(beside[0], beside[1], beside[2]))
              continue;
            std::array<int, 4> corners{};
            int n = 0;
            for (const auto& [a, b] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1), std::pair(0, 1)}) {
              Vector3 x(i, j, k);
              x[d] += side;
              x[(d + 1) % 3] += a;
              x[(d + 2) % 3] += b;
              x *= step;
              const auto known = std::find(mesh.vertices.begin(), mesh.vertices.end(), x);
              corners[n++] = static_cast<int>(known - mesh.vertices.begin());
              if (known == mesh.vertices.end())
                mesh.vertices.push_back(x);
            }
            if (side == 0)
              std::swap(corners[1], corners[3]);
            mesh.triangles.push_back({corners[0], corners[1], corners[2]});
            mesh.triangles.push_back({corners[0], corners[2], corners[3]});
          }
  const double exact = 3 * std::pow(0.008, 3);
  REQUIRE(topology::volume(mesh) == Approx(exact));
  const auto domain = topology::make_organ_domain(mesh);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Nodes nodes = filled(*domain, 0.0018, seed);
    const CellComplex cells = voronoi_cells(nodes.positions, nodes.spacings, *domain);
    CHECK(cells.empty_cells == 0);
    CHECK(worst_closure(cells, nodes) < 1e-9);
    CHECK(total_volume(cells) == Approx(exact).epsilon(2e-3));
  }
}
