// The built-in liver: an implicit shape, meshed evenly.
//
// Notation: f(x) < 0 inside; all lengths in metres; smooth_min and smooth_max blend over about k.
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"
#include "topology/surface/remeshing.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/task_arena.h>
#include <unordered_map>

namespace spherecut::topology {

namespace {

double smooth_max(double a, double b, double k) {
  const double greater = std::max(a, b), less = std::min(a, b);
  return greater + k * std::log1p(std::exp((less - greater) / k));
}
double smooth_min(double a, double b, double k) {
  return -smooth_max(-a, -b, k);
}

/// First-order distance to an axis-aligned ellipsoid: zero exactly on it.
double ellipsoid(const Vector3& x, const Vector3& centre, const Vector3& radii) {
  const Vector3 p = (x - centre).cwiseQuotient(radii);
  const double scaled = p.norm(), slope = p.cwiseQuotient(radii).norm();
  return slope > 0 ? scaled * (scaled - 1) / slope : -radii.minCoeff();
}

double liver_field(const Vector3& x) {
  const double right_lobe = ellipsoid(x, {-0.034, 0.000, -0.010}, {0.072, 0.074, 0.076});
  const double left_lobe = ellipsoid(x, {0.032, -0.018, -0.006}, {0.084, 0.056, 0.048});
  double f = smooth_min(right_lobe, left_lobe, 0.010);
  // The flattened underside rises towards the left and the back, which leaves a thin margin in front.
  const Vector3 down = Vector3(0.26, 0.30, -1).normalized();
  const double below = down.dot(x - Vector3(0, 0, -0.030));
  f = smooth_max(f, below, 0.0035);
  // Hollows: stomach and porta, kidney, gallbladder, vena cava.
  f = smooth_max(f, -ellipsoid(x, {0.055, 0.015, -0.046}, {0.068, 0.060, 0.050}), 0.005);
  f = smooth_max(f, -ellipsoid(x, {-0.060, 0.055, -0.070}, {0.042, 0.042, 0.050}), 0.005);
  f = smooth_max(f, -ellipsoid(x, {-0.010, -0.045, -0.048}, {0.014, 0.036, 0.016}), 0.004);
  f = smooth_max(f, -ellipsoid(x, {0.010, 0.074, 0.000}, {0.015, 0.018, 0.080}), 0.005);
  return f;
}

Vector3 liver_gradient(const Vector3& x) {
  constexpr double h = 1e-6; // m
  Vector3 gradient;
  for (int d = 0; d < 3; ++d)
    gradient[d] = (liver_field(x + h * Vector3::Unit(d)) - liver_field(x - h * Vector3::Unit(d))) / (2 * h);
  return gradient;
}

/// Newton steps along the gradient to f = 0.
Vector3 onto_liver(Vector3 x) {
  for (int step = 0; step < 20; ++step) {
    const double f = liver_field(x);
    if (std::abs(f) < 1e-11)
      break;
    const Vector3 gradient = liver_gradient(x);
    x -= f / gradient.squaredNorm() * gradient;
  }
  return x;
}

void project(SurfaceMesh& mesh) {
  for (Vector3& v : mesh.vertices)
    v = onto_liver(v);
}

/// Coarse isosurface by OpenVDB's dual contouring of the sampled field.
SurfaceMesh contour() {
  constexpr double voxel = 0.003; // m
  const Vector3 lower(-0.13, -0.10, -0.10), upper(0.14, 0.10, 0.10);
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create(static_cast<float>(voxel));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
  const Eigen::Array3i first = (lower / voxel).array().floor().cast<int>();
  const Eigen::Array3i last = (upper / voxel).array().ceil().cast<int>();
  auto values = grid->getAccessor();
  for (int i = first.x(); i <= last.x(); ++i)
    for (int j = first.y(); j <= last.y(); ++j)
      for (int k = first.z(); k <= last.z(); ++k)
        values.setValue({i, j, k}, static_cast<float>(liver_field(voxel * Vector3(i, j, k))));
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  // One thread: the order of the points must not depend on the schedule.
  tbb::task_arena one_thread(1);
  one_thread.execute([&] { openvdb::tools::volumeToMesh(*grid, points, quads); });

  SurfaceMesh mesh;
  for (const openvdb::Vec3s& p : points)
    mesh.vertices.emplace_back(p.x(), p.y(), p.z());
  for (const openvdb::Vec4I& q : quads) {
    const std::array<int, 4> v = {static_cast<int>(q[0]), static_cast<int>(q[1]), static_cast<int>(q[2]),
                                  static_cast<int>(q[3])};
    mesh.triangles.push_back({v[0], v[1], v[2]});
    mesh.triangles.push_back({v[0], v[2], v[3]});
  }
  return mesh;
}

/// Every triangle into four, new vertices at the middle of the edges.
SurfaceMesh subdivide(const SurfaceMesh& mesh) {
  SurfaceMesh fine;
  fine.vertices = mesh.vertices;
  fine.triangles.reserve(4 * mesh.triangles.size());
  std::unordered_map<std::uint64_t, int> middle_of_edge;
  middle_of_edge.reserve(2 * mesh.triangles.size());
  const auto middle = [&](int a, int b) {
    const auto [low, high] = std::minmax(a, b);
    const std::uint64_t key = (static_cast<std::uint64_t>(low) << 32) | static_cast<std::uint32_t>(high);
    const auto [entry, inserted] = middle_of_edge.emplace(key, static_cast<int>(fine.vertices.size()));
    if (inserted)
      fine.vertices.push_back(0.5 * (mesh.vertices[low] + mesh.vertices[high]));
    return entry->second;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    fine.triangles.push_back({a, ab, ca});
    fine.triangles.push_back({ab, b, bc});
    fine.triangles.push_back({ca, bc, c});
    fine.triangles.push_back({ab, bc, ca});
  }
  return fine;
}

/// Moves every vertex within the tangent plane towards the mean of its neighbours, then back onto the surface.
void relax_mesh(SurfaceMesh& mesh) {
  const std::vector<Vector3> normals = vertex_normals(mesh);
  std::vector<Vector3> sum(mesh.vertices.size(), Vector3::Zero());
  std::vector<int> count(mesh.vertices.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (int e = 0; e < 3; ++e) {
      sum[t[e]] += mesh.vertices[t[(e + 1) % 3]];
      ++count[t[e]];
    }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vector3 move = sum[v] / count[v] - mesh.vertices[v];
    mesh.vertices[v] += move - normals[v].dot(move) * normals[v];
  }
  project(mesh);
}

} // namespace

SurfaceMesh make_liver(int target_triangles) {
  constexpr int least = 1000, most = 500000;
  if (target_triangles < least || target_triangles > most)
    throw InputError(fmt::format("liver with {} triangles: must be from {} to {}", target_triangles, least, most));
  int subdivisions = 0;
  double base_triangles = target_triangles;
  for (; base_triangles >= 10000; base_triangles /= 4)
    ++subdivisions;

  SurfaceMesh mesh = contour();
  project(mesh);
  // Equilateral triangles have area sqrt(3) / 4 edge^2; the remeshing aims at somewhat shorter edges than told.
  constexpr double calibration = 1.095;
  const double edge = calibration * std::sqrt(area(mesh) / (std::sqrt(3.0) / 4 * base_triangles));
  mesh = remesh_isotropic(mesh, edge);
  project(mesh);
  for (int i = 0; i < subdivisions; ++i) {
    mesh = subdivide(mesh);
    project(mesh);
  }
  for (int i = 0; i < 3; ++i)
    relax_mesh(mesh);

  const Vector3 centre = bounds(mesh).centre();
  for (Vector3& v : mesh.vertices)
    v -= centre;
  return mesh;
}

} // namespace spherecut::topology
