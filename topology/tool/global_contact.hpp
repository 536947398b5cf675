// Contact over the whole surface, from nothing, by libraries: what ContactQuery (contact.hpp) asks where there is no
// last contact to walk from. Its source alone includes FCL.
#pragma once

#include "topology/surface/walk.hpp"
#include "topology/tool/contact.hpp"

#include <memory>

namespace spherecut::topology {

class GlobalContact {
 public:
  /// Keeps a reference to `walk`, the flat arrays of the same surface.
  GlobalContact(const SurfaceMesh& organ, const SurfaceWalk& walk);
  ~GlobalContact();
  GlobalContact(const GlobalContact&) = delete;
  GlobalContact& operator=(const GlobalContact&) = delete;

  /// Deepest contact by FCL; tool and pose have been checked.
  [[nodiscard]] SurfaceContact first_touch(const ToolShape& tool, const ToolPose& pose) const;
  /// ContactQuery::closest_point, by CGAL's tree of boxes.
  [[nodiscard]] SurfaceContact closest_point(const Vector3& x) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

} // namespace spherecut::topology
