// Collocation of the force balance of each node's cell (Petrov-Galerkin with Heaviside test functions).
//
// Notation: i, j nodes sharing a cell face with area vector A (from i to j), centroid x_f and d = x_j - x_i; G_f the
// operator that gives grad u_h at x_f from the nodal coefficients X; mu, lambda Lame's constants; h_i spacing.
//
// Flux through the face, in newtons, positive when it pulls cell i towards j:
//
//   t_ij = sigma(G_f X) A + gamma mu w [X_j - X_i - (G_f X) d],   w = A.d / |d|^2.
//
// The first term is second order and exact for linear fields. Alone it does not see every oscillation from node to
// node; the second vanishes for linear fields and gives the coercivity that is missing (gamma = 0 loses seeds at small
// supports; 0.1 to 0.5 give the same errors within a third). Row i states that the fluxes and the applied force
// balance, -sum_j t_ij = f_i, so all rows add up to the total force: every t_ij appears twice with opposite signs.
//
// Face fluxes are a small numerical integration (one point a face), which the paper's point collocation avoids; it buys
// convergence and forces in newtons.
//
// Near incompressibility the volumetric stress becomes an unknown p = -lambda div u, one a node, p_f = (p_i + p_j) / 2,
// with the continuity row
//
//   sum_f u_h(x_f) . A + u_h(x_b) . B_i + V_i p_i / lambda - alpha sum_f |A| |d| (p_j - p_i) / mu = 0,
//
// B_i the part of the body's surface that belongs to the cell, V_i its volume.
#include "solvers/elastic_body.hpp"
#include "solvers/factorisation.hpp"
#include "topology/errors.hpp"
#include "topology/voronoi_cells.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr double damping = 0.3;             // gamma
constexpr double pressure_smoothing = 0.01; // alpha
constexpr double mixed_above = 0.40;        // Poisson ratio from which the pressure unknown is used
constexpr double default_support_radius = 1.8;

using Block = Eigen::Matrix4d;

class Collocation final : public ElasticBody {
 public:
  Collocation(Problem problem, const DiscretisationOptions& options)
      : ElasticBody(std::move(problem), options.support_radius > 0 ? options.support_radius : default_support_radius,
                    options.sight),
        mixed_(problem_.material.poisson_ratio > mixed_above), stride_(mixed_ ? 4 : 3) {
    const Stopwatch assembly;
    const NodeCloud& nodes = problem_.nodes;
    cells_ = topology::voronoi_cells(nodes.positions, nodes.spacings, *problem_.domain);
    constrained_.assign(nodes.size(), {false, false, false});
    for (const Prescribed& entry : problem_.prescribed)
      for (int c = 0; c < 3; ++c)
        constrained_[entry.node][c] = constrained_[entry.node][c] || entry.components[c];
    assemble_loads();
    assemble_balance();
    const SparseMatrix system = constrained_system();
    report_.unknowns = static_cast<int>(system.rows());
    report_.matrix_nonzeros = system.nonZeros();
    report_.assembly_seconds = assembly.seconds();
    const Stopwatch factor;
    factorisation_ = factor_general(system);
    report_.factor_nonzeros = factorisation_->nonzeros();
    report_.factor_seconds = factor.seconds();
    if (options.estimate_condition) {
      report_.condition_estimate =
          spherecut::solvers::condition_estimate(*factorisation_, one_norm(system), report_.unknowns);
      require_regular(report_);
    }
  }

  Method method() const override { return Method::collocation; }
  Field solve() const override { return solve_for(loads_, 1, prescribed_values(problem_)); }
  std::vector<Field> force_responses(const std::vector<int>& candidates) const override;
  Field prescribed_response(const std::vector<Vector3>& values) const override {
    return solve_for({}, 0, prescribed_values(problem_, values));
  }
  std::vector<Vector3> constraint_forces(const Field& field) const override;
  double residual(const Field& field, const std::vector<int>& loaded_nodes,
                  const std::vector<Vector3>& nodal_forces) const override;

 private:
  void assemble_loads();
  void assemble_balance();
  [[nodiscard]] SparseMatrix constrained_system() const;
  [[nodiscard]] double constraint_scale(int node) const {
    return problem_.material.young_modulus * problem_.nodes.spacings[node];
  }
  [[nodiscard]] VectorX right_hand_side(const std::vector<Vector3>& forces) const {
    VectorX right = VectorX::Zero(report_.unknowns);
    for (std::size_t i = 0; i < forces.size(); ++i)
      for (int c = 0; c < 3; ++c)
        if (!constrained_[i][c])
          right[stride_ * static_cast<Eigen::Index>(i) + c] = forces[i][c];
    return right;
  }
  [[nodiscard]] Field solve_for(const std::vector<Vector3>& forces, double load_factor,
                                const VectorX& prescribed) const {
    VectorX right = right_hand_side(forces);
    for (std::size_t k = 0; k < problem_.prescribed.size(); ++k) {
      const Prescribed& entry = problem_.prescribed[k];
      for (int c = 0; c < 3; ++c)
        if (entry.components[c])
          right[stride_ * entry.node + c] =
              constraint_scale(entry.node) * prescribed[3 * static_cast<Eigen::Index>(k) + c];
    }
    return field_of(factorisation_->solve(right).col(0), load_factor, prescribed);
  }
  [[nodiscard]] Field field_of(const VectorX& unknowns, double load_factor, const VectorX& prescribed) const {
    const int count = problem_.nodes.size();
    Field field;
    field.load_factor = load_factor;
    field.prescribed = prescribed;
    field.coefficients.resize(3 * count);
    if (mixed_)
      field.pressure.resize(count);
    for (int i = 0; i < count; ++i) {
      field.coefficients.segment<3>(3 * i) = unknowns.segment<3>(stride_ * i);
      if (mixed_)
        field.pressure[i] = unknowns[stride_ * i + 3];
    }
    require_finite(field, report_);
    return field;
  }
  /// Unreplaced balance of cell i: the force that must act on it from outside the body for the field to be in balance.
  [[nodiscard]] Vector3 balance(int i, const Field& field) const {
    Vector3 force = Vector3::Zero();
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const int j = columns_[k];
      force += blocks_[k].topLeftCorner<3, 3>() * field.coefficients.segment<3>(3 * j);
      if (mixed_)
        force += blocks_[k].block<3, 1>(0, 3) * field.pressure[j];
    }
    return force;
  }

  bool mixed_;
  int stride_;
  topology::CellComplex cells_;
  std::vector<std::array<bool, 3>> constrained_;
  std::vector<Vector3> loads_; // N, body force and traction on each cell
  std::vector<int> row_start_, columns_;
  std::vector<Block> blocks_; // rows 0-2 balance (N per m, N per Pa), row 3 continuity
  std::unique_ptr<Factorisation> factorisation_;
};

void Collocation::assemble_loads() {
  loads_.assign(problem_.nodes.size(), Vector3::Zero());
  const std::vector<Vector3>& x = problem_.nodes.positions;
  // Midpoints would cost as much accuracy as the whole discretisation: loads are integrated over the cells' own
  // polygons, by a quadratic rule on tetrahedra from the node and on triangles.
  const auto fan = [](const std::vector<Vector3>& corners, int begin, int end, const Vector3& centre, auto&& visit) {
    for (int k = begin; k < end; ++k)
      visit(centre, corners[k], corners[k + 1 < end ? k + 1 : begin]);
  };
  if (problem_.loads.body_force) {
    const auto add_cone = [&](int node, const Vector3& a, const Vector3& b, const Vector3& c) {
      constexpr double near = 0.5854101966249685, far = 0.1381966011250105;
      const std::array<Vector3, 4> corner{x[node], a, b, c};
      const Vector3 sum = corner[0] + corner[1] + corner[2] + corner[3];
      const double volume = std::abs((a - x[node]).dot((b - x[node]).cross(c - x[node]))) / 6;
      if (volume <= 0)
        return;
      for (const Vector3& vertex : corner)
        loads_[node] += 0.25 * volume * problem_.loads.body_force(far * sum + (near - far) * vertex);
    };
    for (int f = 0; f < std::ssize(cells_.faces); ++f)
      for (int node : {cells_.faces[f].first, cells_.faces[f].second})
        fan(cells_.face_corners, cells_.face_start[f], cells_.face_start[f + 1], cells_.faces[f].centroid,
            [&](const Vector3& a, const Vector3& b, const Vector3& c) { add_cone(node, a, b, c); });
    for (int f = 0; f < std::ssize(cells_.boundary); ++f)
      fan(cells_.boundary_corners, cells_.boundary_start[f], cells_.boundary_start[f + 1], cells_.boundary[f].centroid,
          [&](const Vector3& a, const Vector3& b, const Vector3& c) { add_cone(cells_.boundary[f].node, a, b, c); });
  }
  if (problem_.loads.traction)
    for (int f = 0; f < std::ssize(cells_.boundary); ++f) {
      const topology::BoundaryFace& face = cells_.boundary[f];
      const double face_area = face.area.norm();
      if (face_area <= 0)
        continue;
      const Vector3 normal = face.area / face_area;
      if (face.plane < 0) {
        loads_[face.node] += face_area * problem_.loads.traction(face.centroid, normal);
        continue;
      }
      fan(cells_.boundary_corners, cells_.boundary_start[f], cells_.boundary_start[f + 1], face.centroid,
          [&](const Vector3& a, const Vector3& b, const Vector3& c) {
            const double triangle = 0.5 * (b - a).cross(c - a).norm();
            for (const Vector3& point : {Vector3(0.5 * (a + b)), Vector3(0.5 * (b + c)), Vector3(0.5 * (c + a))})
              loads_[face.node] += triangle / 3 * problem_.loads.traction(point, normal);
          });
    }
}

void Collocation::assemble_balance() {
  const int count = problem_.nodes.size();
  const std::vector<Vector3>& x = problem_.nodes.positions;
  const double mu = problem_.material.shear_modulus();
  const double lambda = mixed_ ? 0 : problem_.material.lame_lambda();
  struct Side {
    int other;
    double sign; // of the stored area
    int face;
  };
  std::vector<std::vector<Side>> sides(count);
  for (int f = 0; f < std::ssize(cells_.faces); ++f) {
    sides[cells_.faces[f].first].push_back({cells_.faces[f].second, 1, f});
    sides[cells_.faces[f].second].push_back({cells_.faces[f].first, -1, f});
  }
  std::vector<std::vector<int>> boundary(count);
  for (int b = 0; b < std::ssize(cells_.boundary); ++b)
    boundary[cells_.boundary[b].node].push_back(b);

  std::vector<int> face_start(1, 0), face_nodes;
  std::vector<double> face_value;
  std::vector<Vector3> face_gradient;
  ShapeFunctions shape;
  for (const topology::CellFace& face : cells_.faces) {
    if (!evaluate(spheres_, face.centroid, shape))
      throw NumericalError(
          fmt::format("the face between nodes {} and {} has {} supporting nodes: the nodes leave a hole there",
                      face.first, face.second, shape.size()));
    for (int k = 0; k < shape.size(); ++k) {
      face_nodes.push_back(shape.nodes[k]);
      face_value.push_back(shape.value[k]);
      face_gradient.push_back(shape.gradient(k));
    }
    face_start.push_back(static_cast<int>(face_nodes.size()));
  }
  row_start_.assign(1, 0);
  row_start_.reserve(count + 1);
  std::vector<int> place(count, -1);
  for (int i = 0; i < count; ++i) {
    const int row_begin = static_cast<int>(columns_.size());
    const auto block = [&](int j) -> Block& {
      if (place[j] < 0) {
        place[j] = static_cast<int>(columns_.size());
        columns_.push_back(j);
        blocks_.emplace_back(Block::Zero());
      }
      return blocks_[place[j]];
    };
    // sigma(g X) A as a matrix on X: lambda A g^T + mu (g.A) I + mu g A^T.
    const auto add_flux = [&](Block& target, const Vector3& area, const Vector3& g, double factor, double diagonal) {
      const Vector3 lambda_area = factor * lambda * area, mu_g = factor * mu * g;
      Matrix3 flux = lambda_area * g.transpose() + mu_g * area.transpose();
      flux.diagonal().array() += mu_g.dot(area) + diagonal;
      target.topLeftCorner<3, 3>() += flux;
    };
    if (sides[i].empty())
      throw InputError(fmt::format("node {} at ({:.6g}, {:.6g}, {:.6g}) m has no cell: it lies outside the body", i,
                                   x[i].x(), x[i].y(), x[i].z()));
    block(i);
    for (const Side& side : sides[i]) {
      const topology::CellFace& face = cells_.faces[side.face];
      const Vector3 area = side.sign * face.area;
      const Vector3 d = x[side.other] - x[i];
      const double w = damping * mu * area.dot(d) / d.squaredNorm();
      block(side.other).topLeftCorner<3, 3>().diagonal().array() -= w;
      block(i).topLeftCorner<3, 3>().diagonal().array() += w;
      for (int k = face_start[side.face]; k < face_start[side.face + 1]; ++k) {
        Block& target = block(face_nodes[k]);
        add_flux(target, area, face_gradient[k], -1, w * face_gradient[k].dot(d));
        if (mixed_)
          target.block<1, 3>(3, 0) += face_value[k] * area.transpose();
      }
      if (mixed_) {
        const double smoothing = pressure_smoothing * area.norm() * d.norm() / mu;
        Block& other = block(side.other);
        other.block<3, 1>(0, 3) += 0.5 * area; // -(-p A)
        other(3, 3) -= smoothing;
        Block& own = block(i);
        own.block<3, 1>(0, 3) += 0.5 * area;
        own(3, 3) += smoothing;
      }
    }
    if (mixed_) {
      block(i)(3, 3) += cells_.volumes[i] / problem_.material.lame_lambda();
      for (int b : boundary[i]) {
        if (!evaluate(spheres_, cells_.boundary[b].centroid, shape))
          throw NumericalError(fmt::format("the surface of the cell of node {} has {} supporting nodes: the nodes "
                                           "leave a hole there",
                                           i, shape.size()));
        for (int k = 0; k < shape.size(); ++k)
          block(shape.nodes[k]).block<1, 3>(3, 0) += shape.value[k] * cells_.boundary[b].area.transpose();
      }
    }
    for (int k = row_begin; k < std::ssize(columns_); ++k)
      place[columns_[k]] = -1;
    row_start_.push_back(static_cast<int>(columns_.size()));
  }
}

SparseMatrix Collocation::constrained_system() const {
  const int count = problem_.nodes.size();
  Eigen::SparseMatrix<double, Eigen::RowMajor> rows(stride_ * count, stride_ * count);
  std::vector<std::pair<int, int>> order; // (column node, entry)
  Eigen::VectorXi sizes(stride_ * count);
  for (int i = 0; i < count; ++i)
    for (int c = 0; c < stride_; ++c)
      sizes[stride_ * i + c] = c < 3 && constrained_[i][c] ? supports_.start[i + 1] - supports_.start[i]
                                                           : stride_ * (row_start_[i + 1] - row_start_[i]);
  rows.reserve(sizes);
  for (int i = 0; i < count; ++i) {
    order.clear();
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
      order.emplace_back(columns_[k], k);
    std::sort(order.begin(), order.end());
    const double continuity_scale = problem_.material.shear_modulus() / problem_.nodes.spacings[i];
    for (int c = 0; c < stride_; ++c) {
      const int row = stride_ * i + c;
      if (c < 3 && constrained_[i][c]) {
        for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
          rows.insert(row, stride_ * supports_.nodes[k] + c) = constraint_scale(i) * supports_.value[k];
        continue;
      }
      const double scale = c == 3 ? continuity_scale : 1;
      for (const auto& [column, k] : order)
        for (int e = 0; e < stride_; ++e)
          rows.insert(row, stride_ * column + e) = scale * blocks_[k](c, e);
    }
  }
  rows.makeCompressed();
  return SparseMatrix(rows);
}

std::vector<Field> Collocation::force_responses(const std::vector<int>& candidates) const {
  const VectorX no_displacement = VectorX::Zero(3 * std::ssize(problem_.prescribed));
  MatrixX right = MatrixX::Zero(report_.unknowns, 3 * std::ssize(candidates));
  for (Eigen::Index c = 0; c < std::ssize(candidates); ++c)
    for (int axis = 0; axis < 3; ++axis)
      if (!constrained_[candidates[c]][axis])
        right(stride_ * candidates[c] + axis, 3 * c + axis) = 1;
  const MatrixX solution = factorisation_->solve(right);
  std::vector<Field> responses;
  responses.reserve(3 * candidates.size());
  for (Eigen::Index k = 0; k < solution.cols(); ++k)
    responses.push_back(field_of(solution.col(k), 0, no_displacement));
  return responses;
}

std::vector<Vector3> Collocation::constraint_forces(const Field& field) const {
  std::vector<Vector3> forces;
  forces.reserve(problem_.prescribed.size());
  for (const Prescribed& entry : problem_.prescribed) {
    Vector3 force = balance(entry.node, field) - field.load_factor * loads_[entry.node];
    for (int c = 0; c < 3; ++c)
      if (!entry.components[c])
        force[c] = 0;
    forces.push_back(force);
  }
  return forces;
}

double Collocation::residual(const Field& field, const std::vector<int>& loaded_nodes,
                             const std::vector<Vector3>& nodal_forces) const {
  std::vector<Vector3> applied = loads_;
  for (Vector3& force : applied)
    force *= field.load_factor;
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k)
    applied[loaded_nodes[k]] += nodal_forces[k];
  double worst = 0, largest = 0;
  for (int i = 0; i < problem_.nodes.size(); ++i) {
    const Vector3 force = balance(i, field);
    largest = std::max({largest, applied[i].cwiseAbs().maxCoeff(), force.cwiseAbs().maxCoeff()});
    for (int c = 0; c < 3; ++c)
      if (!constrained_[i][c])
        worst = std::max(worst, std::abs(force[c] - applied[i][c]));
  }
  return largest > 0 ? worst / largest : 0;
}

} // namespace

std::unique_ptr<Discretisation> make_collocation(Problem problem, const DiscretisationOptions& options) {
  require_domain(problem);
  return std::make_unique<Collocation>(std::move(problem), options);
}

} // namespace spherecut::solvers
