#include "solvers/appended/uncut_body.hpp"

#include "solvers/algebra/elimination_order.hpp"
#include "solvers/algebra/parallel.hpp"
#include "solvers/body/elastic_body.hpp"
#include "solvers/galerkin/galerkin.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace spherecut::solvers {

namespace {

/// The problem on its first nodes alone.
Problem on_base(Problem problem, int base) {
  problem.incision = nullptr;
  NodeCloud& nodes = problem.nodes;
  nodes.positions.resize(base);
  nodes.spacings.resize(base);
  nodes.reaches.resize(base);
  nodes.kinds.resize(base);
  nodes.normals.resize(base);
  std::erase_if(problem.prescribed, [base](const Prescribed& entry) { return entry.node >= base; });
  check_problem(problem);
  return problem;
}

Spheres spheres_of(const Problem& problem, double rho) {
  return Spheres(problem.nodes.positions, problem.nodes.*galerkin_lengths(problem.material), rho, Basis::linear,
                 worst_moment_condition);
}

} // namespace

UncutBody::UncutBody(Problem problem, int base, const UncutOptions& options)
    : problem_(on_base(std::move(problem), base)), spheres_(spheres_of(problem_, options.support_radius)),
      boxes_(*problem_.domain, problem_.nodes, spheres_, options.cell_size) {
  report_.nodes = size();
  report_.unknowns = 3 * size();
  report_.grown_supports = spheres_.grown();
  const Stopwatch assembly;
  assemble();
  report_.assembly_seconds = assembly.seconds();
  report_.matrix_nonzeros = stiffness_.nonZeros();
  const Stopwatch factor;
  factor_ = factor_ordered(stiffness_);
  report_.factor_nonzeros = factor_->nonzeros();
  report_.factor_seconds = factor.seconds();
  if (options.estimate_condition) {
    report_.condition_estimate = condition_estimate(*factor_, one_norm(stiffness_, true), report_.unknowns);
    require_regular(report_);
  }
}

bool UncutBody::fits(const Problem& problem, int base) const {
  if (base != size() || problem.domain != problem_.domain ||
      problem.material.young_modulus != problem_.material.young_modulus ||
      problem.material.poisson_ratio != problem_.material.poisson_ratio ||
      static_cast<bool>(problem.prescribed_region) != static_cast<bool>(problem_.prescribed_region))
    return false;
  const NodeCloud &own = problem_.nodes, &other = problem.nodes;
  for (int i = 0; i < base; ++i)
    if (own.positions[i] != other.positions[i] || own.spacings[i] != other.spacings[i] ||
        own.reaches[i] != other.reaches[i] || own.kinds[i] != other.kinds[i])
      return false;
  std::size_t held = 0;
  for (const Prescribed& entry : problem.prescribed) {
    if (entry.node >= base)
      continue;
    if (held == problem_.prescribed.size() || problem_.prescribed[held].node != entry.node ||
        problem_.prescribed[held].components != entry.components)
      return false;
    ++held;
  }
  return held == problem_.prescribed.size();
}

// The weights of a mean by the functions that the boxes integrate.
void UncutBody::weigh(DisplacementMean& mean) const {
  std::map<int, double> weights;
  ShapeFunctions shape;
  for (const QuadraturePoint& point : mean.share) {
    boxes_.evaluate(boxes_.locate(point.position), point.position, shape);
    for (int k = 0; k < shape.size(); ++k)
      weights[shape.nodes[k]] += point.weight * shape.value[k];
  }
  mean.nodes.clear();
  mean.weights.clear();
  for (const auto& [node, weight] : weights) {
    mean.nodes.push_back(node);
    mean.weights.push_back(weight);
  }
}

void UncutBody::assemble() {
  const SurfacePatches patches(*problem_.domain, problem_.nodes);
  if (problem_.prescribed_region)
    held_ = patches.means(problem_.prescribed, spheres_, problem_.prescribed_region);
  else
    for (const Prescribed& entry : problem_.prescribed)
      held_.push_back(value_at(spheres_, problem_.nodes.positions[entry.node]));
  for (DisplacementMean& mean : held_)
    weigh(mean);

  StiffnessTiles tiles(problem_.nodes.positions);
  CellCluster cluster(tiles.groups());
  CellShapes shapes;
  shapes.stride = BoxShapes::lanes;
  const auto flush = [&] {
    if (!cluster.empty())
      tiles.add(cluster);
    cluster.clear();
  };
  for (const int c : boxes_.cells_by_place()) {
    const BoxShapes& cell = boxes_.cells()[c];
    shapes.points = cell.boxes;
    shapes.nodes = cell.nodes;
    shapes.gradients.resize(cell.gradients.size());
    shapes.reached.assign(cell.nodes.size(), 0);
    std::array<double, BoxShapes::lanes> root{};
    for (int lane = 0; lane < cell.boxes; ++lane)
      root[lane] = std::sqrt(boxes_.boxes()[cell.first_box + lane].volume);
    for (std::size_t k = 0; k < cell.nodes.size(); ++k)
      for (int lane = 0; lane < BoxShapes::lanes; ++lane) {
        if (lane < cell.boxes && !cell.gradient_at(k, lane).isZero(0))
          shapes.reached[k] |= std::uint32_t{1} << lane;
        const Vector3 gradient = cell.gradient_at(k, lane);
        for (int axis = 0; axis < 3; ++axis)
          shapes.gradients[(3 * k + axis) * BoxShapes::lanes + lane] = root[lane] * gradient[axis];
      }
    if (!cluster.has_room_for(shapes))
      flush();
    cluster.add(shapes);
  }
  flush();
  for (std::size_t p = 0; p < held_.size(); ++p)
    tiles.add_held(held_[p], problem_.prescribed[p].components,
                   constraint_stiffness(problem_, problem_.prescribed[p].node));

  std::vector<StiffnessTiles::Pair> pairs = tiles.pairs();
  std::vector<int> start(size() + 1, 0);
  for (const StiffnessTiles::Pair& pair : pairs)
    if (pair.row != pair.column) {
      ++start[pair.row + 1];
      ++start[pair.column + 1];
    }
  for (int i = 0; i < size(); ++i)
    start[i + 1] += start[i] + 1; // itself, too
  std::vector<int> neighbours(start.back()), next(start.begin(), start.end() - 1);
  for (int i = 0; i < size(); ++i)
    neighbours[next[i]++] = i;
  for (const StiffnessTiles::Pair& pair : pairs)
    if (pair.row != pair.column) {
      neighbours[next[pair.row]++] = pair.column;
      neighbours[next[pair.column]++] = pair.row;
    }
  order_ = fill_reducing_ordering(start, neighbours);
  rank_.resize(size());
  for (int k = 0; k < size(); ++k)
    rank_[order_[k]] = k;
  build_stiffness(std::move(pairs), rank_, {}, {}, problem_, stiffness_, elastic_);
}

MatrixX UncutBody::ordered(const MatrixX& by_node) const {
  MatrixX by_rank(by_node.rows(), by_node.cols());
  for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
    by_rank.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i])) = by_node.middleRows<3>(3 * i);
  return by_rank;
}

MatrixX UncutBody::unordered(const MatrixX& by_rank) const {
  MatrixX by_node(by_rank.rows(), by_rank.cols());
  for (Eigen::Index i = 0; i < std::ssize(rank_); ++i)
    by_node.middleRows<3>(3 * i) = by_rank.middleRows<3>(3 * static_cast<Eigen::Index>(rank_[i]));
  return by_node;
}

VectorX UncutBody::elastic_forces(const VectorX& coefficients) const {
  const Eigen::Map<const SparseMatrix> elastic(stiffness_.rows(), stiffness_.cols(), stiffness_.nonZeros(),
                                               stiffness_.outerIndexPtr(), stiffness_.innerIndexPtr(), elastic_.data());
  return unordered(elastic.selfadjointView<Eigen::Lower>() * VectorX(ordered(coefficients)));
}

} // namespace spherecut::solvers
