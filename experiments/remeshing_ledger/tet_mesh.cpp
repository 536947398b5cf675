#include "experiments/remeshing_ledger/tet_mesh.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <numeric>
#include <unordered_map>

namespace spherecut::experiments::ledger {

namespace {

constexpr std::array<std::array<int, 3>, 4> face_of{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}}; // outward

/// Corners of cut faces around which the material above and below is joined by tetrahedra that share whole faces: the
/// front, where the tetrahedra ahead of it cross the plane.
std::vector<char> joined_ahead(const TetMesh& mesh, const std::vector<TetFace>& faces,
                               std::vector<std::array<int, 3>> cut_faces, const std::vector<char>& on_cut,
                               const std::function<bool(const std::array<int, 4>&)>& is_above) {
  std::sort(cut_faces.begin(), cut_faces.end());
  // Components of the tetrahedra about every corner, by union of those beside a face that is not cut.
  std::unordered_map<std::uint64_t, std::uint64_t> parent;
  const auto key = [](int v, int t) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)) << 32) | static_cast<std::uint32_t>(t);
  };
  const auto root = [&](std::uint64_t x) {
    while (parent.at(x) != x)
      x = parent.at(x);
    return x;
  };
  for (int t = 0; t < std::ssize(mesh.tets); ++t)
    for (int v : mesh.tets[t])
      if (on_cut[v] != 0)
        parent.emplace(key(v, t), key(v, t));
  for (std::size_t i = 0; i + 1 < faces.size(); ++i) {
    if (faces[i + 1].key != faces[i].key)
      continue;
    for (int v : faces[i].key)
      if (on_cut[v] != 0 && !std::binary_search(cut_faces.begin(), cut_faces.end(), faces[i].key)) {
        const std::uint64_t a = root(key(v, faces[i].tet)), b = root(key(v, faces[i + 1].tet));
        parent[std::max(a, b)] = std::min(a, b);
      }
    ++i;
  }
  std::unordered_map<std::uint64_t, char> sides;
  for (const auto& entry : parent)
    sides[root(entry.first)] |= is_above(mesh.tets[static_cast<std::uint32_t>(entry.first)]) ? 1 : 2;
  std::vector<char> joined(on_cut.size(), 0);
  for (const auto& [component, both] : sides)
    if (both == 3)
      joined[component >> 32] = 1;
  return joined;
}

} // namespace

std::vector<TetFace> sorted_faces(const std::vector<std::array<int, 4>>& tets) {
  std::vector<TetFace> faces;
  faces.reserve(4 * tets.size());
  for (int t = 0; t < std::ssize(tets); ++t)
    for (int f = 0; f < 4; ++f) {
      std::array<int, 3> key;
      for (int k = 0; k < 3; ++k)
        key[k] = tets[t][face_of[f][k]];
      std::sort(key.begin(), key.end());
      faces.push_back({key, t, f});
    }
  std::sort(faces.begin(), faces.end(),
            [](const TetFace& a, const TetFace& b) { return a.key != b.key ? a.key < b.key : a.tet < b.tet; });
  return faces;
}

double six_volumes(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  return (b - a).cross(c - a).dot(d - a);
}

double shape_quality(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  const double volume = six_volumes(a, b, c, d) / 6;
  const double edges = (b - a).squaredNorm() + (c - a).squaredNorm() + (d - a).squaredNorm() + (c - b).squaredNorm() +
                       (d - b).squaredNorm() + (d - c).squaredNorm();
  return volume <= 0 ? 0 : 12 * std::pow(3 * volume, 2.0 / 3) / edges;
}

double smallest_quality(const std::vector<Vector3>& vertices, const std::vector<std::array<int, 4>>& tets) {
  double least = 1;
  for (const auto& t : tets)
    least = std::min(least, shape_quality(vertices[t[0]], vertices[t[1]], vertices[t[2]], vertices[t[3]]));
  return least;
}

CutMesh uncut(const TetMesh& mesh) {
  CutMesh whole;
  whole.vertices = mesh.vertices;
  whole.tets = mesh.tets;
  whole.original.resize(mesh.vertices.size());
  std::iota(whole.original.begin(), whole.original.end(), 0);
  whole.front.assign(mesh.vertices.size(), 0);
  whole.skin = whole.front;
  const std::vector<TetFace> faces = sorted_faces(mesh.tets);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (i + 1 < faces.size() && faces[i + 1].key == faces[i].key) {
      ++i;
      continue;
    }
    const auto& t = mesh.tets[faces[i].tet];
    const auto& f = face_of[faces[i].face];
    whole.surface.push_back({t[f[0]], t[f[1]], t[f[2]]});
    for (int k : f)
      whole.skin[t[k]] = 1;
  }
  return whole;
}

CutMesh part(const TetMesh& mesh, const Scenario& scenario, int increment, double tolerance) {
  const std::size_t count = mesh.vertices.size();
  const std::vector<Vector2> outline = scenario.outline(increment);
  std::vector<char> in_plane(count, 0);
  for (std::size_t i = 0; i < count; ++i)
    in_plane[i] = std::abs(scenario.height(mesh.vertices[i])) < tolerance ? 1 : 0;
  const auto is_above = [&](const std::array<int, 4>& t) {
    double sum = 0;
    for (int v : t)
      sum += in_plane[v] != 0 ? 0 : scenario.height(mesh.vertices[v]);
    return sum > 0;
  };
  const std::vector<TetFace> faces = sorted_faces(mesh.tets);
  CutMesh cut;
  cut.vertices = mesh.vertices;
  cut.tets = mesh.tets;
  cut.original.resize(count);
  for (std::size_t i = 0; i < count; ++i)
    cut.original[i] = static_cast<int>(i);
  std::vector<char> on_cut(count, 0), on_whole(count, 0);
  std::vector<std::array<int, 3>> cut_faces;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const bool paired = i + 1 < faces.size() && faces[i + 1].key == faces[i].key;
    if (!paired) {
      const auto& t = mesh.tets[faces[i].tet];
      const auto& f = face_of[faces[i].face];
      cut.surface.push_back({t[f[0]], t[f[1]], t[f[2]]});
      continue;
    }
    const std::array<int, 3>& key = faces[i].key;
    if (in_plane[key[0]] != 0 && in_plane[key[1]] != 0 && in_plane[key[2]] != 0 &&
        is_above(mesh.tets[faces[i].tet]) != is_above(mesh.tets[faces[i + 1].tet])) {
      const Vector3 centre = (mesh.vertices[key[0]] + mesh.vertices[key[1]] + mesh.vertices[key[2]]) / 3;
      const bool is_cut = inside(outline, scenario.in_plane(centre));
      for (int v : key)
        (is_cut ? on_cut : on_whole)[v] = 1;
      if (is_cut)
        cut_faces.push_back(key);
    }
    ++i;
  }
  if (cut_faces.empty())
    throw NumericalError(fmt::format("no face of {} tetrahedra lies on the cut", mesh.tets.size()));
  // Behind the front the copy below is new.
  std::vector<int> below(count);
  const std::vector<char> joined = joined_ahead(mesh, faces, cut_faces, on_cut, is_above);
  for (std::size_t i = 0; i < count; ++i) {
    below[i] = static_cast<int>(i);
    if (on_cut[i] != 0 && on_whole[i] == 0 && joined[i] == 0) {
      below[i] = static_cast<int>(cut.vertices.size());
      cut.vertices.push_back(mesh.vertices[i]);
      cut.original.push_back(static_cast<int>(i));
    }
  }
  cut.front.assign(cut.vertices.size(), 0);
  for (std::size_t i = 0; i < count; ++i)
    cut.front[i] = on_cut[i] != 0 && (on_whole[i] != 0 || joined[i] != 0) ? 1 : 0;
  std::vector<char> tet_above(mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    tet_above[t] = is_above(mesh.tets[t]) ? 1 : 0;
    if (tet_above[t] == 0)
      for (int& v : cut.tets[t])
        v = below[v];
  }
  for (const auto& key : cut_faces)
    cut.faces.push_back({key, {below[key[0]], below[key[1]], below[key[2]]}});
  for (Triangle& t : cut.surface) {
    double sum = 0;
    for (int v : t)
      sum += in_plane[v] != 0 ? 0 : scenario.height(mesh.vertices[v]);
    if (sum < 0)
      for (int& v : t)
        v = below[v];
  }
  cut.skin.assign(cut.vertices.size(), 0);
  for (const Triangle& t : cut.surface)
    for (int v : t)
      cut.skin[v] = 1;
  return cut;
}

} // namespace spherecut::experiments::ledger
