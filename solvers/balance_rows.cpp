#include "solvers/balance_rows.hpp"

#include "solvers/face_operators.hpp"
#include "topology/errors.hpp"

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr double damping = 0.3;             // gamma
constexpr double damping_at_front = 2;      // gamma where the basis is enriched
constexpr double pair_reach = 0.01;         // nodes nearer than this, in spacings, are partners of a lip pair
constexpr double pressure_smoothing = 0.01; // alpha

using Block = Eigen::Matrix4d;

} // namespace

void assemble_rows(const Problem& problem, const topology::CellComplex& cells, const Spheres& spheres,
                   const NodalSupports& supports, bool mixed, const std::vector<char>& wanted,
                   std::vector<BalanceRow>& rows) {
  const int count = problem.nodes.size();
  const std::vector<Vector3>& x = problem.nodes.positions;
  const double mu = problem.material.shear_modulus();
  const double lambda = mixed ? 0 : problem.material.lame_lambda();
  struct Side {
    int other;
    double sign; // of the stored area
    int face;
  };
  std::vector<std::vector<Side>> sides(count);
  for (int f = 0; f < std::ssize(cells.faces); ++f) {
    sides[cells.faces[f].first].push_back({cells.faces[f].second, 1, f});
    sides[cells.faces[f].second].push_back({cells.faces[f].first, -1, f});
  }
  std::vector<std::vector<int>> lips(count);
  for (int l = 0; mixed && l < std::ssize(cells.lips); ++l)
    lips[cells.lips[l].node].push_back(l);
  std::vector<std::vector<int>> boundary(count);
  for (int b = 0; mixed && b < std::ssize(cells.boundary); ++b)
    boundary[cells.boundary[b].node].push_back(b);

  const FaceOperators operators = face_operators(cells, problem, spheres, supports, wanted);
  ShapeFunctions shape;
  rows.assign(count, {});
  std::vector<int> place(count, -1);
  std::size_t expected = 0; // nodes of a row
  for (int i = 0; i < count; ++i) {
    if (wanted[i] == 0)
      continue;
    BalanceRow& row = rows[i];
    row.nodes.reserve(expected);
    row.blocks.reserve(expected);
    const auto block = [&](int j) -> Block& {
      if (place[j] < 0) {
        place[j] = static_cast<int>(row.nodes.size());
        row.nodes.push_back(j);
        row.blocks.emplace_back(Block::Zero());
      }
      return row.blocks[place[j]];
    };
    // sigma(g X) A as a matrix on X: lambda A g^T + mu (g.A) I + mu g A^T. By columns, x and y in one register:
    // half of the time went into waiting for a matrix stored piece by piece.
    const auto add_flux = [&](Block& target, const Vector3& area, const Vector3& g, double factor, double diagonal) {
      const double to_area = factor * lambda, to_g = factor * mu;
      const Eigen::Vector2d area_xy = area.head<2>(), g_xy = g.head<2>();
      for (int c = 0; c < 3; ++c) {
        const double along_area = to_area * g[c], along_g = to_g * area[c];
        target.col(c).head<2>() += area_xy * along_area + g_xy * along_g;
        target(2, c) += area.z() * along_area + g.z() * along_g;
      }
      const double on_diagonal = to_g * g.dot(area) + diagonal;
      for (int c = 0; c < 3; ++c)
        target(c, c) += on_diagonal;
    };
    if (sides[i].empty())
      throw InputError(fmt::format("node {} at ({:.6g}, {:.6g}, {:.6g}) m has no cell: it lies outside the body", i,
                                   x[i].x(), x[i].y(), x[i].z()));
    block(i);
    for (const Side& side : sides[i]) {
      const topology::CellFace& face = cells.faces[side.face];
      const Vector3 area = side.sign * face.area;
      const Vector3 d = x[side.other] - x[i];
      const bool at_front = operators.at_front[side.face] != 0;
      // Partners of a lip pair ahead of the front are too near for a difference of theirs to mean anything.
      const bool pair = d.norm() < pair_reach * problem.nodes.spacings[i];
      const double gamma = pair ? 0 : at_front ? damping_at_front : damping;
      const double w = gamma * mu * area.dot(d) / d.squaredNorm();
      block(side.other).topLeftCorner<3, 3>().diagonal().array() -= w;
      block(i).topLeftCorner<3, 3>().diagonal().array() += w;
      if (at_front)
        for (const int node : {i, side.other})
          for (int k = supports.start[node]; k < supports.start[node + 1]; ++k)
            block(supports.nodes[k]).topLeftCorner<3, 3>().diagonal().array() +=
                (node == i ? -w : w) * supports.value[k];
      for (int k = operators.start[side.face]; k < operators.start[side.face + 1]; ++k) {
        Block& target = block(operators.nodes[k]);
        const Vector3& gradient = operators.gradient[k];
        add_flux(target, area, gradient, -1, at_front ? 0.0 : w * gradient.dot(d));
        if (mixed)
          target.block<1, 3>(3, 0) += operators.value[k] * area.transpose();
      }
      if (mixed) {
        const double smoothing = pressure_smoothing * area.norm() * d.norm() / mu;
        Block& other = block(side.other);
        other.block<3, 1>(0, 3) += 0.5 * area; // -(-p A)
        other(3, 3) -= smoothing;
        Block& own = block(i);
        own.block<3, 1>(0, 3) += 0.5 * area;
        own(3, 3) += smoothing;
      }
    }
    if (mixed) {
      block(i)(3, 3) += cells.volumes[i] / problem.material.lame_lambda();
      // Of a lip the centroid lies on the sheet: the cell's own expansion stays on its side.
      const auto add_outflow_of_node = [&](const Vector3& at, const Vector3& area) {
        for (int k = supports.start[i]; k < supports.start[i + 1]; ++k)
          block(supports.nodes[k]).block<1, 3>(3, 0) +=
              (supports.value[k] + supports.gradient[k].dot(at - x[i])) * area.transpose();
      };
      for (int l : lips[i])
        add_outflow_of_node(cells.lips[l].centroid, cells.lips[l].area);
      for (int b : boundary[i]) {
        const topology::BoundaryFace& face = cells.boundary[b];
        if (problem.incision && problem.incision->blocks(x[i], face.centroid)) {
          add_outflow_of_node(face.centroid, face.area);
          continue;
        }
        if (!evaluate(spheres, face.centroid, shape))
          throw NumericalError(fmt::format("the surface of the cell of node {} has {} supporting nodes: the nodes "
                                           "leave a hole there",
                                           i, shape.size()));
        for (int k = 0; k < shape.size(); ++k)
          block(shape.nodes[k]).block<1, 3>(3, 0) += shape.value[k] * face.area.transpose();
      }
    }
    for (const int node : row.nodes)
      place[node] = -1;
    expected = row.nodes.size() + row.nodes.size() / 4;
  }
}

} // namespace spherecut::solvers
