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
// Face fluxes are a small numerical integration (one point a face), which the paper's point collocation avoids; it buys
// convergence and forces in newtons.
//
// Near incompressibility the volumetric stress becomes an unknown p = -lambda div u, one a node, p_f = (p_i + p_j) / 2,
// with the continuity row
//
//   sum_f u_h(x_f) . A + u_h(x_b) . B_i + V_i p_i / lambda - alpha sum_f |A| |d| (p_j - p_i) / mu = 0,
//
// B_i the part of the body's surface that belongs to the cell, V_i its volume, and tr(e0) V_i on the right for an
// initial strain e0. The system holds p h_i / E instead of p: its entries then are E h whatever the units.
//
// A cut: lip nodes stand 1e-4 h off the sheet, so the face between partners is the sheet. Faces between nodes that the
// sheet keeps apart carry no flux but the traction tau on the lips, -sum_j t_ij = f_i + tau; G_f sees what the sight
// rule lets it see. Where the basis is enriched the second term measures the coefficients against the field instead of
// against a linear one, so that it vanishes for the singular field too,
//
//   gamma mu w [X_j - u_h(x_j) - X_i + u_h(x_i)],
//
// and G_f is a mean over points that crowd towards the front (face_operators.hpp). Faces between partners end at the
// front: what of them lies ahead of it carries flux. Measured on a straight front with h = 0.14 (350 nodes, ten seeds):
// K within 3 %, the opening within 2 %. With one point a face K in mode II or III is 6 to 8 % too large; faces that end
// half way to the next nodes made a grown cut 11 % too soft; an enrichment that reaches 4 spacings lets the corners of
// lips flap (two node sets 20 % apart, against 2 %); gamma = 0.3 at the front loses seeds; means over the nodes'
// gradients are useless there.
#include "solvers/collocation.hpp"

#include "solvers/cell_loads.hpp"
#include "solvers/face_operators.hpp"
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
constexpr double damping_at_front = 2;      // gamma where the basis is enriched
constexpr double front_radius_factor = 1.2; // supports there are larger by this
constexpr double pair_reach = 0.01;         // nodes nearer than this, in spacings, are partners of a lip pair
constexpr double pressure_smoothing = 0.01; // alpha
constexpr double mixed_above = 0.40;        // Poisson ratio from which the pressure unknown is used
constexpr double default_support_radius = 1.8;

using Block = Eigen::Matrix4d;

class Collocation final : public ElasticBody {
 public:
  Collocation(Problem problem, const DiscretisationOptions& options)
      : ElasticBody(std::move(problem), options.support_radius > 0 ? options.support_radius : default_support_radius,
                    options.sight, options.sight == SightRule::enriched ? front_radius_factor : 1),
        mixed_(problem_.material.poisson_ratio > mixed_above), stride_(mixed_ ? 4 : 3) {
    const Stopwatch assembly;
    const NodeCloud& nodes = problem_.nodes;
    cells_ = topology::voronoi_cells(nodes.positions, nodes.spacings, *problem_.domain, problem_.incision.get());
    constrained_.assign(nodes.size(), {false, false, false});
    for (const Prescribed& entry : problem_.prescribed)
      for (int c = 0; c < 3; ++c)
        constrained_[entry.node][c] = constrained_[entry.node][c] || entry.components[c];
    loads_ = cell_loads(cells_, problem_, stress_of(problem_.loads.initial_strain));
    assemble_balance();
    treat_pieces(options.unheld);
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
  [[nodiscard]] CellBalance cell_balance() const;
  Field solve() const override { return solve_for(loads_, 1, prescribed_values(problem_)); }
  double load_work(const Field& field) const override {
    const VectorX displacements = nodal_displacements(field);
    const auto of = [&](std::size_t node) { return displacements.segment<3>(3 * static_cast<Eigen::Index>(node)); };
    double work = 0;
    for (std::size_t i = 0; i < loads_.size(); ++i)
      work += loads_[i].dot(of(i));
    if (mixed_) { // what the continuity rows take of an initial strain: a pressure on the surface and the lips
      double outflow = 0;
      for (const topology::BoundaryFace& face : cells_.boundary)
        outflow += face.area.dot(of(face.node));
      for (const topology::LipFace& face : cells_.lips)
        outflow += face.area.dot(of(face.node));
      work += problem_.material.lame_lambda() * problem_.loads.initial_strain.trace() * outflow;
    }
    return field.load_factor * work;
  }
  std::vector<Field> force_responses(const std::vector<int>& candidates) const override;
  std::vector<Field> pattern_responses(const std::vector<ForcePattern>& patterns) const override;
  Field prescribed_response(const std::vector<Vector3>& values) const override {
    return solve_for({}, 0, prescribed_values(problem_, values));
  }
  std::vector<Vector3> constraint_forces(const Field& field) const override;
  double residual(const Field& field, const std::vector<int>& loaded_nodes,
                  const std::vector<Vector3>& nodal_forces) const override;

 private:
  [[nodiscard]] std::vector<Field> responses_to(const MatrixX& right) const;
  void assemble_balance();
  /// Finds the pieces; springs hold those that nothing holds, or their unknowns are dropped.
  void treat_pieces(UnheldPieces unheld);
  [[nodiscard]] SparseMatrix constrained_system() const;
  /// Stress of a strain as far as the displacements carry it: without the pressure where that is an unknown.
  [[nodiscard]] Matrix3 stress_of(const Matrix3& strain) const {
    const double lambda = mixed_ ? 0 : problem_.material.lame_lambda();
    return lambda * strain.trace() * Matrix3::Identity() +
           problem_.material.shear_modulus() * (strain + strain.transpose());
  }
  [[nodiscard]] double constraint_scale(int node) const {
    return problem_.material.young_modulus * problem_.nodes.spacings[node];
  }
  [[nodiscard]] double continuity_scale(int node) const {
    return problem_.material.shear_modulus() / problem_.nodes.spacings[node];
  }
  [[nodiscard]] double pressure_scale(int node) const { // Pa per unit of the pressure's unknown, a length
    return problem_.material.young_modulus / problem_.nodes.spacings[node];
  }
  [[nodiscard]] double expansion(int node, double load_factor) const { // right-hand side of the continuity, m3
    return load_factor * problem_.loads.initial_strain.trace() * cells_.volumes[node];
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
    for (int i = 0; mixed_ && i < problem_.nodes.size(); ++i)
      right[stride_ * i + 3] = dropped_[i] != 0 ? 0 : continuity_scale(i) * expansion(i, load_factor);
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
        field.pressure[i] = pressure_scale(i) * unknowns[stride_ * i + 3];
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
  /// What the continuity of cell i misses, m3.
  [[nodiscard]] double discontinuity(int i, const Field& field) const {
    double missing = -expansion(i, field.load_factor);
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
      missing += blocks_[k].block<1, 3>(3, 0).dot(field.coefficients.segment<3>(3 * columns_[k])) +
                 blocks_[k](3, 3) * field.pressure[columns_[k]];
    return missing;
  }

  bool mixed_;
  int stride_;
  topology::CellComplex cells_;
  std::vector<std::array<bool, 3>> constrained_; // or dropped
  std::vector<Anchor> anchors_;                  // springs E h that hold pieces, part of the blocks
  std::vector<char> dropped_;                    // per node: its piece is held by nothing and taken out
  std::vector<Vector3> loads_;                   // N, loads on each cell
  std::vector<int> row_start_, columns_;
  std::vector<Block> blocks_; // rows 0-2 balance (N per m, N per Pa), row 3 continuity
  std::unique_ptr<Factorisation> factorisation_;
};

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
  std::vector<std::vector<int>> lips(count);
  for (int l = 0; l < std::ssize(cells_.lips); ++l)
    lips[cells_.lips[l].node].push_back(l);
  std::vector<std::vector<int>> boundary(count);
  for (int b = 0; b < std::ssize(cells_.boundary); ++b)
    boundary[cells_.boundary[b].node].push_back(b);

  const FaceOperators operators = face_operators(cells_, problem_, spheres_, supports_);
  ShapeFunctions shape;
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
      const bool at_front = operators.at_front[side.face] != 0;
      // Partners of a lip pair ahead of the front are too near for a difference of theirs to mean anything.
      const bool pair = d.norm() < pair_reach * problem_.nodes.spacings[i];
      const double gamma = pair ? 0 : at_front ? damping_at_front : damping;
      const double w = gamma * mu * area.dot(d) / d.squaredNorm();
      block(side.other).topLeftCorner<3, 3>().diagonal().array() -= w;
      block(i).topLeftCorner<3, 3>().diagonal().array() += w;
      if (at_front)
        for (const int node : {i, side.other})
          for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
            block(supports_.nodes[k]).topLeftCorner<3, 3>().diagonal().array() +=
                (node == i ? -w : w) * supports_.value[k];
      for (int k = operators.start[side.face]; k < operators.start[side.face + 1]; ++k) {
        Block& target = block(operators.nodes[k]);
        const Vector3& gradient = operators.gradient[k];
        add_flux(target, area, gradient, -1, at_front ? 0.0 : w * gradient.dot(d));
        if (mixed_)
          target.block<1, 3>(3, 0) += operators.value[k] * area.transpose();
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
      // Of a lip the centroid lies on the sheet: the cell's own expansion stays on its side.
      const auto add_outflow_of_node = [&](const Vector3& at, const Vector3& area) {
        for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
          block(supports_.nodes[k]).block<1, 3>(3, 0) +=
              (supports_.value[k] + supports_.gradient[k].dot(at - x[i])) * area.transpose();
      };
      for (int l : lips[i])
        add_outflow_of_node(cells_.lips[l].centroid, cells_.lips[l].area);
      for (int b : boundary[i]) {
        const topology::BoundaryFace& face = cells_.boundary[b];
        if (problem_.incision && problem_.incision->blocks(x[i], face.centroid)) {
          add_outflow_of_node(face.centroid, face.area);
          continue;
        }
        if (!evaluate(spheres_, face.centroid, shape))
          throw NumericalError(fmt::format("the surface of the cell of node {} has {} supporting nodes: the nodes "
                                           "leave a hole there",
                                           i, shape.size()));
        for (int k = 0; k < shape.size(); ++k)
          block(shape.nodes[k]).block<1, 3>(3, 0) += shape.value[k] * face.area.transpose();
      }
    }
    for (int k = row_begin; k < std::ssize(columns_); ++k)
      place[columns_[k]] = -1;
    row_start_.push_back(static_cast<int>(columns_.size()));
  }
}

void Collocation::treat_pieces(UnheldPieces unheld) {
  const int count = problem_.nodes.size();
  std::vector<std::pair<int, int>> couplings;
  const auto couple = [&](int i, int j) {
    couplings.emplace_back(i, j);
    couplings.emplace_back(j, i);
  };
  for (int i = 0; i < count; ++i) {
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
      couple(i, columns_[k]);
    for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
      couple(i, supports_.nodes[k]);
  }
  std::sort(couplings.begin(), couplings.end());
  std::vector<int> start(1, 0), neighbours;
  for (std::size_t k = 0; k < couplings.size(); ++k) {
    if (k == 0 || couplings[k] != couplings[k - 1])
      neighbours.push_back(couplings[k].second);
    if (k + 1 == couplings.size() || couplings[k + 1].first != couplings[k].first)
      start.push_back(static_cast<int>(neighbours.size()));
  }
  report_.pieces = find_pieces(problem_, start, neighbours);
  dropped_.assign(count, 0);
  if (unheld == UnheldPieces::refuse)
    require_held(report_.pieces);
  for (const Piece& piece : report_.pieces) {
    if (piece.held)
      continue;
    if (unheld == UnheldPieces::hold) {
      for (const Anchor& anchor : anchors_of(piece, problem_.nodes)) { // the first block of a row is the node's own
        anchors_.push_back(anchor);
        blocks_[row_start_[anchor.node]].topLeftCorner<3, 3>() +=
            constraint_scale(anchor.node) * anchor.direction * anchor.direction.transpose();
      }
      continue;
    }
    for (const int node : piece.nodes) {
      dropped_[node] = 1;
      constrained_[node] = {true, true, true};
      loads_[node].setZero();
    }
  }
}

CellBalance Collocation::cell_balance() const {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < problem_.nodes.size(); ++i)
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
      for (int r = 0; r < stride_; ++r)
        for (int c = 0; c < stride_; ++c)
          entries.emplace_back(stride_ * i + r, stride_ * columns_[k] + c, blocks_[k](r, c));
  CellBalance balance{SparseMatrix(report_.unknowns, report_.unknowns), stride_, anchors_};
  balance.rows.setFromTriplets(entries.begin(), entries.end());
  return balance;
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
    for (int c = 0; c < stride_; ++c) {
      const int row = stride_ * i + c;
      if (dropped_[i] != 0) {
        rows.insert(row, row) = constraint_scale(i);
        continue;
      }
      if (c < 3 && constrained_[i][c]) {
        for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
          rows.insert(row, stride_ * supports_.nodes[k] + c) = constraint_scale(i) * supports_.value[k];
        continue;
      }
      const double scale = c == 3 ? continuity_scale(i) : 1;
      for (const auto& [column, k] : order)
        for (int e = 0; e < stride_; ++e)
          rows.insert(row, stride_ * column + e) = scale * (e == 3 ? pressure_scale(column) : 1) * blocks_[k](c, e);
    }
  }
  rows.makeCompressed();
  return SparseMatrix(rows);
}

std::vector<Field> Collocation::responses_to(const MatrixX& right) const {
  const VectorX no_displacement = VectorX::Zero(3 * std::ssize(problem_.prescribed));
  const MatrixX solution = factorisation_->solve(right);
  std::vector<Field> responses;
  responses.reserve(static_cast<std::size_t>(solution.cols()));
  for (Eigen::Index k = 0; k < solution.cols(); ++k)
    responses.push_back(field_of(solution.col(k), 0, no_displacement));
  return responses;
}

std::vector<Field> Collocation::force_responses(const std::vector<int>& candidates) const {
  MatrixX right = MatrixX::Zero(report_.unknowns, 3 * std::ssize(candidates));
  for (Eigen::Index c = 0; c < std::ssize(candidates); ++c)
    for (int axis = 0; axis < 3; ++axis)
      if (!constrained_[candidates[c]][axis])
        right(stride_ * candidates[c] + axis, 3 * c + axis) = 1;
  return responses_to(right);
}

// A force at a point goes to the cells around it in the shares of the shape functions there, which keep its sum and,
// since they reproduce linear fields, its moment.
std::vector<Field> Collocation::pattern_responses(const std::vector<ForcePattern>& patterns) const {
  const MatrixX loads = pattern_loads(spheres_, patterns);
  MatrixX right = MatrixX::Zero(report_.unknowns, loads.cols());
  for (int i = 0; i < problem_.nodes.size(); ++i)
    for (int c = 0; c < 3; ++c)
      if (!constrained_[i][c])
        right.row(stride_ * i + c) = loads.row(3 * i + c);
  return responses_to(right);
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
    if (mixed_ && dropped_[i] == 0)
      worst = std::max(worst, continuity_scale(i) * std::abs(discontinuity(i, field)));
  }
  return largest > 0 ? worst / largest : 0;
}

} // namespace

CellBalance cell_balance_of(const Discretisation& body) {
  const auto* collocation = dynamic_cast<const Collocation*>(&body);
  if (collocation == nullptr)
    throw InputError(
        fmt::format("the balance of cells belongs to the method collocation, not to '{}'", to_string(body.method())));
  return collocation->cell_balance();
}

std::unique_ptr<Discretisation> make_collocation(Problem problem, const DiscretisationOptions& options) {
  require_domain(problem);
  return std::make_unique<Collocation>(std::move(problem), options);
}

} // namespace spherecut::solvers
