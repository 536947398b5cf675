#include "topology/wound/splinters.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>

namespace spherecut::topology {
namespace {

// Where the elements that are kept come to; -1: left out.
std::vector<int> places_of(const std::vector<char>& kept) {
  std::vector<int> places(kept.size(), -1);
  int next = 0;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i] != 0)
      places[i] = next++;
  return places;
}

template <class T>
std::vector<T> kept_of(const std::vector<T>& values, const std::vector<char>& kept) {
  std::vector<T> result;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (kept[i] != 0)
      result.push_back(values[i]);
  return result;
}

} // namespace

std::vector<PieceShape> piece_shapes(const Wound& wound) {
  std::vector<PieceShape> shapes(wound.pieces.size());
  std::vector<double> areas(wound.pieces.size(), 0);
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    const Triangle& triangle = wound.surface.triangles[t];
    const Vector3& a = wound.surface.vertices[triangle[0]];
    const Vector3& b = wound.surface.vertices[triangle[1]];
    const Vector3& c = wound.surface.vertices[triangle[2]];
    const auto piece = static_cast<std::size_t>(wound.piece_of(static_cast<int>(t)));
    const double area = 0.5 * (b - a).cross(c - a).norm();
    areas[piece] += area;
    shapes[piece].middle += area / 3 * (a + b + c);
  }
  for (std::size_t p = 0; p < shapes.size(); ++p)
    if (areas[p] > 0) {
      shapes[p].middle /= areas[p];
      shapes[p].size = 6 * wound.pieces[p].volume / areas[p];
    }
  return shapes;
}

std::optional<Wound> without_splinters(const Wound& wound, double thinnest) {
  if (wound.pieces.size() < 2)
    return std::nullopt;
  const std::vector<PieceShape> shapes = piece_shapes(wound);
  const auto largest = std::max_element(shapes.begin(), shapes.end(),
                                        [](const PieceShape& a, const PieceShape& b) { return a.size < b.size; });
  std::vector<char> pieces;
  pieces.reserve(shapes.size());
  for (const PieceShape& shape : shapes)
    pieces.push_back(shape.size >= std::min(thinnest, largest->size) ? 1 : 0);
  if (std::find(pieces.begin(), pieces.end(), 0) == pieces.end())
    return std::nullopt;
  std::vector<char> components;
  components.reserve(wound.components.size());
  for (const WoundComponent& component : wound.components)
    components.push_back(pieces[static_cast<std::size_t>(component.piece)]);
  std::vector<char> triangles;
  triangles.reserve(wound.surface.triangles.size());
  std::vector<char> vertices(wound.surface.vertices.size(), 0);
  for (std::size_t t = 0; t < wound.surface.triangles.size(); ++t) {
    triangles.push_back(components[static_cast<std::size_t>(wound.component[t])]);
    for (const int vertex : wound.surface.triangles[t])
      vertices[static_cast<std::size_t>(vertex)] |= triangles[t];
  }
  const std::vector<int> piece_places = places_of(pieces);
  const std::vector<int> component_places = places_of(components);
  const std::vector<int> vertex_places = places_of(vertices);
  Wound left{.surface = {.vertices = kept_of(wound.surface.vertices, vertices),
                         .triangles = kept_of(wound.surface.triangles, triangles)},
             .part = kept_of(wound.part, triangles),
             .sheet = kept_of(wound.sheet, triangles),
             .source_triangle = kept_of(wound.source_triangle, triangles),
             .component = kept_of(wound.component, triangles),
             .point = kept_of(wound.point, vertices),
             .evaluation = kept_of(wound.evaluation, vertices),
             .components = kept_of(wound.components, components),
             .pieces = kept_of(wound.pieces, pieces)};
  for (Triangle& triangle : left.surface.triangles)
    for (int& vertex : triangle)
      vertex = vertex_places[static_cast<std::size_t>(vertex)];
  for (int& component : left.component)
    component = component_places[static_cast<std::size_t>(component)];
  for (WoundComponent& component : left.components)
    component.piece = piece_places[static_cast<std::size_t>(component.piece)];
  return left;
}

} // namespace spherecut::topology
