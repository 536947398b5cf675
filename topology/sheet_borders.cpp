#include "topology/sheet_borders.hpp"

#include "topology/half_edges.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::topology {

const SheetBorders::Border& SheetBorders::of(const SurfaceMesh& sheet, int id) {
  borders_.resize(std::max(borders_.size(), static_cast<std::size_t>(id) + 1));
  Border& border = borders_[static_cast<std::size_t>(id)];
  if (border.triangles == sheet.triangles.size() && border.next.size() == sheet.vertices.size())
    return border;
  border.triangles = sheet.triangles.size();
  border.next.assign(sheet.vertices.size(), -1);
  border.previous.assign(sheet.vertices.size(), -1);
  const HalfEdges edges(sheet);
  for (const Triangle& t : sheet.triangles)
    for (int e = 0; e < 3; ++e)
      if (const int from = t[e], to = t[(e + 1) % 3]; edges.triangle(to, from) < 0) {
        border.next[from] = to;
        border.previous[to] = from;
      }
  return border;
}

int SheetBorders::nearest(const SurfaceMesh& sheet, int id, const Vector3& x, double off, double reach) {
  const Border& border = of(sheet, id);
  int found = -1;
  double least = off * off;
  for (int v = 0; v < std::ssize(border.next); ++v) {
    const int w = border.next[v];
    if (w < 0)
      continue;
    const Vector3 from = sheet.vertices[v], along = sheet.vertices[w] - from;
    const double s = std::clamp((x - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
    if (const double squared = (from + s * along - x).squaredNorm(); squared <= least) {
      least = squared;
      found = s < 0.5 ? v : w;
    }
  }
  return found >= 0 && (sheet.vertices[found] - x).norm() <= reach ? found : -1;
}

std::optional<std::vector<int>> SheetBorders::between(const SurfaceMesh& sheet, int id, int from, int to,
                                                      double longest) {
  const Border& border = of(sheet, id);
  std::optional<std::vector<int>> shortest;
  for (const std::vector<int>* step : {&border.next, &border.previous}) {
    std::vector<int> way;
    double length = 0;
    for (int v = from; v != to && v >= 0 && length <= longest;) {
      const int w = (*step)[v];
      if (w >= 0)
        length += (sheet.vertices[w] - sheet.vertices[v]).norm();
      if (w >= 0 && w != to)
        way.push_back(w);
      v = w;
      if (v == to && length <= longest) {
        longest = length;
        shortest = way;
      }
    }
    if (from == to)
      shortest.emplace();
  }
  return shortest;
}

} // namespace spherecut::topology
