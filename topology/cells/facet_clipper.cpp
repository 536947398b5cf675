#include "topology/cells/facet_clipper.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace spherecut::topology {

namespace {

constexpr double no_area = 1e-14; // of a polygon, in units of the spacing squared
constexpr double nudge = 1e-6;    // of the spacing: see nudged

/// A little way for each vertex of the mesh, always the same: nodes that lie evenly on a box put planes between them
/// through its edges and corners, and what is crossed there would be told by rounding.
Vector3 nudged(int vertex) {
  std::uint64_t state = static_cast<std::uint64_t>(vertex) + 1;
  Vector3 way;
  for (int d = 0; d < 3; ++d) { // splitmix64 [Steele, Lea and Flood 2014]
    state += 0x9E3779B97F4A7C15ULL;
    std::uint64_t mixed = (state ^ state >> 30U) * 0xBF58476D1CE4E5B9ULL;
    mixed = (mixed ^ mixed >> 27U) * 0x94D049BB133111EBULL;
    way[d] = nudge * (static_cast<double>((mixed ^ mixed >> 31U) >> 11U) * 0x1p-53 - 0.5);
  }
  return way;
}

/// Where the surface runs through a polygon: the body lies to its left.
struct SectionPiece {
  std::pair<int, int> from_edge, to_edge; // of the mesh, where it comes from the triangle before and goes on
  Vector3 from, to;
  double enters = -1, leaves = -1; // place along the polygon's border (edge + share), -1: within
};

/// Clips a convex polygon to normal . x <= offset.
void clip_by_plane(const Plane& plane, std::vector<Vector3>& polygon) {
  std::vector<Vector3> kept;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vector3 &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    const double at_a = plane.signed_distance(a), at_b = plane.signed_distance(b);
    if (at_a <= 0)
      kept.push_back(a);
    if ((at_a <= 0) != (at_b <= 0))
      kept.emplace_back(a + at_a / (at_a - at_b) * (b - a));
  }
  polygon = std::move(kept);
}

/// A convex polygon with the planes through its sides.
class PolygonFrame {
 public:
  explicit PolygonFrame(const std::vector<Vector3>& polygon)
      : polygon_(polygon), normal_(measure(polygon).area.normalized()) {
    for (std::size_t k = 0; k < polygon.size(); ++k)
      inward_.push_back(normal_.cross(polygon[(k + 1) % polygon.size()] - polygon[k]));
  }
  [[nodiscard]] const Vector3& normal() const { return normal_; }
  [[nodiscard]] double height(const Vector3& x) const { return normal_.dot(x - polygon_.front()); }

  /// Cuts a piece to what lies within; false when nothing does.
  bool clip(SectionPiece& piece) const {
    double first = 0, last = 1;
    std::size_t first_side = 0, last_side = 0;
    for (std::size_t k = 0; k < polygon_.size(); ++k) {
      const double at_from = inward_[k].dot(piece.from - polygon_[k]), at_to = inward_[k].dot(piece.to - polygon_[k]);
      if (at_from < 0 && at_to < 0)
        return false;
      if (at_from < 0 && at_from / (at_from - at_to) > first) {
        first = at_from / (at_from - at_to);
        first_side = k;
      }
      if (at_to < 0 && at_from / (at_from - at_to) < last) {
        last = at_from / (at_from - at_to);
        last_side = k;
      }
    }
    if (first >= last)
      return false;
    const Vector3 from = piece.from, along = piece.to - piece.from;
    if (first > 0) {
      piece.from = from + first * along;
      piece.enters = border_place(first_side, piece.from);
    }
    if (last < 1) {
      piece.to = from + last * along;
      piece.leaves = border_place(last_side, piece.to);
    }
    return true;
  }

 private:
  [[nodiscard]] double border_place(std::size_t side, const Vector3& x) const {
    const Vector3 &a = polygon_[side], along = polygon_[(side + 1) % polygon_.size()] - a;
    const double share = along.squaredNorm() > 0 ? (x - a).dot(along) / along.squaredNorm() : 0;
    return static_cast<double>(side) + std::clamp(share, 0.0, 1.0 - 1e-12);
  }

  const std::vector<Vector3>& polygon_;
  Vector3 normal_;
  std::vector<Vector3> inward_;
};

/// Joins the pieces, and between them the border of the polygon, to loops around what lies to their left.
class LoopJoiner {
 public:
  LoopJoiner(const std::vector<Vector3>& polygon, const std::vector<SectionPiece>& pieces)
      : polygon_(polygon), pieces_(pieces), used_(pieces.size(), 0) {
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      if (pieces[p].enters >= 0)
        entries_[pieces[p].enters] = p;
      else
        after_edge_[pieces[p].from_edge] = p;
    }
  }

  std::optional<std::vector<std::vector<Vector3>>> join() {
    std::vector<std::vector<Vector3>> loops;
    for (std::size_t p = 0; p < pieces_.size(); ++p)
      if (used_[p] == 0) {
        loops.emplace_back();
        if (!follow(p, loops.back()))
          return std::nullopt;
      }
    return loops;
  }
  [[nodiscard]] bool meets_border() const { return !entries_.empty(); }

 private:
  bool follow(std::size_t start, std::vector<Vector3>& loop) {
    std::size_t p = start;
    do {
      if (used_[p] != 0)
        return false;
      used_[p] = 1;
      const SectionPiece& piece = pieces_[p];
      loop.push_back(piece.from);
      if (piece.leaves < 0) {
        const auto next = after_edge_.find(piece.to_edge);
        if (next == after_edge_.end())
          return false;
        p = next->second;
        continue;
      }
      loop.push_back(piece.to);
      if (entries_.empty())
        return false;
      auto next = entries_.upper_bound(piece.leaves);
      const bool wraps = next == entries_.end();
      if (wraps)
        next = entries_.begin();
      const auto corners = static_cast<int>(polygon_.size());
      const int first = static_cast<int>(std::floor(piece.leaves)) + 1;
      const int last = static_cast<int>(std::floor(next->first)) + (wraps ? corners : 0);
      for (int k = first; k <= last; ++k)
        loop.push_back(polygon_[static_cast<std::size_t>(k % corners)]);
      p = next->second;
    } while (p != start);
    return true;
  }

  const std::vector<Vector3>& polygon_;
  const std::vector<SectionPiece>& pieces_;
  std::vector<char> used_;
  std::map<double, std::size_t> entries_;                 // by their place along the border
  std::map<std::pair<int, int>, std::size_t> after_edge_; // pieces that start at that edge of the mesh
};

} // namespace

FacetClipper::FacetClipper(const SurfaceFacets& facets, const Vector3& node, double spacing,
                           const std::vector<Vector3>& corners) {
  BoundingBox box{node, node};
  for (const Vector3& corner : corners) {
    box.lower = box.lower.cwiseMin(node + spacing * corner);
    box.upper = box.upper.cwiseMax(node + spacing * corner);
  }
  const SurfaceMesh& mesh = facets.mesh();
  for (const int t : facets.near(box)) {
    Facet& facet = facets_.emplace_back();
    facet.vertices = mesh.triangles[static_cast<std::size_t>(t)];
    for (int k = 0; k < 3; ++k)
      facet.corners[k] = (mesh.vertices[facet.vertices[k]] - node) / spacing + nudged(facet.vertices[k]);
    facet.piece = facets.piece(t);
  }
}

std::optional<std::vector<std::vector<Vector3>>> FacetClipper::inside(const std::vector<Vector3>& polygon,
                                                                      bool is_inside) const {
  const PolygonFrame frame(polygon);
  std::vector<SectionPiece> pieces;
  for (const Facet& facet : facets_) {
    std::array<double, 3> height{};
    for (int k = 0; k < 3; ++k)
      height[k] = frame.height(facet.corners[k]);
    // A corner on the plane counts as above it: then every triangle is crossed in two of its edges or not at all.
    if ((height[0] >= 0) == (height[1] >= 0) && (height[1] >= 0) == (height[2] >= 0))
      continue;
    SectionPiece piece;
    for (int k = 0; k < 3; ++k) {
      const int a = k, b = (k + 1) % 3;
      if ((height[a] >= 0) == (height[b] >= 0))
        continue;
      // The same point from both triangles of the edge.
      const bool in_order = facet.vertices[a] < facet.vertices[b];
      const int low = in_order ? a : b, high = in_order ? b : a;
      const Vector3 x =
          facet.corners[low] + height[low] / (height[low] - height[high]) * (facet.corners[high] - facet.corners[low]);
      const std::pair<int, int> edge(facet.vertices[low], facet.vertices[high]);
      // Around a triangle that is seen from without, from where it goes down through the plane to where it comes up
      // again: the body lies to the left, seen against the polygon's normal.
      if (height[a] >= 0) {
        piece.from = x;
        piece.from_edge = edge;
      } else {
        piece.to = x;
        piece.to_edge = edge;
      }
    }
    if (frame.clip(piece))
      pieces.push_back(piece);
  }
  LoopJoiner joiner(polygon, pieces);
  auto loops = joiner.join();
  if (loops && !joiner.meets_border() && is_inside)
    loops->push_back(polygon);
  return loops;
}

std::vector<FacetPatch> FacetClipper::within(const std::vector<Plane>& planes) const {
  std::vector<FacetPatch> patches;
  for (const Facet& facet : facets_) {
    std::vector<Vector3> part(facet.corners.begin(), facet.corners.end());
    for (const Plane& plane : planes) {
      clip_by_plane(plane, part);
      if (part.size() < 3)
        break;
    }
    if (part.size() < 3)
      continue;
    const PolygonMeasure face = measure(part);
    const double size = face.area.norm();
    if (size < no_area)
      continue;
    auto patch = std::find_if(patches.begin(), patches.end(),
                              [&](const FacetPatch& known) { return known.piece == facet.piece; });
    if (patch == patches.end())
      patch = patches.insert(patches.end(), FacetPatch{facet.piece, Vector3::Zero(), Vector3::Zero(), 0});
    patch->area += face.area;
    patch->centroid += size * face.centroid;
    patch->size += size;
  }
  for (FacetPatch& patch : patches)
    patch.centroid /= patch.size;
  return patches;
}

} // namespace spherecut::topology
