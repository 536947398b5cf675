#include "solvers/collocation/body.hpp"

#include "solvers/algebra/elimination_order.hpp"
#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/cell_loads.hpp"
#include "solvers/body/surface_patches.hpp"
#include "topology/base/errors.hpp"
#include "topology/cells/voronoi_cells.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::solvers {

Collocation::Collocation(Problem problem, const DiscretisationOptions& options)
    : ElasticBody(std::move(problem), Method::collocation,
                  options.support_radius > 0 ? options.support_radius : default_collocation_radius, options.sight),
      mixed_(problem_.material.poisson_ratio > mixed_above), stride_(mixed_ ? 4 : 3) {
  const Stopwatch assembly;
  const NodeCloud& nodes = problem_.nodes;
  cells_ = topology::voronoi_cells(nodes.positions, nodes.spacings, *problem_.domain, problem_.hiding().get());
  find_constrained();
  loads_ = cell_loads(cells_, problem_, stress_of(problem_.loads.initial_strain));
  assemble_rows(problem_, cells_, spheres_, supports_, mixed_, rows_);
  const NodeGraph graph = coupled_nodes();
  treat_pieces(graph, options.unheld);
  report_.unknowns = stride_ * nodes.size();
  const SparseMatrix system = constrained_system();
  report_.matrix_nonzeros = system.nonZeros();
  report_.assembly_seconds = assembly.seconds();
  const Stopwatch factor;
  factorisation_ = factor_general(system, elimination_order(graph));
  report_.factor_nonzeros = factorisation_->nonzeros();
  report_.factor_seconds = factor.seconds();
  if (options.estimate_condition) {
    report_.condition_estimate =
        spherecut::solvers::condition_estimate(*factorisation_, one_norm(system), report_.unknowns);
    require_regular(report_);
  }
}

void Collocation::find_constrained() {
  constrained_.assign(problem_.nodes.size(), {false, false, false});
  for (const Prescribed& entry : problem_.prescribed)
    for (int c = 0; c < 3; ++c)
      constrained_[entry.node][c] = constrained_[entry.node][c] || entry.components[c];
}

double Collocation::load_work(const Field& field) const {
  require_own(field);
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

Collocation::NodeGraph Collocation::coupled_nodes() const {
  const int count = problem_.nodes.size();
  const auto couplings = [&](const auto& couple) {
    for (int i = 0; i < count; ++i) {
      const auto& held = constrained_[i]; // those of its rows are the ones of its support
      if (mixed_ || !(held[0] && held[1] && held[2]))
        for (const int j : rows_[i].nodes)
          couple(i, j);
      if (held[0] || held[1] || held[2])
        for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
          couple(i, supports_.nodes[k]);
    }
  };
  // Both ways, as often as they come; then each once.
  std::vector<int> start(static_cast<std::size_t>(count) + 1, 0);
  couplings([&](int i, int j) {
    ++start[i + 1];
    ++start[j + 1];
  });
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<int> all(static_cast<std::size_t>(start.back())), next(start.begin(), start.end() - 1);
  couplings([&](int i, int j) {
    all[next[i]++] = j;
    all[next[j]++] = i;
  });
  NodeGraph graph{{0}, {}};
  std::vector<int> seen(static_cast<std::size_t>(count), -1);
  for (int i = 0; i < count; ++i) {
    for (int k = start[i]; k < start[i + 1]; ++k)
      if (seen[all[k]] != i) {
        seen[all[k]] = i;
        graph.neighbours.push_back(all[k]);
      }
    graph.start.push_back(static_cast<int>(graph.neighbours.size()));
  }
  return graph;
}

std::vector<int> Collocation::elimination_order(const NodeGraph& graph) const {
  std::vector<int> order;
  order.reserve(static_cast<std::size_t>(stride_) * problem_.nodes.positions.size());
  for (const int node : fill_reducing_ordering(graph.start, graph.neighbours))
    for (int c = 0; c < stride_; ++c)
      order.push_back(stride_ * node + c);
  return order;
}

void Collocation::treat_pieces(const NodeGraph& graph, UnheldPieces unheld) {
  const int count = problem_.nodes.size();
  report_.pieces = find_pieces(problem_, graph.start, graph.neighbours);
  dropped_.assign(count, 0);
  if (unheld == UnheldPieces::refuse)
    require_held(report_.pieces);
  for (const Piece& piece : report_.pieces) {
    if (piece.held)
      continue;
    if (unheld == UnheldPieces::hold) {
      for (const Anchor& anchor : anchors_of(piece, problem_.nodes)) { // the first block of a row is the node's own
        anchors_.push_back(anchor);
        rows_[anchor.node].blocks.front().topLeftCorner<3, 3>() += anchor_stiffness(anchor);
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
    for (std::size_t k = 0; k < rows_[i].nodes.size(); ++k)
      for (int r = 0; r < stride_; ++r)
        for (int c = 0; c < stride_; ++c)
          entries.emplace_back(stride_ * i + r, stride_ * rows_[i].nodes[k] + c, rows_[i].blocks[k](r, c));
  CellBalance balance{SparseMatrix(report_.unknowns, report_.unknowns), stride_, anchors_};
  balance.rows.setFromTriplets(entries.begin(), entries.end());
  return balance;
}

SparseMatrix Collocation::constrained_system() const {
  const int count = problem_.nodes.size(), size = stride_ * count;
  SparseMatrix system(size, size);
  // Rows come in ascending order, and so do the entries of every column; blocks column by column, as they are stored.
  const auto has_constraints = [&](int i) { return constrained_[i][0] || constrained_[i][1] || constrained_[i][2]; };
  std::vector<int> next(static_cast<std::size_t>(size) + 1, 0);
  for (int i = 0; i < count; ++i) {
    if (has_constraints(i))
      visit_rows(i, [&](int /*row*/, int column, double /*value*/) { ++next[column + 1]; });
    else
      for (const int node : rows_[i].nodes)
        for (int e = 0; e < stride_; ++e)
          next[stride_ * node + e + 1] += stride_;
  }
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::copy(next.begin(), next.end(), system.outerIndexPtr());
  system.resizeNonZeros(next.back());
  int* const rows = system.innerIndexPtr();
  double* const values = system.valuePtr();
  for (int i = 0; i < count; ++i) {
    if (has_constraints(i)) {
      visit_rows(i, [&](int c, int column, double value) {
        const int at = next[column]++;
        rows[at] = stride_ * i + c;
        values[at] = value;
      });
      continue;
    }
    const BalanceRow& row = rows_[i];
    const std::array<double, 4> scales{1, 1, 1, continuity_scale(i)};
    for (std::size_t k = 0; k < row.nodes.size(); ++k)
      for (int e = 0; e < stride_; ++e) {
        const double scale = e == 3 ? pressure_scale(row.nodes[k]) : 1;
        int& at = next[stride_ * row.nodes[k] + e];
        for (int c = 0; c < stride_; ++c, ++at) {
          rows[at] = stride_ * i + c;
          values[at] = scales[c] * scale * row.blocks[k](c, e);
        }
      }
  }
  return system;
}

std::vector<Field> Collocation::responses_to(const MatrixX& right) const {
  const VectorX no_displacement = VectorX::Zero(3 * std::ssize(problem_.prescribed));
  const MatrixX solved = factorisation_->solve(right);
  std::vector<Field> responses;
  responses.reserve(static_cast<std::size_t>(solved.cols()));
  for (Eigen::Index k = 0; k < solved.cols(); ++k)
    responses.push_back(field_of(solved.col(k), 0, no_displacement));
  return responses;
}

std::vector<std::vector<Collocation::CellShare>> Collocation::loaded_cells(const std::vector<int>& nodes) const {
  constexpr double facing = 0.3; // cosine: what faces the tool less is not pressed by it
  const NodeCloud& cloud = problem_.nodes;
  std::vector<std::vector<CellShare>> cells;
  std::vector<int> place(cloud.positions.size(), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    cells.push_back({{nodes[k], 1}});
    if (cloud.kinds[nodes[k]] == NodeKind::surface || cloud.kinds[nodes[k]] == NodeKind::edge)
      place[nodes[k]] = static_cast<int>(k);
  }
  const bool reaches = std::any_of(cells_.boundary.begin(), cells_.boundary.end(),
                                   [&](const auto& face) { return cloud.kinds[face.node] == NodeKind::interior; });
  if (!reaches)
    return cells;
  std::vector<Vector3> skin;
  std::vector<int> ids;
  for (int i = 0; i < cloud.size(); ++i)
    if (cloud.kinds[i] == NodeKind::surface || cloud.kinds[i] == NodeKind::edge) {
      skin.push_back(cloud.positions[i]);
      ids.push_back(i);
    }
  if (ids.empty())
    return cells;
  const topology::PointTree tree(skin);
  std::vector<double> areas(nodes.size(), 0);
  for (const topology::BoundaryFace& face : cells_.boundary) {
    const double area = face.area.norm();
    if (!(area > 0) || (problem_.touched_from && face.area.dot(*problem_.touched_from) < facing * area))
      continue;
    const bool is_own = cloud.kinds[face.node] != NodeKind::interior;
    const int owner = is_own ? face.node : ids[nearest_in_sight(tree, skin, problem_.opaque.get(), face.centroid)];
    if (place[owner] < 0 ||
        (!is_own && problem_.hiding() && problem_.hiding()->blocks(cloud.positions[face.node], cloud.positions[owner])))
      continue;
    std::vector<CellShare>& shares = cells[place[owner]];
    if (is_own)
      areas[place[owner]] += area;
    else
      shares.push_back({face.node, area});
  }
  for (std::size_t k = 0; k < cells.size(); ++k) {
    double whole = areas[k];
    for (std::size_t s = 1; s < cells[k].size(); ++s)
      whole += cells[k][s].part;
    if (!(areas[k] > 0)) // nothing of its own faces the tool
      cells[k].resize(1);
    if (cells[k].size() == 1)
      continue;
    cells[k].front().part = areas[k] / whole;
    for (std::size_t s = 1; s < cells[k].size(); ++s)
      cells[k][s].part /= whole;
  }
  return cells;
}

std::vector<Field> Collocation::force_responses(const std::vector<int>& candidates) const {
  require_nodes(candidates);
  const auto cells = loaded_cells(candidates);
  MatrixX right = MatrixX::Zero(report_.unknowns, 3 * std::ssize(candidates));
  for (Eigen::Index c = 0; c < std::ssize(candidates); ++c)
    for (const CellShare& share : cells[c])
      for (int axis = 0; axis < 3; ++axis)
        if (!constrained_[share.cell][axis])
          right(stride_ * share.cell + axis, 3 * c + axis) += share.part;
  return responses_to(right);
}

std::vector<Field> Collocation::case_responses(const std::vector<int>& nodes, const MatrixX& forces) const {
  require_cases(nodes, forces);
  MatrixX right = MatrixX::Zero(report_.unknowns, forces.cols());
  const auto cells = loaded_cells(nodes);
  for (Eigen::Index k = 0; k < std::ssize(nodes); ++k)
    for (const CellShare& share : cells[k])
      for (int c = 0; c < 3; ++c)
        if (!constrained_[share.cell][c])
          right.row(Eigen::Index{stride_} * share.cell + c) += share.part * forces.row(3 * k + c);
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
  require_own(field);
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
  require_loads(loaded_nodes, nodal_forces);
  require_own(field);
  std::vector<Vector3> applied = loads_;
  for (Vector3& force : applied)
    force *= field.load_factor;
  const auto cells = loaded_cells(loaded_nodes);
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k)
    for (const CellShare& share : cells[k])
      applied[share.cell] += share.part * nodal_forces[k];
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

CellBalance cell_balance_of(const Discretisation& body) {
  const auto* collocation = dynamic_cast<const Collocation*>(&body);
  if (collocation == nullptr)
    throw InputError(
        fmt::format("the balance of cells belongs to the method collocation, not to '{}'", to_string(body.method())));
  return collocation->cell_balance();
}

std::unique_ptr<Discretisation> make_collocation(Problem problem, const DiscretisationOptions& options) {
  if (options.sight == SightRule::appended)
    throw InputError(
        "sight rule 'appended' is one of method galerkin; collocation has visibility, diffraction and enriched");
  require_domain(problem);
  return std::make_unique<Collocation>(std::move(problem), options);
}

} // namespace spherecut::solvers
