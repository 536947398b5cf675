// Where the sheets of an incision ask for nodes: its front, its rim on the surface of the body, its area, its
// crossings.
#pragma once

#include "solvers/nodes/features.hpp"
#include "solvers/nodes/nodes.hpp"

namespace spherecut::solvers {

/// A curve measured in units of the local spacing h.
class MeasuredCurve {
 public:
  MeasuredCurve() = default;
  MeasuredCurve(std::vector<Vector3> points, const SpacingField& spacing);

  struct Place {
    int segment = 0;
    double t = 0; // 0 at the segment's first point, 1 at its last
    Vector3 point = Vector3::Zero();
  };
  [[nodiscard]] Place at(double measure) const;
  [[nodiscard]] double length() const { return measures_.empty() ? 0 : measures_.back(); }
  /// Measure at a point of the curve's list.
  [[nodiscard]] double measure(int point) const { return measures_[point]; }
  [[nodiscard]] const std::vector<Vector3>& points() const { return points_; }

 private:
  std::vector<Vector3> points_; // m
  std::vector<double> measures_;
};

/// A run of the front. Its ends lie on the surface of the body when it is not closed.
struct FrontChain {
  std::vector<Vector3> points;        // m; the first repeated at the end of a closed one
  std::vector<Vector3> ahead, normal; // unit, per segment: out of the sheet, to its + side
  std::vector<bool> corner;           // per point: the front turns there by more than 40 degrees
  int sheet = -1;
  bool closed = false;
};

/// A run of the curve where a sheet meets the surface of the body.
struct RimChain {
  std::vector<Vector3> points;  // m; the first repeated at the end of a closed one
  std::vector<Vector3> normals; // unit, of the sheet, per point
  std::vector<Vector3> along;   // per point: unit direction of the sharp edge of the surface that it lies on, or zero
  int sheet = -1;
  bool closed = false;
  std::array<bool, 2> at_front{}; // the end is an end of the front
};

/// A place where a sharp edge of the surface passes through a sheet.
struct SharpCrossing {
  int curve = -1, segment = -1; // of SharpFeatures
  double t = 0;                 // along the segment
  Vector3 point, normal, along; // m; unit normal of the sheet; unit direction of the edge
  int sheet = -1;
};

/// A piece of a sheet inside the body.
struct SheetSample {
  Vector3 point, normal; // m, unit
  double spacing;        // m
  double expected;       // area / h^2
  int sheet;
};

struct SheetLayout {
  std::vector<FrontChain> fronts;
  std::vector<RimChain> rims;
  std::vector<SharpCrossing> edges;
  std::vector<SheetSample> samples;              // half a spacing apart
  std::vector<std::array<Vector3, 2>> crossings; // m, pieces of the lines where sheets cross
};

/// The layout of all sheets, or of what lies in `region`. Chains that leave the region end there.
SheetLayout lay_out_sheets(const topology::Domain& domain, const SharpFeatures& features, const SpacingField& spacing,
                           const topology::Incision& incision, const topology::SurfaceMesh& surface,
                           const BoundingBox* region = nullptr);

/// Distance from x to the nearest of `segments`, m; infinity when there is none.
double distance_to_segments(const Vector3& x, const std::vector<std::array<Vector3, 2>>& segments);

/// The exact sharp curve near point x of a mesh edge: points in the normal cone of a sharp edge have their closest
/// surface point on the edge itself.
Vector3 onto_sharp_edge(const topology::Domain& domain, const topology::SurfaceMesh& surface, const SharpCurve& curve,
                        int segment, const Vector3& x);

} // namespace spherecut::solvers
