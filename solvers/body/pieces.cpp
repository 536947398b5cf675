#include "solvers/body/pieces.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace spherecut::solvers {

std::vector<Piece> find_pieces(const Problem& problem, const std::vector<int>& start,
                               const std::vector<int>& neighbours) {
  const int count = problem.nodes.size();
  std::vector<int> piece_of(count, -1), pending;
  int count_of_pieces = 0;
  for (int first = 0; first < count; ++first) {
    if (piece_of[first] >= 0)
      continue;
    const int id = count_of_pieces++;
    piece_of[first] = id;
    pending.push_back(first);
    while (!pending.empty()) {
      const int i = pending.back();
      pending.pop_back();
      for (int slot = start[i]; slot < start[i + 1]; ++slot)
        if (piece_of[neighbours[slot]] < 0) {
          piece_of[neighbours[slot]] = id;
          pending.push_back(neighbours[slot]);
        }
    }
  }
  std::vector<Piece> pieces(static_cast<std::size_t>(count_of_pieces));
  for (int i = 0; i < count; ++i) {
    pieces[piece_of[i]].nodes.push_back(i);
    pieces[piece_of[i]].centroid += problem.nodes.positions[i];
  }
  for (Piece& piece : pieces)
    piece.centroid /= static_cast<double>(piece.nodes.size());
  for (const Prescribed& entry : problem.prescribed)
    if (entry.components[0] || entry.components[1] || entry.components[2])
      pieces[piece_of[entry.node]].held = true;
  return pieces;
}

void require_held(const std::vector<Piece>& pieces) {
  for (const Piece& piece : pieces)
    if (!piece.held)
      throw InputError(
          fmt::format("the cut leaves {} pieces, and nothing holds the one of {} nodes about ({:.6g}, {:.6g}, {:.6g}) "
                      "m (its first node is {}): hold it by a prescribed displacement, or ask for 'hold' or 'drop'",
                      pieces.size(), piece.nodes.size(), piece.centroid.x(), piece.centroid.y(), piece.centroid.z(),
                      piece.nodes.front()));
}

std::array<Anchor, 6> anchors_of(const Piece& piece, const NodeCloud& nodes) {
  const auto farthest = [&](const auto& measure) {
    int best = piece.nodes.front();
    for (int node : piece.nodes)
      if (measure(nodes.positions[node]) > measure(nodes.positions[best]))
        best = node;
    return best;
  };
  const int a = farthest([&](const Vector3& x) { return (x - piece.centroid).squaredNorm(); });
  const Vector3 at_a = nodes.positions[a];
  const int b = farthest([&](const Vector3& x) { return (x - at_a).squaredNorm(); });
  const Vector3 along = (nodes.positions[b] - at_a).normalized();
  const int c = farthest([&](const Vector3& x) { return along.cross(x - at_a).squaredNorm(); });
  const Vector3 normal = along.cross(nodes.positions[c] - at_a);
  if (!(normal.norm() > 1e-6 * (nodes.positions[b] - at_a).norm()))
    throw InputError(fmt::format("a piece of {} nodes about ({:.6g}, {:.6g}, {:.6g}) m cannot be held: its nodes lie "
                                 "on one line",
                                 piece.nodes.size(), piece.centroid.x(), piece.centroid.y(), piece.centroid.z()));
  const Vector3 up = normal.normalized(), across = up.cross(along);
  return {Anchor{a, along}, Anchor{a, across}, Anchor{a, up}, Anchor{b, across}, Anchor{b, up}, Anchor{c, up}};
}

} // namespace spherecut::solvers
