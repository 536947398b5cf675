#include "topology/tool/contact.hpp"

#include "topology/tool/deepest_contact.hpp"
#include "topology/tool/global_contact.hpp"

namespace spherecut::topology {
namespace {

/// The questions of deepest_contact, answered by the walk.
struct WalkSurface {
  const SurfaceWalk& walk;

  [[nodiscard]] WalkPoint nearest(const Vector3& x, double /*expected*/, int hint, double enough) const noexcept {
    return walk.nearest(x, hint, enough);
  }
  [[nodiscard]] NearestToSegment nearest_to_segment(const Vector3& start, const Vector3& end, double within,
                                                    int hint) const noexcept {
    return walk.nearest_to_segment(start, end, within, hint);
  }
  [[nodiscard]] LastCrossing last_crossing(const Vector3& start, const Vector3& end) const noexcept {
    return walk.last_crossing(start, end);
  }
};

} // namespace

struct ContactQuery::Impl {
  explicit Impl(const SurfaceMesh& organ) : walk(organ), global(organ, walk) { require_outward(organ); }

  SurfaceWalk walk;
  GlobalContact global;
};

ContactQuery::ContactQuery(const SurfaceMesh& organ) : impl_(std::make_unique<Impl>(organ)) {}
ContactQuery::~ContactQuery() = default;
ContactQuery::ContactQuery(ContactQuery&&) noexcept = default;
ContactQuery& ContactQuery::operator=(ContactQuery&&) noexcept = default;

SurfaceContact ContactQuery::first_touch(const ToolShape& tool, const ToolPose& pose) const {
  check(tool);
  check(pose);
  return impl_->global.first_touch(tool, pose);
}

SurfaceContact ContactQuery::walk(const ToolShape& tool, const ToolPose& pose,
                                  const SurfaceContact& last) const noexcept {
  return deepest_contact(WalkSurface{impl_->walk}, tool, pose, last);
}

SurfaceContact ContactQuery::closest_point(const Vector3& x) const {
  return impl_->global.closest_point(x);
}

} // namespace spherecut::topology
