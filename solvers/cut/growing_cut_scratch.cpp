// A growing cut's system assembled and factored from scratch: what the updated one must equal.
#include "solvers/cut/growing_cut_state.hpp"

namespace spherecut::solvers {

GrowingCut::Scratch GrowingCut::from_scratch(const std::vector<Vector3>& contact_forces) const {
  const State& s = *state_;
  const Problem& problem = s.problem;
  const std::unique_ptr<Spheres> spheres = s.make_spheres();
  const Eigen::Index size = 3 * static_cast<Eigen::Index>(problem.nodes.size());
  MatrixX k = MatrixX::Zero(size, size);
  const double mu = problem.material.shear_modulus(), lambda = problem.material.lame_lambda();
  CellEvaluator evaluator(*spheres);
  BackgroundCells filled;
  std::vector<CellShapes> cells;
  for (const State::Box& box : s.boxes) {
    refill_box(*problem.domain, box.box, s.background(), problem.incision.get(), filled);
    for (int c = 0; c + 1 < std::ssize(filled.start); ++c)
      evaluator.evaluate(filled.of(c), cells.emplace_back());
  }
  StiffnessTiles tiles(problem.nodes.positions);
  std::vector<const CellShapes*> all;
  all.reserve(cells.size());
  for (const CellShapes& cell : cells)
    all.push_back(&cell);
  tiles.add_all(all);
  for (const StiffnessTiles::Pair& pair : tiles.pairs()) {
    const Matrix3 block = pair.stiffness(lambda, mu);
    k.block<3, 3>(3 * static_cast<Eigen::Index>(pair.row), 3 * static_cast<Eigen::Index>(pair.column)) += block;
    if (pair.row != pair.column)
      k.block<3, 3>(3 * static_cast<Eigen::Index>(pair.column), 3 * static_cast<Eigen::Index>(pair.row)) +=
          block.transpose();
  }
  const Shares shares(problem, s.removed);
  const std::vector<DisplacementMean> held = held_means(problem, *spheres, shares);
  for (std::size_t p = 0; p < held.size(); ++p) {
    const Prescribed& entry = problem.prescribed[p];
    const double penalty = constraint_stiffness(problem, entry.node);
    for (std::size_t i = 0; i < held[p].nodes.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j)
        for (int c = 0; c < 3; ++c)
          if (entry.components[c])
            k(3 * held[p].nodes[i] + c, 3 * held[p].nodes[j] + c) += penalty * held[p].weights[i] * held[p].weights[j];
  }
  for (const Anchor& anchor : s.anchors) {
    const double spring = problem.material.young_modulus * problem.nodes.spacings[anchor.node];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b <= a; ++b)
        k(3 * anchor.node + a, 3 * anchor.node + b) += spring * anchor.direction[a] * anchor.direction[b];
  }
  for (Eigen::Index i = 0; i < problem.nodes.size(); ++i)
    if (s.removed[i] != 0)
      k.diagonal().segment<3>(3 * i).setOnes();
  const Eigen::LLT<MatrixX, Eigen::Lower> factor(k);
  if (factor.info() != Eigen::Success)
    throw NumericalError("the system from scratch is not positive definite");
  const auto count = static_cast<Eigen::Index>(s.contact.size());
  MatrixX right = MatrixX::Zero(size, 3 * count + 1);
  std::vector<DisplacementMean> means;
  for (int node : s.options.contact)
    means.push_back(shares.patches.contact_mean(shares.compact[node], *spheres, problem));
  right.col(3 * count) = s.loads;
  for (Eigen::Index c = 0; c < count; ++c)
    for (std::size_t n = 0; n < means[c].nodes.size(); ++n) {
      for (int a = 0; a < 3; ++a)
        right(3 * means[c].nodes[n] + a, 3 * c + a) += means[c].weights[n];
      if (static_cast<std::size_t>(c) < contact_forces.size())
        right.col(3 * count).segment<3>(3 * static_cast<Eigen::Index>(means[c].nodes[n])) +=
            means[c].weights[n] * contact_forces[c];
    }
  const MatrixX solution = factor.solve(right);
  Scratch scratch;
  scratch.compliance.resize(3 * count, 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (Eigen::Index f = 0; f < 3 * count; ++f)
      scratch.compliance.col(f).segment<3>(3 * c) = means[c].of(VectorX(solution.col(f)));
  scratch.coefficients = solution.col(3 * count);
  return scratch;
}

} // namespace spherecut::solvers
