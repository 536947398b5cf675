// A pattern of 34 nodes about a tool tip on a plane surface: rings on the surface and in two layers below it.
#pragma once

#include "solvers/nodes/nodes.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace spherecut::tests {

struct TipPattern {
  solvers::NodeCloud nodes; // node 0 is the tip, at the origin; the body lies below z = 0
  std::vector<char> held;   // the outermost ring of each layer and the whole lowest layer
};

inline TipPattern tip_pattern(double spacing) {
  TipPattern pattern;
  const auto ring = [&](int count, double radius, double depth, double turn, bool held) {
    for (int k = 0; k < count; ++k) {
      const double angle = turn + 2 * 3.14159265358979323846 * k / count;
      const bool surface = depth == 0;
      pattern.nodes.add(spacing * Vector3(radius * std::cos(angle), radius * std::sin(angle), -depth), spacing,
                        surface ? solvers::NodeKind::surface : solvers::NodeKind::interior,
                        surface ? Vector3(Vector3::UnitZ()) : Vector3(Vector3::Zero()));
      pattern.held.push_back(held ? 1 : 0);
    }
  };
  ring(1, 0, 0, 0, false);
  ring(6, 1, 0, 0.1, false);
  ring(9, 2, 0, 0.3, true);
  ring(1, 0, 0.9, 0, false);
  ring(5, 1, 1, 0.5, false);
  ring(6, 1.9, 1.1, 0.2, true);
  ring(1, 0, 2, 0, true);
  ring(5, 1.1, 2, 0.7, true);
  return pattern;
}

/// Carries the pattern to a contact point with a surface normal, into a cloud of the same size.
inline void place(const TipPattern& pattern, const Vector3& contact, const Vector3& normal,
                  solvers::NodeCloud& placed) {
  const Matrix3 rotation = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), normal).toRotationMatrix();
  for (int i = 0; i < placed.size(); ++i) {
    placed.positions[i] = contact + rotation * pattern.nodes.positions[i];
    placed.normals[i] = rotation * pattern.nodes.normals[i];
  }
}

} // namespace spherecut::tests
