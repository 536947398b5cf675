#include "topology/wound/wound.hpp"

#include "topology/base/errors.hpp"
#include "topology/wound/assembly.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <exception>
#include <fmt/format.h>
#include <map>
#include <unordered_map>
#include <utility>

namespace spherecut::topology {

namespace {

void require_sound(const SurfaceMesh& mesh, const std::string& name) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      throw InputError(fmt::format("{}: vertex {} is not finite", name, v));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int v : mesh.triangles[t])
      if (v < 0 || v >= std::ssize(mesh.vertices))
        throw InputError(fmt::format("{}: triangle {} uses vertex {} of {}", name, t, v, mesh.vertices.size()));
}

std::array<Vector3, 3> corners_of(const SurfaceMesh& mesh, std::size_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  return {mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]};
}

} // namespace

struct IncrementalWound::Data {
  SurfaceMesh organ;
  WoundOptions options;
  std::vector<std::vector<std::array<Vector3, 3>>> sheets; // corners of all triangles so far
  std::unique_ptr<WoundAssembly> assembly;

  /// The wound of the sheets so far, from scratch.
  void rebuild() {
    assembly = std::make_unique<WoundAssembly>(organ, options);
    std::vector<std::array<Vector3, 3>> triangles;
    std::vector<int> sheet_of, triangle_of;
    for (int s = 0; s < std::ssize(sheets); ++s)
      for (int t = 0; t < std::ssize(sheets[s]); ++t) {
        triangles.push_back(sheets[s][t]);
        sheet_of.push_back(s);
        triangle_of.push_back(t);
      }
    assembly->add(triangles, sheet_of, triangle_of);
  }
};

IncrementalWound::IncrementalWound(const SurfaceMesh& organ, const WoundOptions& options)
    : data_(std::make_unique<Data>()) {
  require_sound(organ, "organ");
  if (const auto defect = manifold_defect(organ))
    throw InputError("organ: a surface to cut must be closed and manifold; " + *defect);
  if (!(volume(organ) > 0))
    throw InputError(fmt::format("organ: volume = {} m3: a surface to cut must be outward", volume(organ)));
  data_->organ = organ;
  data_->options = options;
  data_->rebuild();
}

IncrementalWound::~IncrementalWound() = default;
IncrementalWound::IncrementalWound(IncrementalWound&&) noexcept = default;
IncrementalWound& IncrementalWound::operator=(IncrementalWound&&) noexcept = default;

const Wound& IncrementalWound::wound() const {
  return data_->assembly->wound();
}

IncrementalWound::Growth IncrementalWound::grow(const std::vector<SurfaceMesh>& sheets) {
  Data& d = *data_;
  if (sheets.size() < d.sheets.size())
    throw InputError(fmt::format("{} sheets: there were {} before", sheets.size(), d.sheets.size()));
  std::vector<std::array<Vector3, 3>> fresh;
  std::vector<int> sheet_of, triangle_of;
  for (std::size_t s = 0; s < sheets.size(); ++s) {
    const std::string name = fmt::format("sheet {}", s);
    require_sound(sheets[s], name);
    const std::size_t before = s < d.sheets.size() ? d.sheets[s].size() : 0;
    if (sheets[s].triangles.size() < before)
      throw InputError(
          fmt::format("{}: {} triangles, fewer than the {} before", name, sheets[s].triangles.size(), before));
    for (std::size_t t = 0; t < sheets[s].triangles.size(); ++t) {
      const std::array<Vector3, 3> corners = corners_of(sheets[s], t);
      if (t < before) {
        if (corners != d.sheets[s][t])
          throw InputError(fmt::format("{}: triangle {} is not where it was", name, t));
        continue;
      }
      fresh.push_back(corners);
      sheet_of.push_back(static_cast<int>(s));
      triangle_of.push_back(static_cast<int>(t));
    }
  }
  Growth growth;
  try {
    growth = d.assembly->add(fresh, sheet_of, triangle_of);
  } catch (const std::exception& error) {
    d.rebuild();
    throw InputError(std::string("this cut is refused: ") + error.what());
  }
  d.sheets.resize(sheets.size());
  for (std::size_t k = 0; k < fresh.size(); ++k)
    d.sheets[sheet_of[k]].push_back(fresh[k]);
  return growth;
}

Wound cut_surface(const SurfaceMesh& organ, const std::vector<SurfaceMesh>& sheets, const WoundOptions& options) {
  IncrementalWound wound(organ, options);
  wound.grow(sheets);
  return wound.wound();
}

std::vector<LipPair> lip_pairs(const Wound& wound) {
  // Facing walls are cut alike: their triangles have the same three points.
  const auto key = [&](const Triangle& t) {
    Triangle points{wound.point[t[0]], wound.point[t[1]], wound.point[t[2]]};
    std::sort(points.begin(), points.end());
    return points;
  };
  std::map<Triangle, int> minus_walls;
  for (int t = 0; t < std::ssize(wound.part); ++t)
    if (wound.part[t] == WoundPart::wall_minus)
      minus_walls.emplace(key(wound.surface.triangles[t]), t);
  std::vector<std::pair<int, int>> pairs;
  for (int t = 0; t < std::ssize(wound.part); ++t) {
    if (wound.part[t] != WoundPart::wall_plus)
      continue;
    const Triangle& plus = wound.surface.triangles[t];
    const auto found = minus_walls.find(key(plus));
    if (found == minus_walls.end())
      continue;
    for (const int p : plus)
      for (const int m : wound.surface.triangles[found->second])
        if (p != m && wound.point[p] == wound.point[m])
          pairs.emplace_back(p, m);
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  std::vector<LipPair> result;
  result.reserve(pairs.size());
  for (const auto& [plus, minus] : pairs)
    result.push_back({plus, minus});
  return result;
}

std::uint64_t surface_hash(const SurfaceMesh& surface) {
  const auto mix = [](std::uint64_t hash, std::uint64_t value) {
    hash = (hash ^ value) * 0x9E3779B97F4A7C15ULL;
    return hash ^ (hash >> 32);
  };
  std::uint64_t sum = 0; // over triangles: their order does not matter
  for (const Triangle& t : surface.triangles) {
    std::array<std::uint64_t, 3> corner{};
    for (int c = 0; c < 3; ++c)
      for (int axis = 0; axis < 3; ++axis)
        corner[c] = mix(corner[c], std::bit_cast<std::uint64_t>(surface.vertices[t[c]][axis] + 0.0));
    // The least rotation: two corners can lie at one place.
    std::array<std::uint64_t, 3> least = corner;
    for (int turn = 0; turn < 2; ++turn) {
      std::rotate(corner.begin(), corner.begin() + 1, corner.end());
      least = std::min(least, corner);
    }
    sum += mix(mix(mix(1, least[0]), least[1]), least[2]);
  }
  return sum;
}

std::optional<std::string> manifold_defect(const SurfaceMesh& surface) {
  const auto key = [](int a, int b) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32) | static_cast<std::uint32_t>(b);
  };
  std::unordered_map<std::uint64_t, int> after; // half-edge -> third corner of its triangle
  after.reserve(3 * surface.triangles.size());
  std::vector<int> degree(surface.vertices.size(), 0), next(surface.vertices.size(), -1);
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (int e = 0; e < 3; ++e) {
      const Triangle& triangle = surface.triangles[t];
      const int u = triangle[e], v = triangle[(e + 1) % 3];
      if (u == v)
        return fmt::format("triangle {} uses vertex {} twice", t, u);
      if (!after.emplace(key(u, v), triangle[(e + 2) % 3]).second)
        return fmt::format("two triangles run from vertex {} to vertex {}", u, v);
      ++degree[u];
      next[u] = v;
    }
  for (const auto& [half_edge, third] : after) {
    const int u = static_cast<int>(half_edge >> 32), v = static_cast<int>(half_edge & 0xFFFFFFFFU);
    if (!after.contains(key(v, u)))
      return fmt::format("the edge of vertices {} and {} is open", u, v);
  }
  for (int v = 0; v < std::ssize(surface.vertices); ++v) {
    if (degree[v] == 0)
      return fmt::format("vertex {} is unused", v);
    int turned = 0, at = next[v];
    do {
      at = after.at(key(v, at));
      ++turned;
    } while (at != next[v] && turned <= degree[v]);
    if (turned != degree[v])
      return fmt::format("sheets touch at vertex {}", v);
  }
  return std::nullopt;
}

} // namespace spherecut::topology
