#include "solvers/collocation/balance_rows.hpp"

#include "solvers/collocation/face_operators.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <array>
#include <fmt/format.h>
#include <numeric>
#include <span>

namespace spherecut::solvers {

namespace {

constexpr double damping = 0.3;             // gamma
constexpr double damping_at_front = 2;      // gamma where the basis is enriched
constexpr double pair_reach = 0.01;         // nodes nearer than this, in spacings, are partners of a lip pair
constexpr double pressure_smoothing = 0.01; // alpha

using Block = Eigen::Matrix4d;

/// Axes along which a fixed region that leaves others free holds the body's surface of a cell whose node it does not
/// hold: between the nodes of a coarse set such cells reach the surface too, and what holds them there pulls at them.
std::array<bool, 3> held_beside(const Problem& problem, const topology::BoundaryFace& face,
                                const std::array<bool, 3>& of_node) {
  const Vector3 normal = face.area.normalized();
  std::array<bool, 3> held{};
  for (std::size_t a = 0; a < 3; ++a) {
    std::array<bool, 3> axis{};
    axis[a] = true;
    held[a] = problem.prescribed_region.holds(face.centroid, normal, axis);
  }
  if (held[0] && held[1] && held[2])
    return {};
  for (std::size_t a = 0; a < 3; ++a)
    held[a] = held[a] && !of_node[a];
  return held;
}

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
  std::vector<int> first_side(static_cast<std::size_t>(count) + 1, 0);
  for (const topology::CellFace& face : cells.faces) {
    ++first_side[face.first + 1];
    ++first_side[face.second + 1];
  }
  std::partial_sum(first_side.begin(), first_side.end(), first_side.begin());
  std::vector<Side> all_sides(2 * cells.faces.size());
  std::vector<int> next_side(first_side.begin(), first_side.end() - 1);
  for (int f = 0; f < std::ssize(cells.faces); ++f) {
    all_sides[next_side[cells.faces[f].first]++] = {cells.faces[f].second, 1, f};
    all_sides[next_side[cells.faces[f].second]++] = {cells.faces[f].first, -1, f};
  }
  std::vector<std::vector<int>> lips(count);
  for (int l = 0; mixed && l < std::ssize(cells.lips); ++l)
    lips[cells.lips[l].node].push_back(l);
  std::vector<std::vector<int>> boundary(count);
  for (int b = 0; b < std::ssize(cells.boundary); ++b)
    boundary[cells.boundary[b].node].push_back(b);
  std::vector<std::array<bool, 3>> held(static_cast<std::size_t>(count), {false, false, false});
  for (const Prescribed& entry : problem.prescribed)
    for (std::size_t c = 0; c < 3; ++c)
      held[entry.node][c] |= entry.components[c];

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
    const std::span<const Side> sides(all_sides.data() + first_side[i], all_sides.data() + first_side[i + 1]);
    if (sides.empty())
      throw InputError(fmt::format("node {} at ({:.6g}, {:.6g}, {:.6g}) m has no cell: it lies outside the body", i,
                                   x[i].x(), x[i].y(), x[i].z()));
    block(i);
    for (const Side& side : sides) {
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
      // Minus sigma(g X) A as a matrix on X, -(lambda A g^T + mu (g.A) I + mu g A^T), and the damping's w (g.d) I. By
      // columns, x and y in one register: half of the time went into waiting for a matrix stored piece by piece.
      const Vector3 lambda_area = -lambda * area, mu_area = -mu * area;
      const Vector3 on_diagonal = at_front ? mu_area : Vector3(mu_area + w * d);
      const Eigen::Vector2d lambda_area_xy = lambda_area.head<2>();
      for (int k = operators.start[side.face]; k < operators.start[side.face + 1]; ++k) {
        Block& target = block(operators.nodes[k]);
        const Vector3& g = operators.gradient[k];
        const Eigen::Vector2d g_xy = g.head<2>();
        for (int c = 0; c < 3; ++c) {
          target.col(c).head<2>() += lambda_area_xy * g[c] + g_xy * mu_area[c];
          target(2, c) += lambda_area.z() * g[c] + g.z() * mu_area[c];
        }
        target.diagonal().head<3>().array() += g.dot(on_diagonal);
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
    for (int b = 0; problem.prescribed_region && b < std::ssize(boundary[i]); ++b) {
      const topology::BoundaryFace& face = cells.boundary[boundary[i][b]];
      const std::array<bool, 3> axes = held_beside(problem, face, held[i]);
      if (!(axes[0] || axes[1] || axes[2]) || !evaluate(spheres, face.centroid, shape))
        continue;
      for (int k = 0; k < shape.size(); ++k) {
        const Vector3 g = shape.gradient(k);
        const Matrix3 pull = lambda * face.area * g.transpose() + mu * g.dot(face.area) * Matrix3::Identity() +
                             mu * g * face.area.transpose();
        for (int a = 0; a < 3; ++a)
          if (axes[a])
            block(shape.nodes[k]).block<1, 3>(a, 0) -= pull.row(a);
      }
      for (int a = 0; mixed && a < 3; ++a)
        if (axes[a])
          block(i)(a, 3) += face.area[a];
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
        if (problem.hiding() && problem.hiding()->blocks(x[i], face.centroid)) {
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
