// Where a tool touches the organ at rest: first touch by FCL, then a walk over neighbouring triangles from the last
// contact [De 2001, sec. 3; Ho, Basdogan and Srinivasan 1999].
#pragma once

#include "topology/surface_mesh.hpp"
#include "topology/tool.hpp"

#include <memory>
#include <optional>

namespace spherecut::topology {

/// The point of the organ surface that the tool has gone deepest below, or is nearest to.
struct SurfaceContact {
  Vector3 point = Vector3::Zero();  // m, on the rest surface
  Vector3 normal = Vector3::Zero(); // unit, outward normal of the organ there
  double depth = 0;                 // m, > 0: the tool penetrates; < 0: clearance
  int triangle = -1;                // triangle that holds the point
};

/// Keeps the collision structures of one rest surface. Queries are const and thread safe; walk() neither allocates,
/// locks nor throws.
class ContactQuery {
 public:
  explicit ContactQuery(const SurfaceMesh& organ);
  ~ContactQuery();
  ContactQuery(ContactQuery&&) noexcept;
  ContactQuery& operator=(ContactQuery&&) noexcept;

  /// Global query by FCL over the whole surface, any starting point.
  [[nodiscard]] SurfaceContact first_touch(const ToolShape& tool, const ToolPose& pose) const;

  /// Local query: walks from the last contact's triangle over neighbours to the new closest point.
  [[nodiscard]] SurfaceContact walk(const ToolShape& tool, const ToolPose& pose,
                                    const SurfaceContact& last) const noexcept;

  /// Exact closest point of the surface to x (CGAL AABB tree), the oracle of both.
  [[nodiscard]] SurfaceContact closest_point(const Vector3& x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

} // namespace spherecut::topology
