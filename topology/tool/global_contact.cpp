#include "topology/tool/global_contact.hpp"

#include "topology/base/errors.hpp"
#include "topology/tool/deepest_contact.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>
#include <fmt/format.h>

namespace spherecut::topology {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using CgalTriangles = std::vector<Kernel::Triangle_3>;
using CgalPrimitive = CGAL::AABB_triangle_primitive<Kernel, CgalTriangles::const_iterator>;
using CgalTree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CgalPrimitive>>;
using FclModel = fcl::BVHModel<fcl::OBBRSSd>;

/// The questions of deepest_contact answered by FCL: it finds the triangles that touch a ball or a capsule, and the
/// exact distance is taken over those. Radii are enlarged, so that FCL's rounding (its iterative solver stops at about
/// 1e-6) drops none.
class FclSurface {
 public:
  FclSurface(const SurfaceWalk& surface, std::shared_ptr<FclModel> model)
      : walk(surface), model_(std::move(model)), organ_(model_) {}

  [[nodiscard]] WalkPoint nearest(const Vector3& x, double expected, int /*hint*/, double /*enough*/) const {
    std::vector<int> found = touching(std::make_shared<fcl::Sphered>(enlarged(expected)), at(x));
    if (found.empty()) {
      const double radius = 1e-3 * std::abs(expected) + 1e-9;
      const fcl::CollisionObjectd ball(std::make_shared<fcl::Sphered>(radius), at(x));
      fcl::DistanceRequestd request;
      fcl::DistanceResultd result;
      const double gap = fcl::distance(&organ_, &ball, request, result);
      found = touching(std::make_shared<fcl::Sphered>(enlarged(std::max(gap, 0.0) + radius)), at(x));
      if (found.empty())
        throw NumericalError(fmt::format("contact: FCL finds no triangle within the distance {} m that it gives for "
                                         "({}, {}, {})",
                                         gap, x.x(), x.y(), x.z()));
    }
    return walk.nearest_among(x, found);
  }

  [[nodiscard]] NearestToSegment nearest_to_segment(const Vector3& start, const Vector3& end, double within,
                                                    int /*hint*/) const {
    return walk.nearest_to_segment_among(start, end, within, around_segment(start, end, enlarged(within)));
  }

  [[nodiscard]] LastCrossing last_crossing(const Vector3& start, const Vector3& end) const {
    constexpr double thin = 1e-4; // m
    return walk.last_crossing_among(start, end, around_segment(start, end, thin));
  }

  const SurfaceWalk& walk;

 private:
  static double enlarged(double radius) { return 1.001 * std::abs(radius) + 1e-6; }

  static fcl::Transform3d at(const Vector3& x) {
    fcl::Transform3d pose = fcl::Transform3d::Identity();
    pose.translation() = x;
    return pose;
  }

  [[nodiscard]] std::vector<int> around_segment(const Vector3& start, const Vector3& end, double radius) const {
    fcl::Transform3d pose = at(0.5 * (start + end)); // FCL's capsules are centred and lie along z
    pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), end - start).toRotationMatrix();
    return touching(std::make_shared<fcl::Capsuled>(radius, (end - start).norm()), pose);
  }

  /// Internal indices of the triangles that touch the shape.
  [[nodiscard]] std::vector<int> touching(const std::shared_ptr<fcl::CollisionGeometryd>& shape,
                                          const fcl::Transform3d& pose) const {
    const fcl::CollisionObjectd tool(shape, pose);
    const fcl::CollisionRequestd request(static_cast<std::size_t>(model_->num_tris), true);
    fcl::CollisionResultd result;
    fcl::collide(&organ_, &tool, request, result);
    std::vector<int> triangles(result.numContacts());
    for (std::size_t i = 0; i < triangles.size(); ++i)
      triangles[i] = walk.internal(static_cast<int>(result.getContact(i).b1));
    return triangles;
  }

  std::shared_ptr<FclModel> model_;
  fcl::CollisionObjectd organ_;
};

std::shared_ptr<FclModel> fcl_model(const SurfaceMesh& organ) {
  auto model = std::make_shared<FclModel>();
  std::vector<fcl::Triangle> triangles;
  triangles.reserve(organ.triangles.size());
  for (const Triangle& t : organ.triangles)
    triangles.emplace_back(t[0], t[1], t[2]);
  model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(organ.vertices.size()));
  model->addSubModel(organ.vertices, triangles);
  model->endModel();
  model->computeLocalAABB();
  return model;
}

CgalTriangles cgal_triangles(const SurfaceMesh& organ) {
  CgalTriangles triangles;
  triangles.reserve(organ.triangles.size());
  const auto point = [&](int v) {
    return Kernel::Point_3(organ.vertices[v].x(), organ.vertices[v].y(), organ.vertices[v].z());
  };
  for (const Triangle& t : organ.triangles)
    triangles.emplace_back(point(t[0]), point(t[1]), point(t[2]));
  return triangles;
}

} // namespace

struct GlobalContact::Data {
  Data(const SurfaceMesh& organ, const SurfaceWalk& surface)
      : walk(surface), fcl(walk, fcl_model(organ)), triangles(cgal_triangles(organ)),
        tree(triangles.cbegin(), triangles.cend()) {
    // Built now: CGAL would build them under a lock at the first query.
    tree.build();
    tree.accelerate_distance_queries();
  }

  const SurfaceWalk& walk;
  FclSurface fcl;
  CgalTriangles triangles;
  CgalTree tree;
};

GlobalContact::GlobalContact(const SurfaceMesh& organ, const SurfaceWalk& walk)
    : data_(std::make_unique<Data>(organ, walk)) {}
GlobalContact::~GlobalContact() = default;

SurfaceContact GlobalContact::first_touch(const ToolShape& tool, const ToolPose& pose) const {
  return deepest_contact(data_->fcl, tool, pose, {});
}

SurfaceContact GlobalContact::closest_point(const Vector3& x) const {
  const auto [point, primitive] = data_->tree.closest_point_and_primitive(Kernel::Point_3(x.x(), x.y(), x.z()));
  const int triangle = static_cast<int>(primitive - data_->triangles.cbegin());
  const Vector3 closest(point.x(), point.y(), point.z());
  const std::array<int, 1> one{data_->walk.internal(triangle)};
  const WalkPoint side = data_->walk.nearest_among(x, one);
  const double distance = (x - closest).norm();
  return {closest, side.normal, side.signed_distance < 0 ? distance : -distance, triangle, x};
}

} // namespace spherecut::topology
