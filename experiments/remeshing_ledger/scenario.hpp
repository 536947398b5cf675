// What every back end of the ledger is given: the same organ, material, held region, cut and load.
#pragma once

#include "experiments/analytic/cracks.hpp"
#include "solvers/elasticity/material.hpp"
#include "solvers/nodes/nodes.hpp"
#include "topology/domain/domain.hpp"

#include <Eigen/Geometry>
#include <functional>
#include <limits>
#include <string>

namespace spherecut::experiments::ledger {

using Vector2 = Eigen::Vector2d;

/// A cut in one plane that grows. Coordinates (u, v) in the plane run along frame.ahead and frame.tangent, m. The cut
/// is the part of an outline (a convex polygon, counter-clockwise seen from frame.normal) that lies in the organ.
struct Scenario {
  std::string name;
  std::shared_ptr<const topology::Domain> domain;
  std::function<bool(const Vector3& x)> contains; // whether the organ does
  std::vector<std::vector<Vector3>> sharp_edges;  // of the organ, as polylines, m
  solvers::Material material;
  CutFrame frame;
  int increments = 0; // the cut before the first of them is number 0
  std::function<std::vector<Vector2>(int increment)> outline;
  /// The sheet of that moment; those of later moments continue it triangle by triangle.
  std::function<topology::SurfaceMesh(int increment)> sheet;

  std::function<bool(const Vector3& x, const Vector3& normal)> held;
  std::function<Vector3(const Vector3& x)> displacement; // m, where held
  std::function<bool(const Vector3& x)> tool;            // part of the held surface whose reaction is the tool force
  Vector3 force_direction = Vector3::Zero();             // zero: no tool force in this scenario
  double pressure = 0;                                   // Pa on the faces of the cut

  Vector3 marked = Vector3::Zero(); // m, place on the cut where the opening is told
  /// Of the last increment, where there is an exact solution.
  double exact_volume = std::numeric_limits<double>::quiet_NaN();
  double exact_marked = std::numeric_limits<double>::quiet_NaN();
  std::function<double(const Vector3& x)> exact_opening; // m, along the normal; null: not known
  Vector3 inner = Vector3::Zero(); // m, deep in the organ and off the cut's plane: a mesher starts there
  double size = 1;                 // m, of the organ
  double advance = 0;              // m, of the front in one increment

  [[nodiscard]] Vector2 in_plane(const Vector3& x) const {
    const Vector3 d = x - frame.origin;
    return {d.dot(frame.ahead), d.dot(frame.tangent)};
  }
  [[nodiscard]] Vector3 in_space(const Vector2& p) const {
    return frame.origin + p.x() * frame.ahead + p.y() * frame.tangent;
  }
  [[nodiscard]] double height(const Vector3& x) const { return (x - frame.origin).dot(frame.normal); }
};

/// Whether a point of the plane lies in a convex polygon.
bool inside(const std::vector<Vector2>& polygon, const Vector2& p);

/// Border of the organ in the cut's plane, a closed polyline: first point = last point.
std::vector<Vector3> border_in_plane(const Scenario& scenario);

/// Front of the cut: the part of its outline inside the organ. Closed where the outline is (first = last point).
struct Front {
  std::vector<Vector3> points;
  bool closed = false;
};
Front front_of(const Scenario& scenario, int increment);

/// The part of the front that moves: a closed one whole, of an open one its leading edge.
std::vector<Vector3> leading_edge(const Scenario& scenario, int increment);

/// Distance to a polyline, m.
double distance_to(const std::vector<Vector3>& polyline, const Vector3& x);

/// Element size or node spacing, the same law for everyone: `fine` within 1.5 fine of the front, growing by `slope`
/// from there on up to `coarse`.
struct Grading {
  double fine = 0, slope = 0.35, coarse = 0;
  std::vector<Vector3> front;
  [[nodiscard]] double operator()(const Vector3& x) const;
};

/// Points of the cut's faces with their share of its area, for integrals over the opening.
struct FacePoint {
  Vector3 position;
  double area;
};
std::vector<FacePoint> face_points(const Scenario& scenario, int increment);

/// A penny crack under pressure in a cube of 4 m, tilted and shifted against it; its radius grows to 1 m. The surface
/// of the cube is held as Sneddon's solution of the last radius has it.
Scenario growing_penny(int increments);
/// A block of 60 x 60 x 30 mm is pulled apart at two faces; a cut 15 mm deep runs in from the side by 40 mm.
Scenario edge_cut(int increments);
/// An incision into the dome of a liver, held at its underside and spread by a pressure on its faces.
Scenario liver_incision(int increments);

} // namespace spherecut::experiments::ledger
