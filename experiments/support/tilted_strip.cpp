#include "experiments/support/tilted_strip.hpp"

#include "topology/cut_sheets.hpp"

#include <cmath>

namespace spherecut::experiments {

TiltedStrip tilted_strip(double length, double height, double thickness, double edge) {
  TiltedStrip strip{nullptr, tilted_frame({0.031, 0, -0.017}, {0, 0.23, 0}), length, height, thickness};
  const Vector3 half = 0.5 * Vector3(length, thickness, height);
  topology::SurfaceMesh surface = topology::make_box_domain(-half, half, edge)->surface();
  for (Vector3& x : surface.vertices)
    x = strip.frame.origin + x.x() * strip.frame.ahead + x.z() * strip.frame.normal + Vector3(0, x.y(), 0);
  strip.domain = topology::make_organ_domain(std::move(surface));
  return strip;
}

topology::SurfaceMesh cut_from_end(const TiltedStrip& strip, double depth, double above, double edge) {
  const CutFrame& frame = strip.frame;
  const double beyond = 0.3 * strip.thickness;
  const Vector3 front = frame.origin + (depth - 0.5 * strip.length) * frame.ahead + above * frame.normal;
  return topology::make_rectangle_sheet(front - 0.5 * (depth + beyond) * frame.ahead, frame.normal, frame.ahead,
                                        strip.thickness + 2 * beyond, depth + beyond, edge);
}

void hold_sides(solvers::Problem& problem, const TiltedStrip& strip) {
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
