#include "experiments/support/tilted_strip.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace spherecut::experiments {

TiltedStrip tilted_strip(double length, double height, double thickness, double edge, StripSides sides,
                         Placement placement) {
  const CutFrame frame = sides == StripSides::sliding
                             ? placed_frame(placement, {0.031, 0, -0.017}, {0, 0.23, 0})
                             : placed_frame(placement, {0.031, 0.023, -0.017}, {0.19, 0.23, -0.14});
  TiltedStrip strip{nullptr, frame, sides, length, height, thickness};
  const Vector3 half = 0.5 * Vector3(length, thickness, height);
  Matrix3 axes;
  axes << frame.ahead, frame.normal.cross(frame.ahead), frame.normal;
  strip.domain = topology::make_turned_box_domain(strip.frame.origin, axes, half, edge);
  return strip;
}

topology::SurfaceMesh cut_from_end(const TiltedStrip& strip, double depth, double above, double edge) {
  const CutFrame& frame = strip.frame;
  const double beyond = 0.3 * strip.thickness;
  const Vector3 front = frame.origin + (depth - 0.5 * strip.length) * frame.ahead + above * frame.normal;
  return topology::make_rectangle_sheet(front - 0.5 * (depth + beyond) * frame.ahead, frame.normal, frame.ahead,
                                        strip.thickness + 2 * beyond, depth + beyond, edge);
}

namespace {

/// Holds the rigid motions at three nodes of the far end: all of the first, of the second what is across the way from
/// the first to it, of the third what is across their plane.
void hold_far_end(solvers::Problem& problem, const TiltedStrip& strip) {
  const CutFrame& frame = strip.frame;
  hold_surface(
      problem, [frame](const Vector3&, const Vector3& n) { return n.dot(frame.ahead) > 0.9; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  const std::vector<solvers::Prescribed> end = std::move(problem.prescribed);
  const auto nearest = [&](double above, double aside) {
    const Vector3 wanted =
        frame.origin + frame.global({0.5 * strip.length, above * strip.height, aside * strip.thickness});
    const auto distance = [&](const solvers::Prescribed& entry) {
      return (problem.nodes.positions[entry.node] - wanted).norm();
    };
    return std::min_element(end.begin(), end.end(),
                            [&](const auto& a, const auto& b) { return distance(a) < distance(b); })
        ->node;
  };
  const std::array<int, 3> held{nearest(-0.4, -0.3), nearest(0.4, -0.3), nearest(0, 0.3)};
  const std::vector<Vector3>& x = problem.nodes.positions;
  const Vector3 way = x[held[1]] - x[held[0]], across = way.cross(x[held[2]] - x[held[0]]);
  int along = 0, out = 0;
  way.cwiseAbs().maxCoeff(&along);
  across.cwiseAbs().maxCoeff(&out);
  std::array<bool, 3> second{true, true, true}, third{false, false, false};
  second[along] = false;
  third[out] = true;
  problem.prescribed = {{held[0], {true, true, true}, Vector3::Zero()},
                        {held[1], second, Vector3::Zero()},
                        {held[2], third, Vector3::Zero()}};
}

} // namespace

void hold_strip(solvers::Problem& problem, const TiltedStrip& strip) {
  if (strip.sides == StripSides::free) {
    hold_far_end(problem, strip);
    return;
  }
  const solvers::NodeCloud& nodes = problem.nodes;
  const auto nearest_held = [&](double along, double above) {
    const Vector3 wanted = strip.frame.origin + along * strip.frame.ahead + above * strip.frame.normal;
    int best = -1;
    for (int k = 0; k < std::ssize(problem.prescribed); ++k)
      if (best < 0 || (nodes.positions[problem.prescribed[k].node] - wanted).norm() <
                          (nodes.positions[problem.prescribed[best].node] - wanted).norm())
        best = k;
    return best;
  };
  const double side = 0.5 * strip.thickness * (1 - 1e-6);
  hold_surface(
      problem, [side](const Vector3& x, const Vector3&) { return std::abs(x.y()) > side; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  for (solvers::Prescribed& entry : problem.prescribed)
    entry.components = {false, true, false};
  const int lower = nearest_held(0.45 * strip.length, -0.45 * strip.height);
  const int upper = nearest_held(0.45 * strip.length, 0.45 * strip.height);
  problem.prescribed[lower].components = {true, true, true};
  problem.prescribed[upper].components = {true, true, false};
}

} // namespace spherecut::experiments
