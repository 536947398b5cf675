// Method of finite spheres in weak form (Galerkin), the symmetric discretisation.
//
// K_IJ = integral over the body of [lambda gI gJ^T + mu gJ gI^T + mu (gI . gJ) 1], g = grad h, by background cells. Of
// a body of several materials the integral of mu g g^T and that of lambda g g^T are added up apart.
// Displacements are prescribed as means over each held node's share of the surface, m_i(u) = g_i: multipliers constant
// over each share, so that a constant traction is met exactly (point constraints fail the patch test by their own
// quadrature of the traction). A penalty P = `holding` E h_i per component adds P m m^T, and the force of the
// constraint on the body is P (g - m(u)). Forces of the tool act on the same shares. The shape functions sum to one, so
// the rows of K add up to zero and all forces balance to rounding.
#include "solvers/galerkin/galerkin.hpp"

#include "solvers/algebra/elimination_order.hpp"
#include "solvers/algebra/parallel.hpp"
#include "solvers/body/elastic_body.hpp"
#include "solvers/body/surface_patches.hpp"
#include "solvers/galerkin/stiffness_matrix.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "solvers/quadrature/box_memory.hpp"
#include "solvers/shapes/cell_shapes.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <span>
#include <unordered_map>

namespace spherecut::solvers {

namespace {

/// That of the least compressible part: what locks there decides the spheres of the whole body.
Material least_compressible(const Problem& problem) {
  Material material = problem.material;
  if (problem.regions != nullptr)
    for (const MaterialRegion& region : problem.regions->all())
      material.poisson_ratio = std::max(material.poisson_ratio, region.material.poisson_ratio);
  return material;
}

class Galerkin final : public ElasticBody {
 public:
  Galerkin(Problem problem, const DiscretisationOptions& options)
      : ElasticBody(std::move(problem), Method::galerkin, galerkin_support_radius(problem, options), options.sight,
                    galerkin_lengths(least_compressible(problem))) {
    const Stopwatch assembly;
    const BackgroundOptions background{.cell_size = options.cell_size,
                                       .quadrature = options.quadrature,
                                       .enriched = options.sight == SightRule::enriched,
                                       .regions = problem_.regions};
    cells_ = background_cells(*problem_.domain, problem_.nodes, background, problem_.hiding().get(),
                              *BoxMemory::of(problem_.domain));
    if (problem_.regions != nullptr)
      find_materials();
    hold_surface();
    assemble(options.unheld, !initial_stress(problem_).isZero(0));
    assemble_loads();
    report_.unknowns = 3 * problem_.nodes.size();
    report_.matrix_nonzeros = stiffness_.nonZeros();
    report_.assembly_seconds = assembly.seconds();
    const Stopwatch factor;
    factorisation_ = factor_ordered(stiffness_);
    report_.factor_nonzeros = factorisation_->nonzeros();
    report_.factor_seconds = factor.seconds();
    if (options.estimate_condition) {
      report_.condition_estimate =
          spherecut::solvers::condition_estimate(*factorisation_, one_norm(stiffness_, true), report_.unknowns);
      require_regular(report_);
    }
  }

  Method method() const override { return Method::galerkin; }
  OrderedStiffness stiffness() const { return {stiffness_, order_, anchors_}; }

  Field solve() const override {
    VectorX prescribed = prescribed_values(problem_);
    if (problem_.prescribed_field)
      for (std::size_t k = 0; k < held_.size(); ++k)
        prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)) = held_[k].of(problem_.prescribed_field);
    return field_of(solve_refined(loads_, prescribed), 1, prescribed);
  }

  double load_work(const Field& field) const override {
    require_own(field);
    return field.load_factor * loads_.dot(field.coefficients);
  }

  std::vector<Field> force_responses(const std::vector<int>& candidates) const override {
    require_nodes(candidates);
    return fields_of(solve_ordered(unit_forces(candidates)));
  }

  std::vector<Field> case_responses(const std::vector<int>& nodes, const MatrixX& forces) const override {
    require_cases(nodes, forces);
    MatrixX right = MatrixX::Zero(report_.unknowns, forces.cols());
    for (Eigen::Index c = 0; c < std::ssize(nodes); ++c) {
      const DisplacementMean mean = contact_mean(nodes[c]);
      for (Eigen::Index k = 0; k < forces.cols(); ++k)
        add_force(mean, forces.col(k).segment<3>(3 * c), right.col(k));
    }
    return fields_of(solve_ordered(right));
  }

  // B^T A^-1 B = (L^-1 B)^T (L^-1 B): half the way of a solution.
  MatrixX contact_compliance(const std::vector<int>& candidates) const override {
    require_nodes(candidates);
    SparseMatrix right(report_.unknowns, 3 * std::ssize(candidates));
    std::vector<Eigen::Triplet<double>> entries;
    for (int c = 0; c < std::ssize(candidates); ++c) {
      const DisplacementMean& mean = contact_mean(candidates[c]);
      for (std::size_t k = 0; k < mean.nodes.size(); ++k)
        for (int axis = 0; axis < 3 && !is_dropped(mean.nodes[k]); ++axis)
          entries.emplace_back(3 * rank_[mean.nodes[k]] + axis, 3 * c + axis, mean.weights[k]);
    }
    right.setFromTriplets(entries.begin(), entries.end());
    return factorisation_->compliance(right);
  }

  std::vector<Field> pattern_responses(const std::vector<ForcePattern>& patterns) const override {
    return fields_of(solve_ordered(pattern_loads(spheres_, patterns)));
  }

  Field prescribed_response(const std::vector<Vector3>& values) const override {
    const VectorX prescribed = prescribed_values(problem_, values);
    return field_of(solve_refined(VectorX::Zero(report_.unknowns), prescribed), 0, prescribed);
  }

  std::vector<Vector3> constraint_points() const override {
    std::vector<Vector3> points;
    for (const DisplacementMean& mean : held_)
      points.push_back(mean.centroid);
    return points;
  }
  Vector3 contact_point(int node) const override {
    require_nodes({node});
    return contact_mean(node).centroid;
  }
  MatrixX contact_displacements(const std::vector<int>& nodes, const std::vector<Field>& fields) const override {
    require_nodes(nodes);
    require_own(fields);
    MatrixX displacements(3 * std::ssize(nodes), std::ssize(fields));
    for (Eigen::Index c = 0; c < std::ssize(nodes); ++c) {
      const DisplacementMean& mean = contact_mean(nodes[c]);
      for (Eigen::Index f = 0; f < displacements.cols(); ++f)
        displacements.col(f).segment<3>(3 * c) = mean.of(fields[f].coefficients);
    }
    return displacements;
  }
  std::vector<Vector3> constraint_forces(const Field& field) const override;
  double residual(const Field& field, const std::vector<int>& loaded_nodes,
                  const std::vector<Vector3>& nodal_forces) const override;
  void visit_weak_points(const BoundingBox& region, const std::function<bool(const Vector3& x)>& is_wanted,
                         const PointVisitor& visit) const override;

 private:
  void find_materials();
  void hold_surface();
  void treat_unheld(UnheldPieces unheld);
  void assemble(UnheldPieces unheld, bool shapes_are_kept);
  /// Sums over the cells: of one material, of products of gradients; of several, of these times mu and times lambda.
  struct CellSums {
    StiffnessTiles shear;
    std::optional<StiffnessTiles> volumetric;
  };
  [[nodiscard]] CellSums evaluate_cells(bool shapes_are_kept);
  void order_nodes(const std::vector<StiffnessTiles::Pair>& pairs, UnheldPieces unheld);
  [[nodiscard]] bool is_dropped(int node) const { return !dropped_.empty() && dropped_[node] != 0; }
  void assemble_loads();
  /// The matrix is kept in elimination order; vectors outside are in node order.
  [[nodiscard]] MatrixX ordered(const MatrixX& by_node) const {
    MatrixX by_rank(by_node.rows(), by_node.cols());
    for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
      by_rank.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i])) = by_node.middleRows<3>(3 * i);
    return by_rank;
  }
  [[nodiscard]] MatrixX unordered(const MatrixX& by_rank) const {
    MatrixX by_node(by_rank.rows(), by_rank.cols());
    for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
      by_node.middleRows<3>(3 * i) = by_rank.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i]));
    return by_node;
  }
  /// One column per unit force along x, y, z on every candidate.
  [[nodiscard]] MatrixX unit_forces(const std::vector<int>& candidates) const {
    MatrixX right = MatrixX::Zero(report_.unknowns, 3 * static_cast<Eigen::Index>(candidates.size()));
    for (std::size_t c = 0; c < candidates.size(); ++c)
      for (int axis = 0; axis < 3; ++axis)
        add_force(contact_mean(candidates[c]), Vector3::Unit(axis), right.col(3 * static_cast<Eigen::Index>(c) + axis));
    return right;
  }
  [[nodiscard]] MatrixX solve_ordered(MatrixX right) const {
    clear_dropped(right);
    return unordered(factorisation_->solve(ordered(right)));
  }
  /// Forces of the prescribed means on the rows, N.
  [[nodiscard]] VectorX holding_forces(const VectorX& coefficients, const VectorX& prescribed) const {
    VectorX right = VectorX::Zero(report_.unknowns);
    for (std::size_t k = 0; k < held_.size(); ++k)
      add_force(held_[k], constraint_force(k, coefficients, prescribed), right);
    return right;
  }
  [[nodiscard]] Vector3 constraint_force(std::size_t k, const VectorX& coefficients, const VectorX& prescribed) const {
    const Prescribed& entry = problem_.prescribed[k];
    const Vector3 gap = prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)) - held_[k].of(coefficients);
    return constraint_stiffness(problem_, entry.node) * held_part(entry, gap);
  }
  [[nodiscard]] Eigen::Map<const SparseMatrix> elastic_stiffness() const {
    return {stiffness_.rows(),          stiffness_.cols(),          stiffness_.nonZeros(),
            stiffness_.outerIndexPtr(), stiffness_.innerIndexPtr(), elastic_.data()};
  }
  /// Stiffness without the prescribed means times the coefficients, both in node order.
  [[nodiscard]] VectorX elastic_forces(const VectorX& coefficients) const {
    return unordered(elastic_stiffness().selfadjointView<Eigen::Lower>() * VectorX(ordered(coefficients)));
  }
  /// The large penalties round off the elastic entries they are added to. One correction, from a residual that keeps
  /// the two apart, takes that back.
  [[nodiscard]] VectorX solve_refined(const VectorX& loads, const VectorX& prescribed) const {
    if (loads.isZero(0) && prescribed.isZero(0)) // before a tool comes nothing moves many a body
      return VectorX::Zero(report_.unknowns);
    VectorX coefficients = solve_ordered(loads + constraint_loads(prescribed));
    coefficients += solve_ordered(loads + holding_forces(coefficients, prescribed) - elastic_forces(coefficients));
    return coefficients;
  }
  template <typename Rows>
  void clear_dropped(Rows& rows) const {
    for (int i = 0; i < std::ssize(dropped_); ++i)
      if (dropped_[i] != 0)
        rows.template middleRows<3>(3 * i).setZero();
  }
  template <typename Column>
  static void add_force(const DisplacementMean& mean, const Vector3& force, Column&& right) {
    for (std::size_t k = 0; k < mean.nodes.size(); ++k)
      right.template segment<3>(3 * mean.nodes[k]) += mean.weights[k] * force;
  }
  /// Kept: every step of a run asks for the same ones.
  [[nodiscard]] const DisplacementMean& contact_mean(int node) const {
    auto known = contact_means_.find(node);
    if (known == contact_means_.end())
      known = contact_means_
                  .emplace(node, patches_ ? patches_->contact_mean(node, spheres_, problem_)
                                          : value_at(spheres_, problem_.nodes.positions[node]))
                  .first;
    return known->second;
  }
  [[nodiscard]] VectorX constraint_loads(const VectorX& prescribed) const {
    VectorX right = VectorX::Zero(report_.unknowns);
    for (std::size_t k = 0; k < problem_.prescribed.size(); ++k)
      add_force(held_[k],
                constraint_stiffness(problem_, problem_.prescribed[k].node) *
                    held_part(problem_.prescribed[k], prescribed.segment<3>(3 * static_cast<Eigen::Index>(k))),
                right);
    return right;
  }
  [[nodiscard]] Field field_of(const VectorX& coefficients, double load_factor, const VectorX& prescribed) const {
    Field field{coefficients, {}, load_factor, prescribed};
    require_finite(field, report_);
    return field;
  }

  /// Columns as responses without loads and prescribed displacements.
  [[nodiscard]] std::vector<Field> fields_of(const MatrixX& solution) const {
    const VectorX no_displacement = VectorX::Zero(3 * static_cast<Eigen::Index>(problem_.prescribed.size()));
    std::vector<Field> responses;
    responses.reserve(static_cast<std::size_t>(solution.cols()));
    for (Eigen::Index k = 0; k < solution.cols(); ++k)
      responses.push_back(field_of(solution.col(k), 0, no_displacement));
    return responses;
  }

  BackgroundCells cells_;
  std::vector<Material> materials_; // of every quadrature point; empty: the problem's everywhere
  std::unique_ptr<SurfacePatches> patches_;
  mutable std::unordered_map<int, DisplacementMean> contact_means_; // by node, as they are asked for
  std::vector<DisplacementMean> held_;                              // one per prescribed entry
  std::vector<char> dropped_;      // nodes whose unknowns are taken out; empty when there are none
  std::vector<Anchor> anchors_;    // hold pieces that nothing else holds
  std::vector<int> order_;         // node of every elimination rank
  std::vector<int> rank_;          // elimination rank of every node
  std::vector<CellShapes> shapes_; // of every cell; empty where no initial strain asks for them
  SparseMatrix stiffness_;         // lower triangle (diagonal blocks full), in ranks
  std::vector<double, InLargePages<double>>
      elastic_; // entries of stiffness_ without the penalties of the prescribed means
  VectorX loads_;
  std::unique_ptr<OrderedCholesky> factorisation_;
};

void Galerkin::find_materials() {
  std::vector<Vector3> places;
  places.reserve(cells_.points.size());
  for (const QuadraturePoint& point : cells_.points) {
    places.push_back(point.position);
    materials_.push_back(problem_.material_at(point.position));
  }
  problem_.regions->require_apart(places);
  problem_.regions->require_resolved(places,
                                     *std::min_element(problem_.nodes.spacings.begin(), problem_.nodes.spacings.end()));
}

void Galerkin::hold_surface() {
  patches_ = std::make_unique<SurfacePatches>(*problem_.domain, problem_.nodes, problem_.incision, std::nullopt,
                                              SurfacePatches::Of::skin_and_faces, problem_.opaque);
  if (problem_.prescribed_region) {
    held_ = patches_->means(problem_.prescribed, spheres_, problem_.prescribed_region);
    return;
  }
  for (const Prescribed& entry : problem_.prescribed)
    held_.push_back(value_at(spheres_, problem_.nodes.positions[entry.node]));
}

void Galerkin::treat_unheld(UnheldPieces unheld) {
  if (unheld == UnheldPieces::refuse)
    require_held(report_.pieces);
  for (const Piece& piece : report_.pieces) {
    if (piece.held)
      continue;
    if (unheld == UnheldPieces::hold) {
      const std::array<Anchor, 6> anchors = anchors_of(piece, problem_.nodes);
      anchors_.insert(anchors_.end(), anchors.begin(), anchors.end());
    } else {
      dropped_.resize(problem_.nodes.size(), 0);
      for (int node : piece.nodes)
        dropped_[node] = 1;
    }
  }
}

/// The gradients of a cell times the root of a modulus of every point's material.
const CellShapes& weighted(const CellShapes& shapes, std::span<const Material> materials,
                           double (Material::*modulus)() const, CellShapes& out) {
  out = shapes;
  std::array<double, most_cell_points> root{};
  for (int q = 0; q < shapes.points; ++q)
    root[q] = std::sqrt((materials[q].*modulus)());
  const std::size_t rows = 3 * shapes.nodes.size();
  for (std::size_t row = 0; row < rows; ++row)
    for (int q = 0; q < shapes.points; ++q)
      out.gradients[row * static_cast<std::size_t>(shapes.stride) + q] *= root[q];
  return out;
}

/// Evaluates the cells, cluster by cluster while they are at hand. The same bits with any number of threads: every
/// column of tiles gets its clusters in their order.
Galerkin::CellSums Galerkin::evaluate_cells(bool shapes_are_kept) {
  CellSums sums{StiffnessTiles(problem_.nodes.positions), std::nullopt};
  StiffnessTiles& tiles = sums.shear;
  const bool are_several = !materials_.empty();
  if (are_several)
    sums.volumetric.emplace(problem_.nodes.positions);
  const std::vector<int> order = cells_by_place(cells_);
  shapes_.resize(shapes_are_kept ? order.size() : 0);
  struct Worker {
    CellEvaluator evaluator;
    CellCluster cluster, volumetric;
    CellShapes shapes, weighted;
    std::span<const int> cells;
  };
  const int threads = thread_count(), batch = threads == 1 ? 1 : 32, shares = threads == 1 ? 1 : 4 * threads;
  std::vector<Worker> workers(
      batch, {CellEvaluator(spheres_), CellCluster(tiles.groups()), CellCluster(tiles.groups()), {}, {}, {}});
  for (std::size_t next = 0; next < order.size();) {
    int in_batch = 0;
    for (; in_batch < batch && next < order.size(); ++in_batch) {
      const std::size_t first = next;
      for (int points = 0; next < order.size(); ++next) {
        points += static_cast<int>(cells_.of(order[next]).size());
        if (points > tile_points)
          break;
      }
      workers[in_batch].cells = std::span(order).subspan(first, next - first);
    }
    {
      const SharedSightTime sight_time;
      parallel_ranges(in_batch, 1, [&](int k, int) {
        const SharedSightTime::Part timed(sight_time);
        Worker& worker = workers[k];
        worker.cluster.clear();
        worker.volumetric.clear();
        for (const int cell : worker.cells) {
          CellShapes& shapes = shapes_are_kept ? shapes_[cell] : worker.shapes;
          worker.evaluator.evaluate(cells_.of(cell), shapes);
          if (!are_several) {
            worker.cluster.add(shapes);
            continue;
          }
          const std::span<const Material> materials = std::span(materials_).subspan(cells_.start[cell]);
          worker.cluster.add(weighted(shapes, materials, &Material::shear_modulus, worker.weighted));
          worker.volumetric.add(weighted(shapes, materials, &Material::lame_lambda, worker.weighted));
        }
      });
    }
    parallel_ranges(shares, 1, [&](int share, int) {
      for (int k = 0; k < in_batch; ++k) {
        tiles.add(workers[k].cluster, share, shares);
        if (are_several)
          sums.volumetric->add(workers[k].volumetric, share, shares);
      }
    });
  }
  for (std::size_t p = 0; p < held_.size(); ++p)
    tiles.add_held(held_[p], problem_.prescribed[p].components,
                   constraint_stiffness(problem_, problem_.prescribed[p].node));
  return sums;
}

void Galerkin::assemble(UnheldPieces unheld, bool shapes_are_kept) {
  const CellSums sums = evaluate_cells(shapes_are_kept);
  std::vector<StiffnessTiles::Pair> pairs = sums.shear.pairs(sums.volumetric ? &*sums.volumetric : nullptr);
  order_nodes(pairs, unheld);
  build_stiffness(std::move(pairs), rank_, dropped_, anchors_, problem_, stiffness_, elastic_);
}

/// Nodes couple that have a point of some cell in common, or a mean of the held surface. Ordering nodes instead of
/// unknowns is a ninth of the graph, and a matrix assembled in elimination order needs no permutation in the
/// factorisation.
void Galerkin::order_nodes(const std::vector<StiffnessTiles::Pair>& pairs, UnheldPieces unheld) {
  const int count = problem_.nodes.size();
  std::vector<int> start(count + 1, 0);
  for (const StiffnessTiles::Pair& pair : pairs)
    if (pair.row != pair.column) {
      ++start[pair.row + 1];
      ++start[pair.column + 1];
    }
  for (int i = 0; i < count; ++i)
    start[i + 1] += start[i] + 1; // itself, too
  std::vector<int> neighbours(start[count]), next(start.begin(), start.end() - 1);
  for (int i = 0; i < count; ++i)
    neighbours[next[i]++] = i;
  for (const StiffnessTiles::Pair& pair : pairs)
    if (pair.row != pair.column) {
      neighbours[next[pair.row]++] = pair.column;
      neighbours[next[pair.column]++] = pair.row;
    }
  report_.pieces = find_pieces(problem_, start, neighbours);
  treat_unheld(unheld);
  order_ = fill_reducing_ordering(start, neighbours);
  rank_.resize(count);
  for (int k = 0; k < count; ++k)
    rank_[order_[k]] = k;
}

void Galerkin::assemble_loads() {
  loads_ = VectorX::Zero(3 * problem_.nodes.size());
  ShapeFunctions shape;
  const auto add = [&](const Vector3& x, const Vector3& force) {
    if (!evaluate(spheres_, x, shape))
      throw NumericalError(
          fmt::format("no sound support covers the loaded point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
    for (int k = 0; k < shape.size(); ++k)
      loads_.segment<3>(3 * shape.nodes[k]) += shape.value[k] * force;
  };
  if (problem_.loads.body_force)
    for (const QuadraturePoint& point : cells_.points)
      add(point.position, point.weight * problem_.loads.body_force(point.position));
  if (problem_.loads.traction)
    for (const SurfacePoint& point :
         surface_quadrature(*problem_.domain, problem_.nodes, 0.5, 0, problem_.incision.get())) {
      const Vector3 traction = problem_.loads.traction(point.position, point.normal);
      if (!traction.isZero(0))
        add(point.position, point.weight * traction);
    }
  if (problem_.loads.lip_traction && problem_.incision != nullptr)
    for (const SurfacePoint& point : lip_quadrature(*problem_.incision, problem_.nodes))
      add(point.position, point.weight * problem_.loads.lip_traction(point.position, point.normal));
  if (!problem_.loads.initial_strain.isZero(0))
    for (std::size_t c = 0; c < shapes_.size(); ++c) {
      const CellShapes& cell = shapes_[c];
      for (int q = 0; q < cell.points; ++q) {
        const int point = cells_.start[c] + q;
        const double root = std::sqrt(cells_.points[point].weight);
        const Matrix3 initial = initial_stress(problem_, materials_.empty() ? problem_.material : materials_[point]);
        for (std::size_t k = 0; k < cell.nodes.size(); ++k)
          loads_.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) += root * initial * cell.gradient(k, q);
      }
    }
  clear_dropped(loads_);
}

std::vector<Vector3> Galerkin::constraint_forces(const Field& field) const {
  require_own(field);
  std::vector<Vector3> forces;
  forces.reserve(problem_.prescribed.size());
  for (std::size_t k = 0; k < problem_.prescribed.size(); ++k)
    forces.push_back(constraint_force(k, field.coefficients, field.prescribed));
  return forces;
}

double Galerkin::residual(const Field& field, const std::vector<int>& loaded_nodes,
                          const std::vector<Vector3>& nodal_forces) const {
  require_loads(loaded_nodes, nodal_forces);
  require_own(field);
  VectorX applied = field.load_factor * loads_;
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k)
    add_force(contact_mean(loaded_nodes[k]), nodal_forces[k], applied);
  clear_dropped(applied);
  const VectorX rows = elastic_forces(field.coefficients) - holding_forces(field.coefficients, field.prescribed);
  const double unbalanced = (rows - applied).lpNorm<Eigen::Infinity>();
  double largest = applied.lpNorm<Eigen::Infinity>();
  for (const Vector3& force : constraint_forces(field))
    largest = std::max(largest, force.lpNorm<Eigen::Infinity>());
  return largest > 0 ? unbalanced / largest : 0;
}

void Galerkin::visit_weak_points(const BoundingBox& region, const std::function<bool(const Vector3& x)>& is_wanted,
                                 const PointVisitor& visit) const {
  ShapeFunctions shape;
  for (const QuadraturePoint& point : cells_.points)
    if (region.contains(point.position) && is_wanted(point.position)) {
      require_support(spheres_, point.position, shape);
      visit(point, shape);
    }
}

} // namespace

OrderedStiffness stiffness_of(const Discretisation& body) {
  const auto* galerkin = dynamic_cast<const Galerkin*>(&body);
  if (galerkin == nullptr)
    throw InputError(fmt::format("the stiffness matrix is that of method galerkin, not {}", to_string(body.method())));
  return galerkin->stiffness();
}

// Larger supports carry more volume-preserving modes: they cure locking. At nu = 0.45 the smooth field's error with
// spheres as for less would be what it is at 0.3, but the energies of a tear add up worse: those of
// docs/experiments/flap.md to 12 % with radii of 2.2 reaches and of 2.0 spacings, to 7.5 % with 2.2 spacings.
double galerkin_support_radius(const Problem& problem, const DiscretisationOptions& options) {
  if (options.support_radius > 0)
    return options.support_radius;
  if (least_compressible(problem).is_nearly_incompressible())
    return problem.tuning.sphere_radius_soft;
  return problem.hiding() != nullptr || options.cut_ahead ? problem.tuning.sphere_radius_cut
                                                          : problem.tuning.sphere_radius;
}

std::vector<double> NodeCloud::*galerkin_lengths(const Material& material) {
  return material.is_nearly_incompressible() ? &NodeCloud::spacings : &NodeCloud::reaches;
}

double constraint_stiffness(const Problem& problem, int node) {
  const double spacing = problem.nodes.spacings[node];
  const double modulus = problem.regions != nullptr
                             ? problem.regions->stiffest_near(problem.nodes.positions[node], spacing, problem.material)
                             : problem.material.young_modulus;
  return problem.tuning.holding * modulus * spacing;
}

std::unique_ptr<Discretisation> make_galerkin(Problem problem, const DiscretisationOptions& options) {
  require_domain(problem);
  if (problem.hiding() != nullptr)
    require_one_material(problem, "a cut, or a narrow gap of the surface,");
  return std::make_unique<Galerkin>(std::move(problem), options);
}

} // namespace spherecut::solvers
