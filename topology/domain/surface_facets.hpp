// The triangles of an organ's surface, where they are that surface and not a picture of it: which are near a place,
// where their sharp edges run, and which of them are parts of one smooth piece.
#pragma once

#include "topology/domain/domain.hpp"
#include "topology/search/box_tree.hpp"

namespace spherecut::topology {

/// An edge of the mesh across which the normals differ by more than sharp_facets degrees.
struct SharpSegment {
  Vector3 from, to; // m
  bool convex;      // the body's angle is below 180 degrees
};

inline constexpr double sharp_facets = 40; // degrees

class SurfaceFacets {
 public:
  /// The mesh is closed and outward, and has to outlive this.
  explicit SurfaceFacets(const SurfaceMesh& mesh);

  [[nodiscard]] const SurfaceMesh& mesh() const { return mesh_; }
  /// Smooth piece of a triangle: pieces end at sharp edges.
  [[nodiscard]] int piece(int triangle) const { return pieces_[static_cast<std::size_t>(triangle)]; }
  /// Triangles whose boxes meet the box, ascending.
  [[nodiscard]] std::vector<int> near(const BoundingBox& box) const;
  /// Whether a sharp edge, and whether one that is not convex, comes within `radius` m of x.
  struct SharpNear {
    bool any = false, concave = false;
  };
  [[nodiscard]] SharpNear sharp_near(const Vector3& x, double radius) const;

 private:
  const SurfaceMesh& mesh_;
  std::vector<int> pieces_;
  BoxTree triangles_;
  std::vector<SharpSegment> sharp_;
  BoxTree edges_;
};

/// Of a domain whose surface they are (make_organ_domain), made when they are first asked for; null of others, whose
/// surface is curved or has its edges in planes(). Thread safe.
const SurfaceFacets* facets_of(const Domain& domain);

} // namespace spherecut::topology
