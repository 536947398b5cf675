// Where a tool touches the organ at rest: first touch by FCL, then a walk over neighbouring triangles from the last
// contact [De 2001, sec. 3; Ho, Basdogan and Srinivasan 1999].
#pragma once

#include "topology/surface/mesh.hpp"
#include "topology/tool/tool.hpp"

#include <array>
#include <memory>
#include <optional>

namespace spherecut::topology {

/// The deepest contact of a tool and the organ's rest surface, or the nearest when they are apart.
///
/// Every tool has a skeleton and a radius about it; `tool_point` is the skeleton's point that is deepest, `point` the
/// surface point nearest to it, and
///   depth = radius - signed distance of tool_point from the organ (negative inside the organ),
/// so that depth goes on growing when the skeleton itself has entered the organ.
/// Skeletons:
/// - SphereTip: the centre.
/// - Laparoscope: the tip centre with the tip's radius, and the shaft's axis with the shaft's radius; the deeper of the
///   two, the tip when equal. Exact along the axis, sunk or not.
/// - FlatPunch: the flat end itself, radius 0, judged at ten points: its centre; half way and all the way out to
///   the rim down the slope of the organ (smooth normal at the point nearest to the centre); and every further 45
///   degrees of the rim. Exact where the surface under the punch is plane; on bumps no wider than the punch short by up
///   to a fifth of its radius. Equal depths count for the centre. The punch's side is not looked at.
///
/// Signed distance is global: a tool deeper than half of a lobe's thickness is nearer to the lobe's other side and
/// reports that side.
struct SurfaceContact {
  Vector3 point = Vector3::Zero();      // m, on the rest surface
  Vector3 normal = Vector3::Zero();     // unit, outward pseudonormal of the organ there: of the face, edge or vertex
  double depth = 0;                     // m, > 0: the tool penetrates; < 0: clearance
  int triangle = -1;                    // triangle that holds the point
  Vector3 tool_point = Vector3::Zero(); // m, point of the tool's skeleton that is deepest
  /// Flat punch: triangles near the ten points of its end, where the next walk starts; else -1.
  std::array<int, 10> end_triangles{-1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
};

/// Keeps the collision structures of one closed rest surface. Queries are const and thread safe; walk() neither
/// allocates, locks nor throws.
class ContactQuery {
 public:
  /// Throws InputError on an empty surface, a vertex index out of range, a coordinate that is not finite, and triangles
  /// that are oriented inwards.
  explicit ContactQuery(const SurfaceMesh& organ);
  ~ContactQuery();
  ContactQuery(ContactQuery&&) noexcept;
  ContactQuery& operator=(ContactQuery&&) noexcept;

  /// Global query by FCL over the whole surface, from nothing.
  [[nodiscard]] SurfaceContact first_touch(const ToolShape& tool, const ToolPose& pose) const;

  /// Walks from the last contact's triangle over neighbouring triangles to the new contact, then opens only those parts
  /// of the surface that could hold a deeper one: the same contact as first_touch, however the surface is folded. Any
  /// `last` is fine; the closer, the faster.
  [[nodiscard]] SurfaceContact walk(const ToolShape& tool, const ToolPose& pose,
                                    const SurfaceContact& last) const noexcept;

  /// Surface point closest to x (CGAL AABB tree), the oracle of both: depth is minus the signed distance of x, which is
  /// the tool_point.
  [[nodiscard]] SurfaceContact closest_point(const Vector3& x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace spherecut::topology
