#include "src/model/surface_watch.hpp"

#include "solvers/body/surface_patches.hpp"
#include "solvers/shapes/functions.hpp"
#include "src/model/body_model.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

namespace spherecut::app {
namespace {

constexpr double watched_edge = 1; // spacings: larger triangles are divided
constexpr double on_sheet = 2e-3;  // spacings: nearer to a sheet a point belongs to neither side of the cut
constexpr int most_divisions = 12; // of one triangle, by two along its edges

using Corners = std::array<Vector3, 3>;

double longest_side(const Corners& t) {
  return std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
}

/// Corners and middles of the triangles within the box, each point once.
class WatchedPoints {
 public:
  WatchedPoints(const BoundingBox& box, const solvers::NodeCloud& nodes, const topology::PointTree& tree)
      : box_(box), nodes_(nodes), tree_(tree) {}

  void add(const Corners& t, int division = 0) {
    if ((t[0].cwiseMax(t[1]).cwiseMax(t[2]).array() < box_.lower.array()).any() ||
        (t[0].cwiseMin(t[1]).cwiseMin(t[2]).array() > box_.upper.array()).any())
      return;
    const Vector3 middle = (t[0] + t[1] + t[2]) / 3;
    const double spacing = nodes_.spacings[static_cast<std::size_t>(tree_.nearest(middle).index)];
    if (longest_side(t) > watched_edge * spacing && division < most_divisions) {
      const Vector3 a = 0.5 * (t[0] + t[1]);
      const Vector3 b = 0.5 * (t[1] + t[2]);
      const Vector3 c = 0.5 * (t[2] + t[0]);
      for (const Corners& part : {Corners{t[0], a, c}, Corners{a, t[1], b}, Corners{c, b, t[2]}, Corners{a, b, c}})
        add(part, division + 1);
      return;
    }
    for (const Vector3& x : {t[0], t[1], t[2], middle})
      if (box_.contains(x) && known_.insert({x.x(), x.y(), x.z()}).second)
        points.push_back(x);
  }

  std::vector<Vector3> points;

 private:
  const BoundingBox& box_;
  const solvers::NodeCloud& nodes_;
  const topology::PointTree& tree_;
  std::set<std::array<double, 3>> known_;
};

} // namespace

SurfaceWatch::SurfaceWatch(const BodyModel& model, const topology::Domain& domain, double room,
                           const std::vector<char>& gone)
    : candidate_count_(model.patch.nodes.size()) {
  const solvers::NodeCloud& nodes = model.sprinkling.nodes;
  BoundingBox box{Vector3::Constant(std::numeric_limits<double>::infinity()),
                  Vector3::Constant(-std::numeric_limits<double>::infinity())};
  std::vector<int> place(nodes.positions.size(), -1);
  for (std::size_t c = 0; c < candidate_count_; ++c) {
    place[static_cast<std::size_t>(model.patch.nodes[c])] = static_cast<int>(c);
    box.lower = box.lower.cwiseMin(model.patch.rest[c]);
    box.upper = box.upper.cwiseMax(model.patch.rest[c]);
  }
  box.lower.array() -= room;
  box.upper.array() += room;
  std::vector<Vector3> skin;
  std::vector<int> ids;
  for (int i = 0; i < nodes.size(); ++i)
    if (on_surface(nodes.kinds[i])) {
      skin.push_back(nodes.positions[i]);
      ids.push_back(i);
    }
  const topology::PointTree all(nodes.positions);
  const topology::PointTree tree(skin);
  WatchedPoints watched(box, nodes, all);
  const topology::SurfaceMesh& surface = domain.surface();
  for (const Triangle& triangle : surface.triangles)
    watched.add({surface.vertices[static_cast<std::size_t>(triangle[0])],
                 surface.vertices[static_cast<std::size_t>(triangle[1])],
                 surface.vertices[static_cast<std::size_t>(triangle[2])]});
  solvers::ShapeFunctions shape;
  const topology::Incision* const opaque = model.body->problem().hiding().get();
  for (const Vector3& x : watched.points) {
    const int owner = ids[static_cast<std::size_t>(solvers::nearest_in_sight(tree, skin, opaque, x))];
    const double spacing = nodes.spacings[static_cast<std::size_t>(owner)];
    if (!gone.empty() && gone[static_cast<std::size_t>(owner)] != 0)
      continue;
    if (model.incision != nullptr && model.incision->closest(x, on_sheet * spacing))
      continue;
    try {
      model.body->shape_at(x, shape);
    } catch (const InputError&) { // beyond every sphere: there the surface moves as its node does
      model.body->shape_at(nodes.positions[static_cast<std::size_t>(owner)], shape);
    }
    rest_.push_back(x);
    owners_.push_back(owner);
    candidates_.push_back(place[static_cast<std::size_t>(owner)]);
    spacings_.push_back(spacing);
    for (int k = 0; k < shape.size(); ++k) {
      nodes_.push_back(shape.nodes[static_cast<std::size_t>(k)]);
      values_.push_back(shape.value[static_cast<std::size_t>(k)]);
    }
    start_.push_back(static_cast<int>(nodes_.size()));
  }
}

SurfaceWatch::Depths SurfaceWatch::depths(const topology::ToolShape& tool, const topology::ToolPose& pose,
                                          const solvers::Field& field, double limit) const {
  Depths found;
  found.of_candidates.assign(candidate_count_, -std::numeric_limits<double>::infinity());
  for (std::size_t p = 0; p < rest_.size(); ++p) {
    Vector3 x = rest_[p];
    for (int k = start_[p]; k < start_[p + 1]; ++k)
      x += values_[static_cast<std::size_t>(k)] *
           field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(nodes_[static_cast<std::size_t>(k)]));
    const double depth = -topology::tool_distance(tool, pose, x);
    if (depth > found.deepest) {
      found.deepest = depth;
      found.place = rest_[p];
      found.spacing = spacings_[p];
      found.pushed = candidates_[p] >= 0;
    }
    if (candidates_[p] >= 0) {
      double& deepest = found.of_candidates[static_cast<std::size_t>(candidates_[p])];
      deepest = std::max(deepest, depth);
      continue;
    }
    if (depth > limit * spacings_[p])
      found.beyond.push_back(owners_[p]);
  }
  std::sort(found.beyond.begin(), found.beyond.end());
  found.beyond.erase(std::unique(found.beyond.begin(), found.beyond.end()), found.beyond.end());
  return found;
}

} // namespace spherecut::app
