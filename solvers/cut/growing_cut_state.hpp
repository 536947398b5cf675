// What a growing cut keeps between increments (growing_cut.hpp). Private to its sources.
#pragma once

#include "solvers/algebra/schur_window.hpp"
#include "solvers/body/elastic_body.hpp"
#include "solvers/cut/growing_cut.hpp"
#include "solvers/cut/held_changes.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "solvers/galerkin/stiffness_tiles.hpp"
#include "solvers/shapes/cell_shapes.hpp"
#include "solvers/shapes/cut_reach.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace spherecut::solvers {

/// Shares of the surface about some nodes are found from points and nodes this far around them, in spacings.
inline constexpr double points_reach = 2, nodes_reach = 4;
/// A share itself changes when faces or surface nodes come this near to it, in spacings.
inline constexpr double share_size = 2;
/// And a share of the skin where faces come this near to its node, in units of how far it reaches from it: nearer they
/// part points from this node or from one beside it.
inline constexpr double share_crossing = 1.6;

struct GrowingCut::State {
  struct Box {
    BackgroundBox box;
    std::vector<CellShapes> cells;                                           // by node ids
    std::vector<std::vector<QuadraturePoint>> points;                        // of each cell
    bool exchanged = false;                                                  // since the condensation
    std::vector<CellShapes> first{};                                         // then: as they were at it
    BoundingBox extent{Vector3::Constant(1e300), Vector3::Constant(-1e300)}; // of its points
    double growth = 1;                                                       // of a support of some cell
    void find_growth(std::span<const CellShapes> shapes) {
      growth = 1;
      for (const CellShapes& cell : shapes)
        growth = std::max(growth, cell.growth);
    }
    void include(std::span<const QuadraturePoint> of_cell) {
      for (const QuadraturePoint& point : of_cell) {
        extent.lower = extent.lower.cwiseMin(point.position);
        extent.upper = extent.upper.cwiseMax(point.position);
      }
    }
  };

  Problem problem;
  GrowthOptions options;
  double rho = 2;
  std::vector<char> removed;
  std::unique_ptr<Spheres> spheres;
  std::vector<char> altered; // by node, as GrowingCut::altered
  std::vector<Box> boxes;
  std::vector<DisplacementMean> held;
  std::unique_ptr<SchurWindow> window;
  std::vector<int> far_order;   // node of every far rank
  std::vector<int> slot;        // block of three slots of every node in the window, -1 outside
  std::vector<int> window_node; // node of every block of slots, -1 for room
  std::vector<int> left_alone;  // increments since one has changed a block of slots
  bool is_prepared = false;     // for the next increment, which is known
  int next_room = 0;
  VectorX cell_loads;                                 // 3N: body force and initial strain
  VectorX first_loads;                                // 3N at condensation, all loads
  VectorX external;                                   // 3N as they stand, without those of prescribed displacements
  VectorX loads;                                      // 3N as they stand
  MatrixX reduced_first;                              // by slots
  mutable std::unique_ptr<Shares> shares, lip_shares; // null: not needed so far
  mutable std::unordered_map<int, DisplacementMean> means; // by node, as they are asked for
  AssemblyReport report;                                   // of the condensation
  std::vector<Anchor> anchors;                             // by ids
  SparseMatrix elastic;           // stiffness at condensation without held means, in its elimination order
  std::vector<int> elastic_order; // node of every rank there
  std::vector<DisplacementMean> contact;
  MatrixX compliance;
  VectorX base;

  /// An increment before any of its cells is evaluated.
  struct Increment {
    Problem next;
    std::vector<char> removed;
    const char* uncovered = nullptr; // why the window cannot take it; what follows is then not complete
    std::unique_ptr<Spheres> spheres{};
    double spheres_seconds = 0;
    Changes changes{};
    std::optional<Reach> reach{};
    std::vector<std::pair<Vector3, double>> balls{}; // places and radii of the spheres that change
    BoundingBox touched{Vector3::Constant(1e300), Vector3::Constant(-1e300)}; // about all that may change, m
    std::vector<int> boxes{};                                                 // touched
    std::vector<char> moved{};                                                // of these: their points are placed anew

    /// All within `far` m of x may change.
    void include(const Vector3& x, double far) {
      touched.lower = touched.lower.cwiseMin((x.array() - far).matrix());
      touched.upper = touched.upper.cwiseMax((x.array() + far).matrix());
    }
    /// Whether something within `half` m of x changes; `enriched`: reach of the enrichment in sphere radii.
    [[nodiscard]] bool concerns(const Vector3& x, double half, double enriched) const {
      return reach->sees(x, half) || reach->near_front(x, half, std::max(1.0, enriched)) ||
             std::any_of(balls.begin(), balls.end(),
                         [&](const auto& ball) { return (ball.first - x).norm() < ball.second + half; });
    }
    /// The same of a box the points of which stay, more closely. `room`: of growth_room, m.
    [[nodiscard]] bool concerns(const Box& box, double room) const {
      const Vector3 centre = box.extent.centre(), half = (0.5 * box.extent.extent().array() + room).matrix();
      return reach->at_front(centre, half) ||
             std::any_of(balls.begin(), balls.end(),
                         [&](const auto& ball) { return distance_to_box(ball.first, centre, half) < ball.second; }) ||
             reach->sees(centre, half);
    }
  };

  State(Problem p, GrowthOptions o);

  void change_problem(const NodeChange& change, const std::shared_ptr<const topology::Incision>& incision,
                      Increment& increment) const;
  void find_changes(const NodeChange& change, Increment& increment) const;
  [[nodiscard]] Increment increment(const NodeChange& change,
                                    const std::shared_ptr<const topology::Incision>& incision) const;

  void find_altered(const Increment& increment);
  [[nodiscard]] std::vector<Box> evaluated(const Increment& increment) const;
  static void find_changed(const Box& before, const Box& after, std::vector<const CellShapes*>& gone,
                           std::vector<const CellShapes*>& come);

  [[nodiscard]] BackgroundOptions background() const { return background_of(options.method); }
  [[nodiscard]] std::unique_ptr<Spheres> make_spheres() const {
    return std::make_unique<Spheres>(problem.nodes.positions, problem.nodes.*galerkin_lengths(problem.material), rho,
                                     Basis::linear, worst_moment_condition,
                                     sight_about_cut(problem, Method::galerkin, options.method.sight), removed);
  }
  [[nodiscard]] double enrichment_reach() const {
    return options.method.sight == SightRule::enriched
               ? sight_about_cut(problem, Method::galerkin, options.method.sight).reach / rho
               : 0; // in sphere radii
  }
  /// How far from the centroid of a node's share of the surface there may be points of it, m.
  [[nodiscard]] double share_extent(const Vector3& x) const {
    double spacing = 0;
    for (int node : spheres->candidates(x))
      spacing = std::max(spacing, problem.nodes.spacings[node]);
    return 0.5 * rho * spacing;
  }
  /// How much farther than its spheres reach a change concerns a place about x where some support had to grow, m.
  [[nodiscard]] double growth_room(const Vector3& x, double growth) const {
    double largest = 0;
    if (growth > 1)
      for (int node : spheres->candidates(x))
        largest = std::max(largest, spheres->radii()[node]);
    return 1.1 * (growth - 1) * largest; // those of new nodes may be a little larger
  }
  /// Whether an increment concerns the mean.
  [[nodiscard]] bool is_concerned(const DisplacementMean& mean, const Increment& increment) const {
    return increment.concerns(mean.centroid, share_extent(mean.centroid) + growth_room(mean.centroid, mean.growth),
                              enrichment_reach());
  }
  [[nodiscard]] bool has_cell_loads() const {
    return problem.loads.body_force != nullptr || !problem.loads.initial_strain.isZero(0);
  }

  /// The cells of a box on its points.
  static void evaluate(Box& box, CellEvaluator& evaluator) {
    box.cells.resize(box.points.size());
    for (std::size_t c = 0; c < box.cells.size(); ++c)
      evaluator.evaluate(box.points[c], box.cells[c]);
    box.find_growth(box.cells);
  }

  /// Adds the stiffness of cells, whose nodes are all in the window, to S.
  void scatter(const StiffnessTiles& tiles) {
    const double mu = problem.material.shear_modulus(), lambda = problem.material.lame_lambda();
    for (const StiffnessTiles::Pair& pair : tiles.pairs()) {
      Matrix3 block = pair.stiffness(lambda, mu);
      int row = 3 * slot[pair.row], column = 3 * slot[pair.column];
      if (row < column) {
        std::swap(row, column);
        block.transposeInPlace();
      }
      for (int b = 0; b < 3; ++b)
        for (int a = 0; a < 3; ++a)
          window->column(column + b)[row + a] += block(a, b);
    }
  }

  /// The same of a held mean of problem `of`.
  void scatter(const DisplacementMean& mean, const Problem& of, const Prescribed& entry, double sign) {
    const double factor = sign * constraint_stiffness(of, entry.node);
    for (std::size_t i = 0; i < mean.nodes.size(); ++i)
      for (std::size_t j = 0; j < mean.nodes.size(); ++j)
        if (slot[mean.nodes[i]] >= slot[mean.nodes[j]])
          for (int c = 0; c < 3; ++c)
            if (entry.components[c])
              window->column(3 * slot[mean.nodes[j]] + c)[3 * slot[mean.nodes[i]] + c] +=
                  factor * mean.weights[i] * mean.weights[j];
  }

  /// Body force and initial strain of a box, times `sign`.
  void add_cell_loads(const Box& box, double sign, const Spheres& of, VectorX& into) const {
    if (!has_cell_loads())
      return;
    const Matrix3 initial = initial_stress(problem);
    ShapeFunctions shape;
    for (std::size_t c = 0; c < box.cells.size(); ++c)
      for (int q = 0; q < box.cells[c].points; ++q) {
        const QuadraturePoint& point = box.points[c][q];
        if (problem.loads.body_force && solvers::evaluate(of, point.position, shape)) {
          const Vector3 force = sign * point.weight * problem.loads.body_force(point.position);
          for (int k = 0; k < shape.size(); ++k)
            into.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) += shape.value[k] * force;
        }
        const CellShapes& cell = box.cells[c];
        const double root = sign * std::sqrt(point.weight);
        for (std::size_t k = 0; k < cell.nodes.size(); ++k)
          into.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) += root * initial * cell.gradient(k, q);
      }
  }

  /// All loads as they stand.
  void find_loads() {
    external = cell_loads + tractions();
    loads = external;
    for (std::size_t k = 0; k < held.size(); ++k) {
      const Prescribed& entry = problem.prescribed[k];
      const Vector3 value = problem.prescribed_field ? problem.prescribed_field(held[k].centroid) : entry.value;
      const Vector3 force = constraint_stiffness(problem, entry.node) * held_part(entry, value);
      for (std::size_t j = 0; j < held[k].nodes.size(); ++j)
        loads.segment<3>(3 * static_cast<Eigen::Index>(held[k].nodes[j])) += held[k].weights[j] * force;
    }
  }

  /// Of tractions on the surface and the lips.
  [[nodiscard]] VectorX tractions() const;

  /// Kept until the cut grows: every step of a run asks for the same ones.
  [[nodiscard]] const DisplacementMean& mean(int node) const;

  /// Means of some candidates (places in options.contact), from the surface about them.
  void find_contact(const std::vector<std::size_t>& wanted) {
    contact.resize(options.contact.size());
    if (wanted.empty())
      return;
    const auto around = [&](double reach) {
      BoundingBox box{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
      for (const std::size_t c : wanted) {
        const int node = options.contact[c];
        const double far = problem.nodes.kinds[node] == NodeKind::lip ? nodes_reach : reach; // lips may be sparse
        const Vector3 room = Vector3::Constant(far * problem.nodes.spacings[node]);
        box.lower = box.lower.cwiseMin(problem.nodes.positions[node] - room);
        box.upper = box.upper.cwiseMax(problem.nodes.positions[node] + room);
      }
      return box;
    };
    const Shares regional(problem, removed, SurfacePatches::Part{around(points_reach), around(nodes_reach)});
    for (const std::size_t c : wanted)
      contact[c] = regional.patches.contact_mean(regional.compact[options.contact[c]], *spheres, problem);
  }
  /// Candidates that the cut has removed are none any more.
  void drop_removed_contact() {
    std::size_t kept = 0;
    for (std::size_t c = 0; c < options.contact.size(); ++c) {
      if (removed[options.contact[c]] != 0)
        continue;
      options.contact[kept] = options.contact[c];
      if (kept < c && c < contact.size())
        contact[kept] = std::move(contact[c]);
      ++kept;
    }
    options.contact.resize(kept);
    contact.resize(std::min(kept, contact.size()));
  }

  /// Whether an increment along `way` may change what lies within `half` of x, m; also where the nodes that it
  /// exchanges are of another spacing.
  [[nodiscard]] ReachAlong reach_of(const topology::SurfaceMesh& way, bool nodes_may_coarsen) const {
    return {way, problem.incision.get(), problem.nodes, removed, spheres->radii(), enrichment_reach(),
            1,   nodes_may_coarsen};
  }

  /// Factors the window. What the next increments are not going to touch is eliminated on the way, in stages, and
  /// stands until one does. `places`: what is new of the cut; `reach`: how far from there they are going to change the
  /// system at least, m. Whether all of it stood.
  bool factor_window(const std::vector<Vector3>& places, double reach = 0);
  void condense_all();
  [[nodiscard]] std::vector<char> keep_cells(const OrderedStiffness& stiffness, const std::vector<int>& id,
                                             bool is_whole);
  [[nodiscard]] std::vector<int> open_window(const OrderedStiffness& stiffness, const std::vector<int>& id,
                                             const std::vector<char>& in_window);
  void condense_contact();
  [[nodiscard]] SparseMatrix contact_functionals() const; // slots x 3 per candidate
  [[nodiscard]] VectorX window_right(const VectorX& right) const;
  /// Forces (3N rows) as the window sees them.
  struct OnWindow {
    MatrixX by_slot;
    std::vector<Eigen::Index> far_columns; // those that act on far nodes
    MatrixX far_half;                      // of these, as SchurWindow::reduce() gives it
  };
  [[nodiscard]] OnWindow on_window(const MatrixX& forces) const;
  [[nodiscard]] MatrixX respond(const MatrixX& forces) const;
  [[nodiscard]] CaseResponses condense_cases(const MatrixX& forces, const std::vector<int>& at) const;
  [[nodiscard]] VectorX elastic_forces(const VectorX& coefficients) const;
};

} // namespace spherecut::solvers
