// Flat arrays over a surface at rest for queries that must neither allocate, lock nor throw: a walk from triangle to
// triangle, certified by a tree of boxes.
//
// The walk alone [Ho, Basdogan and Srinivasan 1999] stops in the first local minimum of the distance. Its result is
// therefore used as an upper bound: every box of the tree that might hold something nearer is opened, so that the
// answer is the global minimum whatever the surface. After a small motion the bound is tight and few boxes are opened.
#pragma once

#include "topology/search/proximity.hpp"
#include "topology/surface/mesh.hpp"

#include <limits>
#include <span>

namespace spherecut::topology {

/// The surface point nearest to some x.
struct WalkPoint {
  Vector3 point = Vector3::Zero();  // m
  Vector3 normal = Vector3::Zero(); // unit angle-weighted pseudonormal there [Baerentzen and Aanaes 2005]
  double signed_distance = 0;       // m, of x; negative inside
  int triangle = -1;                // internal index, see SurfaceWalk::original
};

/// The surface point nearest to a segment.
struct NearestToSegment {
  double distance = 0; // m; zero where the segment crosses the surface
  double along = 0;    // 0..1 on the segment
  int triangle = -1;   // internal index; -1: nothing nearer than asked for
};

/// The crossing of a segment and the surface farthest from the segment's start.
struct LastCrossing {
  double along = 0;    // 0..1 on the segment
  int triangle = -1;   // internal index; -1: no crossing
  bool leaves = false; // whether the segment leaves the body there
};

/// Triangles are renumbered by the tree for locality: "internal index" below.
class SurfaceWalk {
 public:
  /// Throws InputError on an empty mesh, an index out of range or a coordinate that is not finite.
  explicit SurfaceWalk(const SurfaceMesh& mesh);

  /// Nearest surface point to x, globally. The search walks from the triangle `hint` (-1: none is known nearby). It may
  /// stop early once the distance is known to be below `enough`, and then gives some surface point nearer than that.
  [[nodiscard]] WalkPoint nearest(const Vector3& x, int hint, double enough = 0) const noexcept;

  /// Nearest surface point to the segment among those nearer than `within`.
  [[nodiscard]] NearestToSegment nearest_to_segment(const Vector3& start, const Vector3& end, double within,
                                                    int hint) const noexcept;

  [[nodiscard]] LastCrossing last_crossing(const Vector3& start, const Vector3& end) const noexcept;

  /// The same three over the given triangles alone, for candidates found by other means. At least one triangle.
  [[nodiscard]] WalkPoint nearest_among(const Vector3& x, std::span<const int> triangles) const noexcept;
  [[nodiscard]] NearestToSegment nearest_to_segment_among(const Vector3& start, const Vector3& end, double within,
                                                          std::span<const int> triangles) const noexcept;
  [[nodiscard]] LastCrossing last_crossing_among(const Vector3& start, const Vector3& end,
                                                 std::span<const int> triangles) const noexcept;

  /// Distance from x to one triangle, m.
  [[nodiscard]] double distance_to_triangle(const Vector3& x, int triangle) const noexcept;

  /// Normal interpolated linearly between the corners' pseudonormals; continuous over the surface.
  [[nodiscard]] Vector3 smooth_normal(const WalkPoint& at) const noexcept;

  [[nodiscard]] int original(int triangle) const noexcept { return original_[triangle]; }
  /// Internal index of a triangle of the mesh; of any other number, some triangle.
  [[nodiscard]] int internal(int original) const noexcept {
    return original >= 0 && original < std::ssize(internal_) ? internal_[original] : 0;
  }

 private:
  // The tree is searched in single precision, four lanes at once, relative to centre_; everything is padded so that
  // rounding drops nothing. Distances that count are then taken in double precision.
  using Lanes = Eigen::Array4f;
  /// Flat round boxes, a lane each: what lies less than half_height from a plane and radius from a centre in it. Much
  /// tighter than an upright box about a piece of a surface that is smooth and slanted.
  struct Discs {
    std::array<Lanes, 3> centre{Lanes::Zero(), Lanes::Zero(), Lanes::Zero()}, normal = centre; // normals of length 1
    Lanes radius = Lanes::Zero(), half_height = Lanes::Zero();

    [[nodiscard]] Lanes squared_distances(const Eigen::Vector3f& x) const noexcept {
      const Lanes vx = x[0] - centre[0], vy = x[1] - centre[1], vz = x[2] - centre[2];
      const Lanes height = vx * normal[0] + vy * normal[1] + vz * normal[2];
      const Lanes along2 =
          (vx - height * normal[0]).square() + (vy - height * normal[1]).square() + (vz - height * normal[2]).square();
      return (height.abs() - half_height).max(0.0F).square() + (along2.sqrt() - radius).max(0.0F).square();
    }
  };
  /// Up to four children, a lane each: the triangles of each lie in its box and in its disc.
  struct Node {
    std::array<Lanes, 3> lower, upper; // boxes, per axis
    Discs discs;
    // m2: discs are worth a look for what is farther than the radius of a flat one.
    float least_radius2 = std::numeric_limits<float>::infinity();
    std::array<int, 4> first; // child node, or leaf; -1: no child
    std::array<int, 4> count; // triangles of the leaf; 0: child node

    [[nodiscard]] Vector3 box_lower(int child) const { return {lower[0][child], lower[1][child], lower[2][child]}; }
    [[nodiscard]] Vector3 box_upper(int child) const { return {upper[0][child], upper[1][child], upper[2][child]}; }
  };
  /// Up to four triangles, each within a flat disc.
  struct Leaf {
    Discs discs;
    int first = 0;
  };
  struct Corners {
    Vector3 a, b, c;
  };
  struct Candidate;

  void build_tree(const SurfaceMesh& mesh);
  void build_adjacency(const SurfaceMesh& mesh);
  void build_leaves();
  /// Bounds at least for children nearer than `best`, m2.
  [[nodiscard]] static Lanes squared_distance_bounds(const Node& node, const Eigen::Vector3f& x, double best) noexcept;
  void try_triangle(const Vector3& x, int triangle, Candidate& best) const noexcept;
  void descend(const Vector3& x, Candidate& best) const noexcept;
  [[nodiscard]] WalkPoint finish(const Vector3& x, const Candidate& best) const noexcept;
  [[nodiscard]] Vector3 pseudonormal(int triangle, TriangleFeature feature) const noexcept;
  void keep_crossing(const Vector3& start, const Vector3& end, int triangle, LastCrossing& last) const noexcept;

  Vector3 centre_;          // m, of the mesh
  double padding_ = 0;      // m, above the rounding of a point of the mesh, twice over
  std::vector<Node> nodes_; // nodes_[0] is the root
  std::vector<Leaf> leaves_;
  std::vector<Corners> corners_;              // per triangle
  std::vector<Triangle> vertices_of_;         // per triangle
  std::vector<std::array<int, 3>> across_;    // per triangle, over ab, bc, ca; -1 on a border
  std::vector<Vector3> face_normals_;         // per triangle
  std::vector<Vector3> vertex_pseudonormals_; // per vertex
  std::vector<int> fan_begin_, fan_;          // triangles around vertex v: fan_[fan_begin_[v] .. fan_begin_[v + 1])
  std::vector<int> original_, internal_;
};

} // namespace spherecut::topology
