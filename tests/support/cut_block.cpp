#include "tests/support/cut_block.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <random>

namespace spherecut::tests {

CutFrame tilted_frame() {
  CutFrame frame;
  frame.origin = {0.041, 0.013, 0.027};
  frame.normal = Vector3(0.13, -0.21, 1).normalized();
  frame.ahead = (Vector3(1, 0.17, 0) - Vector3(1, 0.17, 0).dot(frame.normal) * frame.normal).normalized();
  frame.tangent = frame.normal.cross(frame.ahead);
  return frame;
}

topology::SurfaceMesh flat_sheet(const CutFrame& frame, double behind, double front, double half_width, int divisions) {
  topology::SurfaceMesh sheet;
  for (int a = 0; a <= divisions; ++a)
    for (int b = 0; b <= divisions; ++b)
      sheet.vertices.emplace_back(frame.origin + (behind + (front - behind) * a / divisions) * frame.ahead +
                                  half_width * (2.0 * b / divisions - 1) * frame.tangent);
  for (int a = 0; a < divisions; ++a)
    for (int b = 0; b < divisions; ++b) {
      const int k = a * (divisions + 1) + b, l = k + divisions + 1;
      sheet.triangles.push_back({k, l, k + 1});
      sheet.triangles.push_back({k + 1, l, l + 1});
    }
  return sheet;
}

CutBlock cut_block(int divisions, bool through, std::uint64_t seed) {
  CutBlock block;
  block.frame = tilted_frame();
  const CutFrame& frame = block.frame;
  const double h = 1.0 / divisions, edge = through ? 1.2 : 0;
  block.domain = topology::make_box_domain(Vector3::Constant(-0.5), Vector3::Constant(0.5), h);
  block.incision = std::make_shared<topology::Incision>(
      std::vector<topology::SurfaceMesh>{flat_sheet(frame, -1.2, edge, 1.2, 6)}, block.domain);

  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-0.2 * h, 0.2 * h);
  for (int a = 0; a <= divisions; ++a)
    for (int b = 0; b <= divisions; ++b)
      for (int c = 0; c <= divisions; ++c) {
        const std::array<int, 3> index{a, b, c};
        Vector3 x, normal = Vector3::Zero();
        for (int axis = 0; axis < 3; ++axis) {
          const double move = shift(random);
          const bool low = index[axis] == 0, high = index[axis] == divisions;
          x[axis] = low || high ? index[axis] * h - 0.5 : index[axis] * h - 0.5 + move;
          normal[axis] = low ? -1 : high ? 1 : 0;
        }
        const auto face = block.incision->closest(x, 0.35 * h);
        const double faces = normal.cwiseAbs().sum();
        if (!face || faces > 0) {
          // Nodes of the surface stay, off the sheet.
          if (face && face->distance < 0.1 * h)
            continue;
          block.nodes.add(x, h,
                          faces == 0   ? solvers::NodeKind::interior
                          : faces == 1 ? solvers::NodeKind::surface
                                       : solvers::NodeKind::edge,
                          faces > 0 ? Vector3(normal.normalized()) : normal);
        }
      }
  for (int i = 0; - 1.2 + 0.5 * h + i * h < edge; ++i)
    for (int k = -2 * divisions; k <= 2 * divisions; ++k) {
      const double back = edge - 0.5 * h - i * h;
      const Vector3 x = frame.origin + (back + (i > 0 ? 0.5 * shift(random) : 0)) * frame.ahead +
                        (k * h + 0.5 * shift(random)) * frame.tangent;
      if (x.cwiseAbs().maxCoeff() > 0.5 - 0.3 * h)
        continue;
      for (double side : {1.0, -1.0})
        block.nodes.add(x + side * solvers::lip_offset * h * frame.normal, h, solvers::NodeKind::lip,
                        -side * frame.normal);
    }
  return block;
}

solvers::Problem problem_of(const CutBlock& block, const solvers::Material& material) {
  solvers::Problem problem;
  problem.domain = block.domain;
  problem.incision = block.incision;
  problem.nodes = block.nodes;
  problem.material = material;
  return problem;
}

} // namespace spherecut::tests
