#include "solvers/finite/equilibrium.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double least_predicted_jacobian = 0.05; // predictions are shortened while they squeeze more
constexpr double most_extrapolated = 4;           // last steps that are gone once more
constexpr double left_of_a_rise = 0.1;            // of forces of contact that have risen: what may stay unbalanced
constexpr int most_contact_rounds = 20;           // updates of the forces of contact in a step
constexpr double stride_of_friction = 0.1;        // of the tool's tip radius, at most, in one step
constexpr double stride_of_bonding = 0.5;         // likewise
constexpr int first_edge_key = -1'000'000'000;    // far below those of lips

} // namespace

std::string_view to_string(FiniteMethod method) {
  return method == FiniteMethod::newton ? "newton" : "quasi_newton";
}

FiniteMethod finite_method_from_string(std::string_view name) {
  for (const FiniteMethod method : {FiniteMethod::quasi_newton, FiniteMethod::newton})
    if (name == to_string(method))
      return method;
  throw InputError(fmt::format("solver '{}'; allowed: quasi_newton, newton", name));
}

Equilibrium::Equilibrium(const FiniteBody& body, const EquilibriumOptions& options, const CutLineage& before)
    : body_(body), options_(options), rest_(body, before), memory_(options.memory) {
  if (!(options.tolerance > 0 && options.tolerance < 1))
    throw InputError(
        fmt::format("tolerance {} of the unbalanced forces; allowed: above 0, below 1", options.tolerance));
  if (options.maximum_iterations < 1 || options.halvings < 0 || options.memory < 0)
    throw InputError(fmt::format("{} iterations, {} halvings, memory {}: at least 1, 0 and 0",
                                 options.maximum_iterations, options.halvings, options.memory));
  if (!(options.penetration > 0))
    throw InputError(fmt::format("penetration {} spacings; it must be positive", options.penetration));
  if (!(options.unsettled > 0))
    throw InputError(fmt::format("{} of the acting forces unsettled; it must be positive", options.unsettled));
  set_coefficients(VectorX::Zero(3 * static_cast<Eigen::Index>(body.functions())));
  if (body.prestrain() != Matrix3::Identity()) {
    body.evaluate(state_.coefficients, forces_);
    VectorX free = forces_.forces;
    body.held().clear_held(free);
    double lasting = 1; // of the sudden forces
    for (const PronyTerm& term : body.options().prony)
      lasting -= term.share;
    prestrain_forces_ = lasting * free.norm();
  }
}

void Equilibrium::set_contact(const topology::ToolShape& tool, const std::vector<int>& candidates,
                              const FiniteContactOptions& options) {
  FiniteContact contact(body_, tool, candidates, options);
  let_go();
  contact_.emplace(std::move(contact));
  state_.shares.resize(candidates.size());
}

void Equilibrium::take_hold(const topology::ToolShape& tool, const topology::ToolPose& pose,
                            const std::vector<int>& nodes) {
  topology::check(pose);
  set_contact(tool, nodes, {.condition = ContactCondition::bonded});
  state_.shares = contact_->held(state_.coefficients);
  state_.tool = pose;
}

void Equilibrium::let_go() {
  contact_.reset();
  responses_.clear();
  rest_compliance_ = {};
  memory_.clear();
  state_.shares.clear();
  state_.tool.reset();
  has_before_ = false;
}

void Equilibrium::set_lips(std::vector<LipPair> pairs) {
  FiniteLips lips(body_, std::move(pairs));
  lips_.emplace(std::move(lips));
  responses_.clear();
  rest_compliance_ = {};
  memory_.clear();
  state_.lip_forces.assign(lips_->pairs().size(), 0);
  has_before_ = false;
}

void Equilibrium::set_edges(std::vector<UnilateralMean> edges, std::vector<double> forces) {
  if (!forces.empty() && forces.size() != edges.size())
    throw InputError(fmt::format("{} forces of {} pieces of an edge", forces.size(), edges.size()));
  edges_.reset();
  responses_.erase(responses_.begin(), responses_.upper_bound(first_edge_key));
  memory_.clear();
  has_before_ = false;
  forces.resize(edges.size(), 0);
  state_.edge_forces = std::move(forces);
  state_.advances = VectorX::Zero(std::ssize(edges));
  if (edges.empty())
    return;
  edges_.emplace(first_edge_key);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    state_.advances[static_cast<Eigen::Index>(e)] = edges[e].direction.dot(edges[e].mean.of(state_.coefficients));
    edges_->add(std::move(edges[e]));
  }
}

void Equilibrium::set_coefficients(const VectorX& coefficients, double load_factor,
                                   const std::optional<topology::ToolPose>& tool, std::vector<ContactShare> shares) {
  if (coefficients.size() != 3 * static_cast<Eigen::Index>(body_.functions()) || !coefficients.allFinite())
    throw InputError(fmt::format("{} coefficients for {} functions; 3 finite numbers of each are wanted",
                                 coefficients.size(), body_.functions()));
  if (!std::isfinite(load_factor))
    throw InputError(fmt::format("load factor {} is not finite", load_factor));
  if (tool)
    topology::check(*tool);
  const std::size_t candidates = contact_ ? contact_->candidates().size() : 0;
  if (!shares.empty() && shares.size() != candidates)
    throw InputError(fmt::format("{} shares of a contact with {} candidates", shares.size(), candidates));
  shares.resize(candidates);
  state_.coefficients = coefficients;
  state_.load_factor = load_factor;
  state_.tool = tool;
  state_.shares = std::move(shares);
  state_.gripped = 0;
  std::fill(state_.lip_forces.begin(), state_.lip_forces.end(), 0.0);
  std::fill(state_.edge_forces.begin(), state_.edge_forces.end(), 0.0);
  state_.forces.resize(0);
  reactions_.assign(body_.held().entries().size(), Vector3::Zero());
  state_.prescribed.clear();
  for (const DisplacementMean& mean : body_.held().means())
    state_.prescribed.push_back(mean.of(coefficients));
  set_tangent(nullptr);
  has_before_ = false;
}

Equilibrium::State Equilibrium::target_of(const FiniteLoading& loading) const {
  State target;
  const std::size_t entries = body_.held().entries().size();
  target.prescribed = loading.prescribed.empty() ? body_.prescribed_values() : loading.prescribed;
  if (target.prescribed.size() != entries)
    throw InputError(fmt::format("{} prescribed displacements; the problem has {}", target.prescribed.size(), entries));
  for (std::size_t k = 0; k < entries; ++k)
    if (!target.prescribed[k].allFinite())
      throw InputError(fmt::format("prescribed displacement {} is not finite", k));
  if (!std::isfinite(loading.load_factor))
    throw InputError(fmt::format("load factor {} is not finite", loading.load_factor));
  target.load_factor = loading.load_factor;
  if (loading.tool) {
    if (!contact_)
      throw InputError("a pose of a tool, but no tool: set_contact comes first");
    topology::check(*loading.tool);
    target.tool = loading.tool;
  }
  target.shares = state_.shares;
  target.lip_forces = state_.lip_forces;
  target.edge_forces = state_.edge_forces;
  if (loading.forces.size() > 0 && (loading.forces.size() != state_.coefficients.size() || !loading.forces.allFinite()))
    throw InputError(fmt::format("{} nodal forces; {} finite numbers are wanted, N", loading.forces.size(),
                                 state_.coefficients.size()));
  target.forces = loading.forces;
  target.advances = loading.advances.size() > 0 ? loading.advances : state_.advances;
  if (target.advances.size() != state_.advances.size() || !target.advances.allFinite())
    throw InputError(fmt::format("{} advances of an edge of {} pieces; one finite number a piece is wanted, m",
                                 target.advances.size(), state_.advances.size()));
  return target;
}

Equilibrium::State Equilibrium::between(const State& from, const State& to, double part) const {
  State state = to;
  for (std::size_t k = 0; k < to.prescribed.size(); ++k)
    state.prescribed[k] = (1 - part) * from.prescribed[k] + part * to.prescribed[k];
  state.load_factor = (1 - part) * from.load_factor + part * to.load_factor;
  state.advances = (1 - part) * from.advances + part * to.advances;
  if (from.forces.size() > 0 || to.forces.size() > 0) {
    const VectorX none = VectorX::Zero(from.coefficients.size());
    state.forces =
        (1 - part) * (from.forces.size() > 0 ? from.forces : none) + part * (to.forces.size() > 0 ? to.forces : none);
  }
  if (from.tool && to.tool) {
    state.tool->point = (1 - part) * from.tool->point + part * to.tool->point;
    const Vector3 axis = (1 - part) * from.tool->axis + part * to.tool->axis;
    if (axis.norm() > 1e-6)
      state.tool->axis = axis.normalized();
  }
  return state;
}

/// Everything that moves, as lengths: the way from one state to another.
VectorX Equilibrium::motion(const State& from, const State& to) const {
  const auto entries = static_cast<Eigen::Index>(to.prescribed.size());
  VectorX way = VectorX::Zero(3 * entries + 7 + to.advances.size());
  way.tail(to.advances.size()) = to.advances - from.advances;
  for (Eigen::Index k = 0; k < entries; ++k)
    way.segment<3>(3 * k) = to.prescribed[k] - from.prescribed[k];
  const double size = std::cbrt(body_.volume());
  way[3 * entries] = size * (to.load_factor - from.load_factor);
  if (from.tool && to.tool) {
    way.segment<3>(3 * entries + 1) = to.tool->point - from.tool->point;
    way.segment<3>(3 * entries + 4) = size * (to.tool->axis - from.tool->axis);
  }
  return way;
}

/// Steps of a solve before any is halved: more than one where friction or bonding minds the way.
int Equilibrium::strides(const State& target) const {
  const auto is_held = [](const ContactShare& share) { return share.touches; };
  const bool bonds = contact_ && contact_->options().condition == ContactCondition::bonded;
  if (!minds_way() || !target.tool || (bonds && std::all_of(state_.shares.begin(), state_.shares.end(), is_held)))
    return 1;
  const topology::ToolPose from = state_.tool.value_or(contact_->clear_pose(*target.tool, state_.coefficients));
  const double radius = topology::tip_radius(contact_->tool());
  const double part = bonds ? stride_of_bonding : stride_of_friction;
  const double way = (target.tool->point - from.point).norm() + radius * (target.tool->axis - from.axis).norm();
  return std::max(1, static_cast<int>(std::ceil(way / (part * radius))));
}

EquilibriumStatus Equilibrium::solve(const FiniteLoading& loading) {
  const State target = target_of(loading), begin = state_, before = before_;
  const bool had_before = has_before_;
  const std::vector<Vector3> reactions = reactions_;
  EquilibriumStatus status;
  if (!(loading.tolerance >= 0 && loading.tolerance < 1))
    throw InputError(fmt::format("tolerance {} of the unbalanced forces; allowed: 0 to below 1", loading.tolerance));
  tolerance_ = loading.tolerance > 0 ? loading.tolerance : options_.tolerance;
  least_seen_ = last_residual_ = 1;
  last_unsettled_ = 0;
  const auto go_back = [&] {
    state_ = begin;
    before_ = before;
    has_before_ = had_before;
    reactions_ = reactions;
    memory_.clear();
    if (lips_)
      lips_->contact().set_known_forces(state_.lip_forces);
    if (edges_)
      edges_->set_known_forces(state_.edge_forces);
  };
  bool found = true;
  try {
    const int steps = strides(target);
    if (minds_way() && target.tool && !state_.tool)
      state_.tool = contact_->clear_pose(*target.tool, state_.coefficients);
    const State start = state_;
    for (int k = 1; found && k <= steps; ++k)
      found =
          go(k < steps ? between(start, target, static_cast<double>(k) / steps) : target, options_.halvings, status);
  } catch (...) { // of a law that is a function, or an interruption
    go_back();
    throw;
  }
  if (!found) {
    const double whole = motion(begin, target).norm();
    const double reached = whole > 0 ? motion(begin, state_).norm() / whole : 0;
    go_back();
    throw NumericalError(fmt::format(
        "no equilibrium found: {:.3g} of the step was reached in {} iterations and {} halvings; the unbalanced force "
        "is {:.3g} of the acting ones (limit {:.3g}), the least volume ratio {:.3g}{}{}{}; the condition of the rest "
        "stiffness is {:.3g}",
        reached, status.iterations, status.halvings, last_residual_, tolerance_, least_seen_,
        least_seen_ <= options_.least_jacobian ? ": the body is about to be inverted" : "",
        last_residual_ < tolerance_ && deepest(target) > options_.penetration
            ? fmt::format(", the surface {:.3g} spacings deep in {} (limit {:.3g})", deepest(target),
                          contact_ && target.tool && contact_->deepest() > options_.penetration ? "the tool"
                                                                                                : "itself at a cut",
                          options_.penetration)
            : "",
        last_residual_ < tolerance_ && last_unsettled_ > 0
            ? fmt::format(", friction or bonds still change by {:.3g} of the acting forces a round", last_unsettled_)
            : "",
        rest_.condition()));
  }
  renew_preconditioner(status);
  return status;
}

bool Equilibrium::go(const State& target, int halvings, EquilibriumStatus& status) {
  const bool may_go_on = !is_spent(options_.method, status);
  const bool has_newton =
      options_.fall_back && options_.method != FiniteMethod::newton && !is_spent(FiniteMethod::newton, status);
  if (!may_go_on && !has_newton)
    return false;
  if (step(target, may_go_on ? options_.method : FiniteMethod::newton, status))
    return true;
  if (tangent_ && may_go_on) { // it may be too far away
    set_tangent(nullptr);
    if (step(target, options_.method, status))
      return true;
  }
  if (halvings > 0 && motion(state_, target).norm() > 0) {
    ++status.halvings;
    const State middle = between(state_, target, 0.5);
    return go(middle, halvings - 1, status) && go(target, halvings - 1, status);
  }
  return may_go_on && has_newton && step(target, FiniteMethod::newton, status);
}

std::vector<Matrix3> Equilibrium::carrying(std::vector<Matrix3> maps) const {
  const Matrix3 prestrained = body_.prestrain() / body_.prestrain().determinant();
  if (prestrained != Matrix3::Identity())
    for (Matrix3& map : maps)
      map *= prestrained;
  if (tangent_)
    for (std::size_t i = 0; i < maps.size(); ++i)
      maps[i] *= tangent_->back[i];
  return maps;
}

void Equilibrium::set_tangent(std::unique_ptr<CarriedTangent> tangent) {
  tangent_ = std::move(tangent);
  excess_ = 0;
  memory_.clear();
  responses_.clear();
  rest_compliance_ = {};
}

// What happens depends on counts of iterations alone, so that the bits do not depend on the machine.
void Equilibrium::renew_preconditioner(const EquilibriumStatus& status) {
  if (options_.worth_of_tangent == 0 || options_.method != FiniteMethod::quasi_newton)
    return;
  excess_ += std::max(0, status.iterations - options_.few_iterations);
  if (excess_ < options_.worth_of_tangent)
    return;
  const std::unique_ptr<CarriedTangent> before = std::exchange(tangent_, nullptr);
  std::vector<Matrix3> back = carrying(body_.piola_maps(state_.coefficients));
  for (Matrix3& map : back)
    map = map.inverse().eval();
  try {
    set_tangent(std::make_unique<CarriedTangent>(RestOperator(body_, state_.coefficients), std::move(back)));
  } catch (const NumericalError&) { // not positive definite: the rest operator is
    set_tangent(nullptr);
  }
}

// C = A C_0 A^T with the maps A at the candidates, less what the lips that touch hold back.
MatrixX Equilibrium::contact_compliance(const std::vector<int>& chosen) {
  if (!contact_)
    throw InputError("the compliance of a contact, but no tool: set_contact comes first");
  const std::vector<DisplacementMean>& means = contact_->means();
  const auto size = std::ssize(chosen);
  std::vector<const DisplacementMean*> of;
  of.reserve(chosen.size());
  for (const int c : chosen)
    of.push_back(&means[static_cast<std::size_t>(c)]);
  find_responses(preconditioner(), chosen, of, responses_);
  if (rest_compliance_.chosen != chosen || rest_compliance_.matrix.rows() != 3 * size) {
    rest_compliance_.chosen = chosen;
    rest_compliance_.matrix.resize(3 * size, 3 * size);
    for (Eigen::Index j = 0; j < size; ++j) {
      const MatrixX& response = responses_.at(chosen[j]);
      for (Eigen::Index i = 0; i <= j; ++i) {
        const Matrix3 between = mean_response(*of[i], response);
        rest_compliance_.matrix.block<3, 3>(3 * i, 3 * j) = between;
        rest_compliance_.matrix.block<3, 3>(3 * j, 3 * i) = between.transpose();
      }
    }
  }
  const std::vector<Matrix3> maps = carrying(body_.piola_maps(state_.coefficients));
  const auto map_of = [&](Eigen::Index i) -> const Matrix3& { return maps[contact_->candidates()[chosen[i]]]; };
  MatrixX carried(3 * size, 3 * size);
  for (Eigen::Index j = 0; j < size; ++j)
    for (Eigen::Index i = 0; i < size; ++i)
      carried.block<3, 3>(3 * i, 3 * j) =
          map_of(i) * rest_compliance_.matrix.block<3, 3>(3 * i, 3 * j) * map_of(j).transpose();
  std::vector<ActiveConstraint> closed;
  if (lips_)
    lips_->contact().append_active(maps, closed);
  if (closed.empty())
    return carried;
  const auto count = std::ssize(closed);
  std::vector<int> keys;
  std::vector<const DisplacementMean*> apart;
  for (const ActiveConstraint& constraint : closed) {
    keys.push_back(constraint.key);
    apart.push_back(constraint.mean);
  }
  find_responses(preconditioner(), keys, apart, responses_);
  MatrixX to_lips(3 * size, count), between_lips(count, count);
  for (Eigen::Index l = 0; l < count; ++l) {
    const MatrixX& response = responses_.at(closed[l].key);
    for (Eigen::Index i = 0; i < size; ++i)
      to_lips.block<3, 1>(3 * i, l) = map_of(i) * (mean_response(*of[i], response) * closed[l].direction);
    for (Eigen::Index k = 0; k <= l; ++k)
      between_lips(k, l) = between_lips(l, k) =
          closed[k].direction.dot(mean_response(*closed[k].mean, response) * closed[l].direction);
    between_lips(l, l) += 1 / closed[l].stiffness;
  }
  carried -= to_lips * between_lips.ldlt().solve(to_lips.transpose());
  return 0.5 * (carried + carried.transpose());
}

bool Equilibrium::step(const State& target, FiniteMethod method, EquilibriumStatus& status) {
  Trial now;
  if (!begin_step(target, now, status))
    return false;
  const bool converged = settle(target, method, now, status);
  last_residual_ = status.residual;
  last_unsettled_ = is_settled(target, now) ? 0 : contact_->unsettled() / now.acting;
  if (!converged)
    return false;
  if (method == FiniteMethod::newton)
    ++status.newton_steps;
  accept_step(target, now, status);
  return true;
}

/// A state to iterate from: where the last steps lead to, or nearer where that has no energy. False: there is none.
bool Equilibrium::begin_step(const State& target, Trial& now, EquilibriumStatus& status) {
  const std::vector<Matrix3> maps = body_.piola_maps(state_.coefficients);
  maps_ = carrying(maps);
  const double ahead = extrapolation(target);
  const VectorX prediction =
      ahead != 0 ? VectorX(ahead * (state_.coefficients - before_.coefficients)) : predict(target);
  if (contact_ && target.tool) {
    std::vector<ContactShare> shares = state_.shares;
    if (ahead != 0 && before_.shares.size() == shares.size())
      for (std::size_t c = 0; c < shares.size(); ++c) {
        const ContactShare& before = before_.shares[c];
        shares[c].pressing = std::max(0.0, shares[c].pressing + ahead * (shares[c].pressing - before.pressing));
        if (shares[c].touches && before.touches)
          shares[c].along += ahead * (shares[c].along - before.along);
      }
    contact_->begin_step(state_.tool, *target.tool, std::move(shares), state_.coefficients);
  }
  if (lips_) {
    lips_->turn(maps);
    std::vector<double> forces = state_.lip_forces;
    if (ahead != 0 && before_.lip_forces.size() == forces.size())
      for (std::size_t p = 0; p < forces.size(); ++p)
        forces[p] = std::max(0.0, forces[p] + ahead * (forces[p] - before_.lip_forces[p]));
    lips_->contact().set_known_forces(forces);
  }
  if (edges_) {
    std::vector<double> forces = state_.edge_forces;
    if (ahead != 0 && before_.edge_forces.size() == forces.size())
      for (std::size_t e = 0; e < forces.size(); ++e)
        forces[e] = std::max(0.0, forces[e] + ahead * (forces[e] - before_.edge_forces[e]));
    edges_->set_known_forces(forces);
    for (std::size_t e = 0; e < edges_->means().size(); ++e)
      edges_->mean(e).at_rest = -target.advances[static_cast<Eigen::Index>(e)] * edges_->means()[e].direction;
  }
  double part = 1;
  for (int trial = 0; trial < 7; ++trial, part *= 0.5) {
    const VectorX start = trial < 6 ? VectorX(state_.coefficients + part * prediction) : state_.coefficients;
    evaluate(start, target, now, status);
    if (now.usable && (!body_.minds_volume() || now.least_jacobian > least_predicted_jacobian))
      break;
  }
  if (now.usable && target.tool && contact_ && contact_->options().condition == ContactCondition::bonded &&
      contact_->renew()) // what the tool has overtaken is held from the start
    evaluate(VectorX(now.coefficients), target, now, status);
  return now.usable;
}

/// Rounds of iterations, until forces balance and nothing lies in the tool or in itself along the normals as they are
/// then, and friction keeps the limits of the forces as they are then.
bool Equilibrium::settle(const State& target, FiniteMethod method, Trial& now, EquilibriumStatus& status) {
  const bool grips = minds_way() && target.tool;
  bool converged = iterate(target, method, tolerance_, now, status);
  for (int round = 0; converged; ++round) {
    std::vector<double> balanced; // forces of the lips along the normals so far
    bool caught = false;
    if (lips_) {
      balanced = lips_->contact().forces();
      lips_->turn(body_.piola_maps(now.coefficients));
    }
    if (grips)
      caught = contact_->renew();
    if (lips_ || grips) {
      evaluate(now.coefficients, target, now, status);
      status.residual = now.residual.norm() / now.acting;
    }
    if (status.residual < tolerance_ && deepest(target) <= options_.penetration && is_settled(target, now))
      break;
    if (round == most_contact_rounds)
      return false;
    if (caught) // a new node is a new problem; there are only so many
      --round;
    else if (contact_)
      contact_->accept_forces();
    if (lips_)
      lips_->contact().set_known_forces(balanced);
    if (edges_)
      edges_->accept_forces();
    // The forces of contact have risen by what is unbalanced now. Where loads or a pre-strain are much larger, that may
    // be below the tolerance; the body has to yield to it all the same before they rise again.
    evaluate(now.coefficients, target, now, status);
    const double risen = now.residual.norm() / now.acting;
    converged = iterate(target, method, std::min(tolerance_, left_of_a_rise * risen), now, status);
  }
  return converged;
}

bool Equilibrium::minds_way() const {
  return contact_ && contact_->options().condition != ContactCondition::frictionless;
}

bool Equilibrium::is_settled(const State& target, const Trial& now) const {
  if (!contact_ || !target.tool)
    return true;
  const double gripping = std::max(contact_->force_norm(), state_.gripped); // loads may be far larger
  return contact_->unsettled() <= std::max(options_.unsettled * gripping, tolerance_ * now.acting);
}

/// The state becomes that of the trial, which is in equilibrium.
void Equilibrium::accept_step(const State& target, const Trial& now, EquilibriumStatus& status) {
  State next = target;
  next.coefficients = now.coefficients;
  next.shares.assign(state_.shares.size(), {});
  next.gripped = 0;
  if (contact_ && target.tool) {
    next.shares = contact_->end_step();
    if (minds_way())
      next.gripped = contact_->force_norm();
    status.friction = contact_->friction_force();
    status.friction_work += contact_->friction_work();
    status.touching = contact_->touching();
    status.tool_force = contact_->tool_force();
    status.tool_torque = contact_->tool_torque();
  }
  if (lips_) {
    lips_->contact().accept_forces();
    next.lip_forces = lips_->contact().known_forces();
    status.closed = lips_->contact().touching();
  }
  if (edges_) {
    edges_->accept_forces();
    next.edge_forces = edges_->known_forces();
    status.pressing = edges_->touching();
  }
  status.penetration = deepest(target);
  before_ = std::move(state_);
  has_before_ = true;
  state_ = std::move(next);
  reactions_ = now.reactions;
  ++status.steps;
  status.converged = true;
  status.energy = now.strain_energy;
  status.least_jacobian = now.least_jacobian;
}

/// How many times the last step is to be gone once more; 0 where this one goes elsewhere.
double Equilibrium::extrapolation(const State& target) const {
  if (!has_before_)
    return 0;
  const VectorX way = motion(state_, target), last = motion(before_, state_);
  const double along = last.dot(way);
  if (!(along * along > 0.5 * last.squaredNorm() * way.squaredNorm()))
    return 0;
  const double times = along / last.squaredNorm();
  return std::abs(times) < most_extrapolated ? times : 0;
}

VectorX Equilibrium::predict(const State& target) {
  VectorX prediction = VectorX::Zero(state_.coefficients.size());
  const double more = target.load_factor - state_.load_factor;
  bool moved = more != 0 && !body_.loads().isZero(0);
  if (moved)
    prediction = more * body_.loads();
  for (std::size_t e = 0; e < target.prescribed.size(); ++e) {
    const Prescribed& entry = body_.held().entries()[e];
    const DisplacementMean& mean = body_.held().means()[e];
    const Vector3 way_here = held_part(entry, target.prescribed[e] - state_.prescribed[e]);
    if (way_here.isZero(0))
      continue;
    moved = true;
    const Vector3 force = body_.penalty_stiffness(static_cast<int>(e), RestOperator::penalty) * way_here;
    for (std::size_t k = 0; k < mean.nodes.size(); ++k)
      prediction.segment<3>(3 * mean.nodes[k]) += mean.weights[k] * force;
  }
  if (moved) {
    const VectorX right = prediction;
    rest_.solve(right, prediction);
  }
  return prediction;
}

double Equilibrium::deepest(const State& target) const {
  return std::max({contact_ && target.tool ? contact_->deepest() : 0.0, lips_ ? lips_->contact().deepest() : 0.0,
                   edges_ ? edges_->deepest() : 0.0});
}

} // namespace spherecut::solvers
