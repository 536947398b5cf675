// The surface about a contact, point by point: how deep it lies in the tool once the body is deformed. Contact is found
// on means over shares of the surface; between and beside them the surface is what it is, and this looks at it.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "topology/tool/tool.hpp"

namespace spherecut::app {

struct BodyModel;

class SurfaceWatch {
 public:
  /// Corners and middles of the triangles of the organ's surface about the patch of the model, those larger than the
  /// spacing divided; without points on a sheet of the cut and those of nodes that are `gone` (empty: none). `room` m:
  /// how far from the patch's nodes they may lie. The body must have spheres.
  SurfaceWatch(const BodyModel& model, const topology::Domain& domain, double room, const std::vector<char>& gone);

  struct Depths {
    std::vector<double> of_candidates; // m, of the deepest point of each share; -infinity: none is looked at
    double deepest = 0;                // m, of all points, 0: none lies in the tool
    Vector3 place = Vector3::Zero();   // m, where that is, at rest
    double spacing = 0;                // m, of its node
    bool pushed = false;               // its node is a candidate
    std::vector<int> beyond;           // nodes that are no candidates, whose shares lie deeper than their limit
  };
  /// Under the field, with `limit` times its spacing as what may be left over at a node.
  [[nodiscard]] Depths depths(const topology::ToolShape& tool, const topology::ToolPose& pose,
                              const solvers::Field& field, double limit) const;

  [[nodiscard]] std::size_t size() const { return rest_.size(); }

 private:
  std::vector<Vector3> rest_;
  std::vector<int> owners_, candidates_; // node whose share a point is in; its place in the patch, -1: none
  std::vector<double> spacings_;         // m, of that node
  std::size_t candidate_count_;
  std::vector<int> start_{0}, nodes_; // shape functions of every point, in compressed rows
  std::vector<double> values_;
};

} // namespace spherecut::app
