#include "src/live/shown_opening.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <unordered_map>

namespace spherecut::app {

ShownOpening shown_opening(const ViewerTopology& surface, const std::vector<Eigen::Vector3f>& deformed) {
  ShownOpening result;
  const auto rest = [&](int vertex) -> Vector3 {
    return surface.vertices[static_cast<std::size_t>(vertex)].cast<double>();
  };
  const auto moved = [&](int vertex) -> Vector3 {
    return deformed[static_cast<std::size_t>(vertex)].cast<double>() - rest(vertex);
  };
  std::unordered_map<int, Vector3> outward; // from the material on the + side: against the normal of the sheet
  for (std::size_t t = 0; t < surface.parts.size(); ++t) {
    if (surface.parts[t] == topology::WoundPart::organ)
      continue;
    const auto& [a, b, c] = surface.triangles[t];
    const Vector3 area = 0.5 * (rest(b) - rest(a)).cross(rest(c) - rest(a));
    result.volume -= (moved(a) + moved(b) + moved(c)).dot(area) / 3; // outward is into the cut
    if (surface.parts[t] != topology::WoundPart::wall_plus)
      continue;
    for (const int vertex : {a, b, c})
      outward.try_emplace(vertex, Vector3::Zero()).first->second += area;
  }
  for (const auto& [plus, minus] : surface.lip_pairs)
    if (const auto found = outward.find(plus); found != outward.end() && found->second.norm() > 0)
      result.largest = std::max(result.largest, -found->second.normalized().dot(moved(plus) - moved(minus)));
  return result;
}

} // namespace spherecut::app
