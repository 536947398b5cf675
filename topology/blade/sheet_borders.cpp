#include "topology/blade/sheet_borders.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::topology {

namespace {

// The vertex of the border after one, or before it; -1: it lies inside the sheet.
int neighbour(const SweptSheets& sheets, const SheetVertex& at, bool on) {
  for (const int t : sheets.around(at.sheet, at.vertex)) {
    const Triangle& triangle = sheets.sheets()[at.sheet].triangles[t];
    const auto c = std::find(triangle.begin(), triangle.end(), at.vertex) - triangle.begin();
    const int other = triangle[static_cast<std::size_t>(on ? c + 1 : c + 2) % 3];
    if (sheets.is_border(at.sheet, at.vertex, other))
      return other;
  }
  return -1;
}

struct Step {
  int vertex;
  double length; // m, from the start
};

// Along the border from a vertex on, or back, as far as `longest`; the vertex first.
std::vector<Step> steps(const SweptSheets& sheets, const SheetVertex& from, bool on, double longest) {
  const std::vector<Vector3>& places = sheets.sheets()[from.sheet].vertices;
  std::vector<Step> found{{from.vertex, 0}};
  for (int v = neighbour(sheets, from, on); v >= 0 && v != from.vertex; v = neighbour(sheets, {from.sheet, v}, on)) {
    const double length = found.back().length + (places[v] - places[found.back().vertex]).norm();
    if (length > longest)
      break;
    found.push_back({v, length});
  }
  return found;
}

} // namespace

int nearest_on_border(const SweptSheets& sheets, int sheet, const Vector3& x, double off, double reach) {
  const SurfaceMesh& mesh = sheets.sheets()[sheet];
  std::vector<int> triangles;
  sheets.near(sheet, x, off, triangles);
  int nearest = -1;
  double least = off * off;
  for (const int t : triangles)
    for (std::size_t e = 0; e < 3; ++e) {
      const int v = mesh.triangles[t][e], w = mesh.triangles[t][(e + 1) % 3];
      const Vector3 from = mesh.vertices[v], along = mesh.vertices[w] - from;
      const double s = std::clamp((x - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
      const double squared = (from + s * along - x).squaredNorm();
      if (squared > least || !sheets.is_border(sheet, v, w))
        continue;
      least = squared;
      nearest = s < 0.5 ? v : w;
    }
  return nearest >= 0 && (mesh.vertices[nearest] - x).norm() <= reach ? nearest : -1;
}

std::vector<SheetVertex> way_along_borders(const SweptSheets& sheets, const SheetVertex& from, const SheetVertex& to,
                                           double longest) {
  const SurfaceMesh &first = sheets.sheets()[from.sheet], &second = sheets.sheets()[to.sheet];
  const bool is_one = from.sheet == to.sheet;
  std::vector<SheetVertex> shortest;
  for (const bool on : {true, false}) {
    const std::vector<Step> there = steps(sheets, from, on, longest);
    for (const bool back : {true, false}) {
      const std::vector<Step> here = is_one ? std::vector<Step>{{to.vertex, 0}} : steps(sheets, to, back, longest);
      for (std::size_t i = 0; i < there.size(); ++i)
        for (std::size_t k = 0; k < here.size(); ++k) {
          const double length = there[i].length + here[k].length;
          const bool meet = is_one ? there[i].vertex == here[k].vertex
                                   : first.vertices[there[i].vertex] == second.vertices[here[k].vertex];
          if (!meet || length > longest || (length == longest && !shortest.empty()))
            continue;
          longest = length;
          shortest.clear();
          for (std::size_t p = 0; p <= i; ++p)
            shortest.push_back({from.sheet, there[p].vertex});
          for (std::size_t p = is_one ? k : k + 1; p-- > 0;)
            shortest.push_back({to.sheet, here[p].vertex});
        }
    }
  }
  return shortest;
}

} // namespace spherecut::topology
