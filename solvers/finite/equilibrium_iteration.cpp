// Iterations of a step: the forces of a state, directions of descent, and the line search along them.
#include "solvers/finite/equilibrium.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr int most_trials = 12;            // of one line search
constexpr double wanted_decrease = 1e-4;   // of what the slope promises
constexpr double energy_rounding = 1e-13;  // of an energy
constexpr int most_newton_iterations = 30; // of one round
constexpr int most_times = 20;             // the iterations of a round, before a solve gives up
constexpr int most_factorisations = 200;   // before a solve gives up
constexpr double floor_of_forces = 1e-8;   // mu h^2 of it: forces below are none

} // namespace

bool Equilibrium::is_spent(FiniteMethod method, const EquilibriumStatus& status) const {
  return method == FiniteMethod::newton ? status.factorisations >= most_factorisations
                                        : status.iterations >= most_times * options_.maximum_iterations;
}

void Equilibrium::evaluate(const VectorX& coefficients, const State& target, Trial& trial, EquilibriumStatus& status) {
  ++status.evaluations;
  VectorX completed = coefficients;
  body_.held().complete(completed, target.prescribed);
  trial.coefficients = std::move(completed);
  body_.evaluate(trial.coefficients, forces_);
  trial.least_jacobian = forces_.least_jacobian;
  trial.strain_energy = forces_.energy;
  trial.usable =
      std::isfinite(forces_.energy) && (!body_.minds_volume() || forces_.least_jacobian > options_.least_jacobian);
  if (body_.minds_volume())
    least_seen_ = std::min(least_seen_, forces_.least_jacobian);
  if (!trial.usable)
    return;
  VectorX& residual = trial.residual;
  residual = forces_.forces;
  trial.energy = forces_.energy;
  trial.acting = std::max(prestrain_forces_, state_.gripped);
  if (contact_ && target.tool) {
    trial.energy += contact_->add(trial.coefficients, residual);
    trial.acting = std::max(trial.acting, contact_->force_norm());
  } else if (contact_) {
    contact_->release();
  }
  if (lips_) {
    trial.energy += lips_->contact().add_forces(trial.coefficients, residual);
    trial.acting = std::max(trial.acting, lips_->contact().force_norm());
  }
  if (edges_) {
    trial.energy += edges_->add_forces(trial.coefficients, residual);
    trial.acting = std::max(trial.acting, edges_->force_norm());
  }
  if (target.forces.size() > 0) {
    residual -= target.forces;
    trial.energy -= target.forces.dot(trial.coefficients);
    trial.acting = std::max(trial.acting, target.forces.norm());
  }
  residual -= target.load_factor * body_.loads();
  trial.energy -= target.load_factor * body_.loads().dot(trial.coefficients);
  trial.acting = std::max(trial.acting, std::abs(target.load_factor) * body_.loads().norm());
  VectorX free = residual;
  body_.held().clear_held(free);
  trial.acting = std::max(trial.acting, (residual - free).norm());
  trial.reactions = body_.held().reduce(residual);
  const double h = std::cbrt(body_.volume() / body_.size());
  trial.acting = std::max(trial.acting, floor_of_forces * body_.law().small_strain().shear_modulus * h * h);
  trial.usable = residual.allFinite();
}

std::vector<ActiveConstraint> Equilibrium::active_constraints(const std::vector<Matrix3>& maps, bool with_edges) const {
  std::vector<ActiveConstraint> constraints;
  if (contact_)
    contact_->append_active(maps, constraints);
  if (lips_)
    lips_->contact().append_active(maps, constraints);
  if (edges_ && with_edges)
    edges_->append_active(maps, constraints);
  return constraints;
}

std::vector<int> Equilibrium::touching() const {
  std::vector<int> keys;
  for (const ActiveConstraint& constraint : active_constraints({}))
    keys.push_back(constraint.key);
  return keys;
}

VectorX Equilibrium::answer_of(const VectorX& forces, const std::vector<Matrix3>& maps,
                               const std::vector<ActiveConstraint>& constraints) {
  VectorX carried(forces.size()), answer;
  for (Eigen::Index i = 0; i < std::ssize(maps); ++i)
    carried.segment<3>(3 * i) = maps[i].transpose() * forces.segment<3>(3 * i);
  preconditioner().solve(carried, answer);
  correct(preconditioner(), constraints, responses_, answer);
  for (Eigen::Index i = 0; i < std::ssize(maps); ++i)
    answer.segment<3>(3 * i) = (maps[i] * answer.segment<3>(3 * i)).eval();
  body_.held().complete(answer, {});
  return answer;
}

VectorX Equilibrium::precondition(const VectorX& residual) {
  return answer_of(residual, maps_, active_constraints(maps_));
}

MatrixX Equilibrium::responses(const MatrixX& forces) {
  const std::vector<Matrix3> maps = carrying(body_.piola_maps(state_.coefficients));
  const std::vector<ActiveConstraint> touching = active_constraints(maps, false);
  MatrixX moved(forces.rows(), forces.cols());
  for (Eigen::Index j = 0; j < forces.cols(); ++j)
    moved.col(j) = answer_of(forces.col(j), maps, touching);
  return moved;
}

VectorX Equilibrium::newton_direction(const Trial& now, EquilibriumStatus& status) {
  double shift = 0;
  for (int attempt = 0;; ++attempt) {
    ++status.factorisations;
    try {
      const RestOperator tangent(body_, now.coefficients, &rest_, shift);
      VectorX direction;
      tangent.solve(VectorX(-now.residual), direction);
      ConstraintResponses responses;
      correct(tangent, active_constraints({}), responses, direction);
      body_.held().complete(direction, {});
      return direction;
    } catch (const NumericalError&) { // not positive definite: the rest stiffness helps
      if (attempt == 8)
        throw;
      shift = shift == 0 ? 0.1 : 4 * shift;
    }
  }
}

bool Equilibrium::iterate(const State& target, FiniteMethod method, double tolerance, Trial& now,
                          EquilibriumStatus& status) {
  Trial next;
  const bool quasi = method == FiniteMethod::quasi_newton;
  const int most = quasi ? options_.maximum_iterations : std::min(options_.maximum_iterations, most_newton_iterations);
  for (int iteration = 0;; ++iteration) {
    const double norm = now.residual.norm();
    status.residual = norm / now.acting;
    if (status.residual < tolerance)
      return true;
    if (iteration == most || is_spent(method, status))
      return false;
    ++status.iterations;
    VectorX direction;
    if (quasi) {
      direction = -memory_.solve(now.residual, [&](const VectorX& r) { return precondition(r); });
    } else {
      try {
        direction = newton_direction(now, status);
      } catch (const NumericalError&) {
        return false;
      }
    }
    double slope = now.residual.dot(direction);
    if (!(slope < 0)) {
      memory_.clear();
      direction = -precondition(now.residual);
      slope = now.residual.dot(direction);
      if (!(slope < 0))
        return false;
    }
    const std::vector<int> touched = touching();
    double length = 1;
    bool accepted = false;
    int trials = 0;
    for (; trials < most_trials && !accepted; ++trials) {
      evaluate(now.coefficients + length * direction, target, next, status);
      if (!next.usable) {
        length *= 0.5;
        continue;
      }
      const double rise = next.energy - now.energy;
      accepted = rise <= wanted_decrease * length * slope + energy_rounding * std::abs(now.energy) ||
                 next.residual.norm() < 0.9 * norm;
      if (!accepted) {
        const double curvature = rise - length * slope;
        length *= curvature > 0 ? std::clamp(-0.5 * length * slope / curvature, 0.15, 0.6) : 0.5;
      }
    }
    if (trials > 1)
      ++status.line_searches;
    if (!accepted) {
      if (quasi && !memory_.empty()) {
        memory_.clear();
        evaluate(now.coefficients, target, now, status); // what touches is that of this state again
        continue;
      }
      return false;
    }
    if (quasi && touching() != touched) // what is remembered is of other constraints than those that act now
      memory_.clear();
    else if (quasi)
      memory_.add(next.coefficients - now.coefficients, next.residual - now.residual);
    std::swap(now, next);
  }
}

} // namespace spherecut::solvers
