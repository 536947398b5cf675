#include "topology/base/errors.hpp"
#include "topology/files/label_volume.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/task_arena.h>

namespace spherecut::topology {

namespace {

constexpr int relaxations = 20;
constexpr double forward = 0.5, backward = -0.53; // steps in turn, so that the surface does not shrink [Taubin 1995]
constexpr double off_centres = 0.1;               // voxels, by which a vertex stays off the planes of voxel centres
constexpr std::size_t labels_listed = 12;

std::map<std::int32_t, std::int64_t> count_labels(const LabelVolume& volume) {
  std::map<std::int32_t, std::int64_t> counts;
  std::int32_t last = 0;
  std::int64_t run = 0;
  for (const std::int32_t label : volume.labels) { // labels come in runs
    if (label != last) {
      counts[last] += run;
      last = label;
      run = 0;
    }
    ++run;
  }
  counts[last] += run;
  counts.erase(0);
  return counts;
}

std::int32_t chosen_label(const std::map<std::int32_t, std::int64_t>& counts, std::optional<int> label, double voxel,
                          const std::string& name) {
  std::string list;
  std::size_t listed = 0;
  for (const auto& [value, count] : counts) {
    if (++listed > labels_listed) {
      list += fmt::format(" and {} more", counts.size() - labels_listed);
      break;
    }
    list += fmt::format("{}{} ({:.4g} ml)", list.empty() ? "" : ", ", value, 1e6 * voxel * static_cast<double>(count));
  }
  if (counts.empty())
    throw InputError(fmt::format("{}: every voxel is 0: there is no label", name));
  if (label) {
    if (!counts.contains(*label))
      throw InputError(fmt::format("{}: no voxel has the label {}; there are: {}", name, *label, list));
    return *label;
  }
  if (counts.size() > 1)
    throw InputError(
        fmt::format("{}: holds {} labels: {}; organ.label tells which is the organ", name, counts.size(), list));
  return counts.begin()->first;
}

struct VoxelBox {
  std::array<int, 3> lower{}, upper{}; // inclusive
  bool at_border = false;              // of the volume
};

VoxelBox fill_grid(const LabelVolume& volume, std::int32_t label, openvdb::FloatGrid& grid) {
  auto values = grid.getAccessor();
  VoxelBox box;
  box.lower = volume.size;
  std::size_t at = 0;
  for (int k = 0; k < volume.size[2]; ++k)
    for (int j = 0; j < volume.size[1]; ++j)
      for (int i = 0; i < volume.size[0]; ++i, ++at) {
        if (volume.labels[at] != label)
          continue;
        values.setValue(openvdb::Coord(i, j, k), 1);
        const std::array<int, 3> here{i, j, k};
        for (int d = 0; d < 3; ++d) {
          box.lower[d] = std::min(box.lower[d], here[d]);
          box.upper[d] = std::max(box.upper[d], here[d]);
          box.at_border = box.at_border || here[d] == 0 || here[d] == volume.size[d] - 1;
        }
      }
  return box;
}

/// Moves the vertices (in voxels) towards and away from the mean of their neighbours, each within its own cell.
void relax(std::vector<Vector3>& vertices, const std::vector<std::array<int, 4>>& quads) {
  std::vector<Vector3> lower(vertices.size()), sum(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v)
    lower[v] = vertices[v].array().floor();
  std::vector<int> neighbours(vertices.size());
  for (int step = 0; step < 2 * relaxations; ++step) {
    std::fill(sum.begin(), sum.end(), Vector3::Zero());
    std::fill(neighbours.begin(), neighbours.end(), 0);
    for (const std::array<int, 4>& quad : quads)
      for (int e = 0; e < 4; ++e) {
        sum[quad[e]] += vertices[quad[(e + 1) % 4]];
        ++neighbours[quad[e]];
      }
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      if (neighbours[v] == 0)
        continue;
      const Vector3 moved = vertices[v] + (step % 2 == 0 ? forward : backward) * (sum[v] / neighbours[v] - vertices[v]);
      vertices[v] = moved.cwiseMax((lower[v].array() + off_centres).matrix())
                        .cwiseMin((lower[v].array() + (1 - off_centres)).matrix());
    }
  }
}

double enclosed_volume(const PolygonSoup& soup) {
  double volume = 0;
  const Vector3& origin = soup.vertices.front();
  for (const std::vector<int>& polygon : soup.polygons)
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
      const Vector3 a = soup.vertices[polygon[0]] - origin, b = soup.vertices[polygon[k]] - origin;
      const Vector3 c = soup.vertices[polygon[k + 1]] - origin;
      volume += a.dot(b.cross(c)) / 6;
    }
  return volume;
}

} // namespace

LabelSurface label_surface(const LabelVolume& volume, std::optional<int> label, const std::string& name) {
  const double voxel = std::abs(volume.axes.determinant());
  const auto counts = count_labels(volume);
  const std::int32_t chosen = chosen_label(counts, label, voxel, name);
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create(0);
  const VoxelBox box = fill_grid(volume, chosen, *grid);
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  tbb::task_arena one_thread(1); // the order of the vertices must not depend on the schedule
  one_thread.execute([&] { openvdb::tools::volumeToMesh(*grid, points, quads, 0.5); });

  std::vector<Vector3> vertices;
  vertices.reserve(points.size());
  for (const openvdb::Vec3s& p : points)
    vertices.emplace_back(p.x(), p.y(), p.z());
  std::vector<std::array<int, 4>> faces;
  faces.reserve(quads.size());
  for (const openvdb::Vec4I& q : quads)
    faces.push_back({static_cast<int>(q[0]), static_cast<int>(q[1]), static_cast<int>(q[2]), static_cast<int>(q[3])});
  relax(vertices, faces);

  LabelSurface surface;
  surface.soup.vertices.reserve(vertices.size());
  for (const Vector3& v : vertices)
    surface.soup.vertices.emplace_back(volume.origin + volume.axes * v);
  surface.soup.polygons.reserve(2 * faces.size());
  for (const std::array<int, 4>& f : faces) { // along the shorter diagonal
    const bool first = (surface.soup.vertices[f[0]] - surface.soup.vertices[f[2]]).squaredNorm() <=
                       (surface.soup.vertices[f[1]] - surface.soup.vertices[f[3]]).squaredNorm();
    const int turn = first ? 0 : 1;
    surface.soup.polygons.push_back({f[turn], f[1 + turn], f[2 + turn]});
    surface.soup.polygons.push_back({f[2 + turn], f[(3 + turn) % 4], f[turn]});
  }
  double enclosed = enclosed_volume(surface.soup);
  if (enclosed < 0)
    for (std::vector<int>& polygon : surface.soup.polygons)
      std::swap(polygon[1], polygon[2]);
  enclosed = std::abs(enclosed);
  const auto voxels = static_cast<double>(counts.at(chosen));
  const Vector3 step = 1e3 * volume.axes.colwise().norm();
  surface.remarks.push_back(
      fmt::format("label {}: {} voxels of {:.3g} x {:.3g} x {:.3g} mm, {:.4g} ml; its surface encloses {:.4g} ml",
                  chosen, counts.at(chosen), step.x(), step.y(), step.z(), 1e6 * voxel * voxels, 1e6 * enclosed));
  if (!volume.has_unit)
    surface.remarks.emplace_back(name + ": its header names no unit of length: millimetres are taken; organ.scale says "
                                        "otherwise");
  if (box.at_border)
    surface.remarks.push_back(
        fmt::format("label {} reaches the border of its volume: the body ends there with a flat face", chosen));
  return surface;
}

} // namespace spherecut::topology
