#include "src/model/finite_model.hpp"

#include "solvers/contact/friction.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/finite/transfer.hpp"
#include "solvers/release/front_states.hpp"
#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

/// Of the spacing: what is left of a share's middle in the tool.
constexpr double most_penetration = 1e-3;
/// Of the acting forces, gravity among them: a small force of contact is to be told from what is left.
constexpr double most_unbalanced = 1e-4;
/// Of the spacing: nodes as near to each other are the same.
constexpr double same_place = 1e-9;

solvers::EquilibriumOptions equilibrium_options(Patience patience) {
  solvers::EquilibriumOptions options;
  options.penetration = most_penetration;
  options.tolerance = most_unbalanced;
  if (patience == Patience::of_a_hand) {
    options.maximum_iterations = 40;
    options.halvings = 3;
    options.fall_back = false;
  }
  return options;
}

solvers::FiniteOptions body_options(const Scenario& scenario) {
  solvers::FiniteOptions options;
  options.prony = scenario.law.spec.prony;
  options.sight = sight_of(scenario);
  return options;
}

struct Hindrance {
  std::string what; // empty: none
  int line = 0;
};

Hindrance hindrance_of(const Scenario& scenario) {
  const int line = scenario.law.line;
  if (!scenario.law.spec.prony.empty() && scenario.blade)
    return {"[blade] with material.prony", scenario.blade->line};
  if (scenario.method.method != solvers::Method::galerkin)
    return {fmt::format("method.name = \"{}\"", solvers::to_string(scenario.method.method)), line};
  if (scenario.blade && scenario.toughness > 0 && scenario.tearing.enabled)
    return {"[blade] with material.toughness and [tearing]", scenario.blade->line};
  const bool cuts = scenario.blade || !scenario.precuts.empty();
  if (cuts && scenario.cut.lips == solvers::LipCondition::sticking)
    return {"cut.lips = \"sticking\"", line};
  if (scenario.tearing.enabled && !scenario.law.spec.prony.empty())
    return {"[tearing] with material.prony", line};
  if (scenario.tearing.enabled && scenario.tearing.strength > 0)
    return {"tearing.strength", line};
  return {};
}

std::function<solvers::FibreFrame(const Vector3&)> fibre_field(const LawSettings& law) {
  const auto* fibres = std::get_if<solvers::HolzapfelLaw>(&law.spec.law);
  if (law.own || fibres == nullptr || fibres->same_everywhere)
    return nullptr;
  return [law](const Vector3& x) { return law.fibres_at(x); };
}

solvers::Problem checked_problem(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                                 const BodyModel& nodes) {
  require_run(scenario);
  return problem_of(scenario, domain, nodes);
}

/// Free nodes of the organ's own surface.
std::vector<int> free_surface(const solvers::Problem& problem) {
  const std::vector<std::array<bool, 3>> held = held_axes(problem.prescribed, problem.nodes.size());
  std::vector<int> free;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (on_surface(problem.nodes.kinds[i]) && gives_way(held[i], problem.nodes.normals[i]))
      free.push_back(i);
  return free;
}

} // namespace

void require_run(const Scenario& scenario) {
  if (!is_nonlinear(scenario.law)) {
    require_linear(scenario.file, scenario.law);
    return;
  }
  const Hindrance hindrance = hindrance_of(scenario);
  if (hindrance.what.empty())
    return;
  throw InputError(fmt::format("{}:{}: {} does not go with material.law = \"{}\"; possible with it: fixed regions, "
                               "gravity, pre-tension, precuts, their tearing, a blade, and a tool "
                               "that presses, rubs, bonds or grasps, by method galerkin",
                               scenario.file.string(), hindrance.line, hindrance.what, name_of(scenario.law)));
}

bool can_run(const Scenario& scenario) {
  return is_nonlinear(scenario.law) ? hindrance_of(scenario).what.empty() : scenario.law.spec.prony.empty();
}

FiniteModel::FiniteModel(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                         const BodyModel& nodes, bool touched, Patience patience)
    : fibres_(fibre_field(scenario.law)), body_(checked_problem(scenario, domain, nodes), law_of(scenario.law),
                                                body_options(scenario), fibres_, nodes.lineage.uncut),
      equilibrium_(body_, equilibrium_options(patience), nodes.lineage),
      is_prestrained_(!scenario.pretension.isZero(0)), pairs_(body_, nodes.pairs) {
  if (!nodes.pairs.empty() && scenario.cut.lips != solvers::LipCondition::open)
    equilibrium_.set_lips(nodes.pairs);
  if (!touched)
    return;
  tool_ = scenario.tool->shape;
  if (scenario.tool->grasp) // it presses on nothing
    return;
  set_candidates(free_surface(body_.problem()));
  equilibrium_.set_contact(*tool_, candidates_,
                           {.condition = scenario.contact.condition, .friction = scenario.contact.friction});
  lay_skin();
}

void FiniteModel::set_candidates(std::vector<int> nodes) {
  candidates_ = std::move(nodes);
  rest_.clear();
  for (const int node : candidates_)
    rest_.push_back(body_.contact_mean(node).centroid);
}

void FiniteModel::take_hold(const std::vector<int>& nodes, const topology::ToolPose& pose) {
  equilibrium_.take_hold(*tool_, pose, nodes);
  set_candidates(nodes);
  pose_ = pose;
}

void FiniteModel::hold_on(const std::vector<int>& nodes, const FiniteModel& before) {
  take_hold(nodes, *before.pose_);
  std::vector<solvers::ContactShare> shares(nodes.size());
  for (std::size_t c = 0; c < nodes.size(); ++c) {
    std::size_t nearest = 0;
    for (std::size_t k = 0; k < before.rest_.size(); ++k)
      if ((before.rest_[k] - rest_[c]).squaredNorm() < (before.rest_[nearest] - rest_[c]).squaredNorm())
        nearest = k;
    shares[c] = before.free_shares()[nearest];
    shares[c].anchor += rest_[c] - before.rest_[nearest];
  }
  equilibrium_.set_coefficients(equilibrium_.coefficients(), 1, before.pose_, std::move(shares));
}

// What is let go may be far from where it comes to rest, and the way there is no equilibrium: it is found from the body
// at rest.
void FiniteModel::let_go() {
  equilibrium_.let_go();
  begin_anew();
  set_candidates({});
  pose_.reset();
}

std::vector<FiniteModel::Touch> FiniteModel::touches() const {
  std::vector<Touch> touching;
  if (equilibrium_.contact() == nullptr || !pose_)
    return touching;
  const std::vector<Vector3> forces = equilibrium_.contact()->forces();
  for (std::size_t c = 0; c < forces.size(); ++c)
    if (!forces[c].isZero(0))
      touching.push_back({rest_[c], body_.problem().nodes.spacings[candidates_[c]]});
  return touching;
}

void FiniteModel::lay_skin() {
  const topology::SurfaceMesh& surface = body_.problem().domain->surface();
  std::vector<Vector3> points = surface.vertices;
  for (const auto& triangle : surface.triangles)
    points.emplace_back(
        (surface.vertices[triangle[0]] + surface.vertices[triangle[1]] + surface.vertices[triangle[2]]) / 3);
  solvers::ShapeFunctions shape;
  for (const Vector3& x : points) {
    if (!body_.evaluate(x, shape))
      continue;
    skin_.rest.push_back(x);
    for (int k = 0; k < shape.size(); ++k) {
      skin_.functions.push_back(shape.nodes[k]);
      skin_.values.push_back(shape.value[k]);
    }
    skin_.start.push_back(static_cast<int>(skin_.functions.size()));
  }
}

double FiniteModel::deepest(const topology::ToolPose& pose) const {
  const VectorX& coefficients = equilibrium_.coefficients();
  double depth = 0;
  for (std::size_t p = 0; p < skin_.rest.size(); ++p) {
    Vector3 x = skin_.rest[p];
    for (int k = skin_.start[p]; k < skin_.start[p + 1]; ++k)
      x += skin_.values[k] * coefficients.segment<3>(3 * static_cast<Eigen::Index>(skin_.functions[k]));
    depth = std::max(depth, -topology::tool_distance(*tool_, pose, x));
  }
  return depth;
}

void FiniteModel::summarise_contact(FiniteStep& step) const {
  const std::vector<Vector3> forces = equilibrium_.contact()->forces();
  Vector3 centre = Vector3::Zero();
  double weight = 0;
  for (std::size_t c = 0; c < forces.size(); ++c) {
    centre += forces[c].norm() * rest_[c];
    weight += forces[c].norm();
  }
  for (std::size_t c = 0; c < forces.size(); ++c)
    if (forces[c].norm() > 0)
      step.contact_radius = std::max(step.contact_radius, (rest_[c] - centre / weight).norm() +
                                                              0.5 * body_.problem().nodes.spacings[candidates_[c]]);
}

// Of what is bonded or held, what does not act along the normals of the deformed surface.
Vector3 FiniteModel::force_along_surface() const {
  const std::vector<Vector3> forces = equilibrium_.contact()->forces();
  const std::vector<Matrix3> maps = body_.piola_maps(equilibrium_.coefficients());
  Vector3 sum = Vector3::Zero();
  for (std::size_t c = 0; c < forces.size(); ++c) {
    const int node = candidates_[c];
    const Vector3 normal = (maps[node].inverse().transpose() * body_.problem().nodes.normals[node]).normalized();
    sum -= solvers::along_surface(forces[c], normal);
  }
  return sum;
}

void FiniteModel::go_on_from(const BodyModel& before) {
  const VectorX start = state_from(before);
  if (before.finite == nullptr || equilibrium_.contact() == nullptr) {
    equilibrium_.set_coefficients(start, 1);
    return;
  }
  const FiniteModel& old = *before.finite;
  std::vector<solvers::ContactShare> shares;
  if (!old.may_begin_anew())
    shares = shares_from(old, start);
  equilibrium_.set_coefficients(start, 1, old.pose_, std::move(shares));
}

// On the same uncut body what is there goes on. Else nodes that both bodies have keep their coefficients; new ones, and
// those about new ones and about some that are gone, whose shape functions are others now, take those with which the
// body is strained as it was.
VectorX FiniteModel::state_from(const BodyModel& before) const {
  constexpr double about = 2; // radii of the sphere of a node that is new, or gone
  const solvers::NodeCloud& nodes = body_.problem().nodes;
  const std::vector<Vector3>& places = body_.spheres().centres();
  VectorX start(3 * static_cast<Eigen::Index>(body_.functions()));
  if (before.finite == nullptr) {
    for (int i = 0; i < body_.functions(); ++i)
      start.segment<3>(3 * static_cast<Eigen::Index>(i)) = before.at(places[body_.node_of(i)]).displacement;
    return start;
  }
  const VectorX& old = before.finite->coefficients();
  solvers::ShapeFunctions shape;
  const auto strained_before = [&](const Vector3& x) -> Matrix3 {
    Matrix3 deformation = Matrix3::Identity();
    before.shape_at(x, shape);
    for (int k = 0; k < shape.size(); ++k)
      deformation += old.segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) * shape.gradient(k).transpose();
    return deformation;
  };
  if (lineage().uncut != nullptr && lineage().uncut == before.finite->lineage().uncut) {
    std::vector<char> is_new;
    start = body_.cut_functions()->state_from(*before.finite->body_.cut_functions(), old, is_new);
    return solvers::nearest_state(body_, std::move(start), is_new, strained_before);
  }
  const std::vector<Vector3>& places_before = before.finite->spheres().centres();
  const topology::PointTree known(places_before), here(places);
  std::vector<char> free(static_cast<std::size_t>(body_.functions()), 0);
  std::vector<topology::PointTree::Found> near;
  const auto free_about = [&](const Vector3& x, double radius) {
    near.clear();
    here.within(x, about * radius, near);
    for (const topology::PointTree::Found& found : near)
      free[found.index] = 1;
  };
  for (int i = 0; i < std::ssize(places); ++i) {
    const Vector3& x = places[i];
    const topology::PointTree::Found nearest = known.nearest(x);
    const double same = same_place * nodes.spacings[i];
    if (nearest.index >= 0 && nearest.squared_distance < same * same) {
      start.segment<3>(3 * static_cast<Eigen::Index>(i)) = old.segment<3>(3 * static_cast<Eigen::Index>(nearest.index));
      continue;
    }
    start.segment<3>(3 * static_cast<Eigen::Index>(i)) = before.at(x).displacement;
    free_about(x, body_.spheres().radii()[i]);
  }
  for (int i = static_cast<int>(places.size()); i < body_.functions(); ++i) {
    start.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        start.segment<3>(3 * static_cast<Eigen::Index>(body_.node_of(i)));
    free[i] = 1;
  }
  for (int i = 0; i < std::ssize(places_before); ++i) {
    const Vector3& x = places_before[i];
    const topology::PointTree::Found nearest = here.nearest(x);
    const double same = same_place * before.nodes().spacings[i];
    if (nearest.squared_distance >= same * same)
      free_about(x, before.sphere_radius(i));
  }
  return solvers::nearest_state(body_, std::move(start), free, strained_before);
}

// A node that both bodies have keeps its place on the tool. One that is new where the tool touches sticks where it is
// now, with the force of the nearest share that was there, by their areas.
std::vector<solvers::ContactShare> FiniteModel::shares_from(const FiniteModel& before, const VectorX& start) const {
  const std::vector<solvers::ContactShare>& old = before.free_shares();
  const solvers::NodeCloud& nodes = body_.problem().nodes;
  std::vector<Vector3> places;
  for (const int node : before.candidates_)
    places.push_back(before.body_.problem().nodes.positions[node]);
  const topology::PointTree tree(places);
  std::vector<solvers::ContactShare> shares(candidates_.size());
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    const topology::PointTree::Found nearest = tree.nearest(nodes.positions[candidates_[c]]);
    const double spacing = nodes.spacings[candidates_[c]];
    if (nearest.index < 0 || !old[nearest.index].touches || nearest.squared_distance > spacing * spacing)
      continue;
    shares[c] = old[nearest.index];
    if (nearest.squared_distance < same_place * same_place * spacing * spacing) {
      shares[c].anchor += rest_[c] - before.rest_[nearest.index];
      continue;
    }
    const double area = before.body_.contact_mean(before.candidates_[nearest.index]).area;
    const double ratio = area > 0 ? body_.contact_mean(candidates_[c]).area / area : 1;
    shares[c].pressing *= ratio;
    shares[c].along *= ratio;
    shares[c].anchor = equilibrium_.contact()->place(static_cast<int>(c), start);
  }
  return shares;
}

bool FiniteModel::may_begin_anew() const {
  const std::vector<solvers::ContactShare>& shares = free_shares();
  return std::none_of(shares.begin(), shares.end(), [](const auto& share) { return share.touches; });
}

void FiniteModel::begin_anew() {
  equilibrium_.set_coefficients(VectorX::Zero(equilibrium_.coefficients().size()));
}

FiniteStep FiniteModel::solve_from_rest(double time, const std::optional<topology::ToolPose>& pose) {
  const VectorX kept = equilibrium_.coefficients();
  begin_anew();
  try {
    return solve(time, pose);
  } catch (...) {
    equilibrium_.set_coefficients(kept, 1, pose_);
    throw;
  }
}

std::vector<double> FiniteModel::openings() const {
  solvers::FiniteLips lips = pairs_;
  lips.turn(body_.piola_maps(coefficients()));
  return lips.contact().gaps(coefficients());
}

// What acts before the tool comes, weight and pre-tension, has acted for ever.
FiniteStep FiniteModel::solve(double time, const std::optional<topology::ToolPose>& pose) {
  const auto stands = [&] {
    return pose.has_value() == pose_.has_value() &&
           (!pose || (pose->point == pose_->point && pose->axis == pose_->axis));
  };
  if (edge_ && stands()) { // the body without blade is as it was
    time_ = time;
    last_->iterations = 0;
    last_->friction_work = 0;
    return *last_;
  }
  leave_edge();
  try {
    if (!time_ && !has_settled_ && (!body_.loads().isZero(0) || is_prestrained_)) {
      double longest = 0;
      for (const solvers::PronyTerm& term : body_.options().prony)
        longest = std::max(longest, term.time);
      body_.begin_step(solvers::FiniteBody::for_ever * longest);
      if (longest > 0)
        static_cast<void>(equilibrium_.solve({}));
      body_.accept_step(equilibrium_.coefficients());
      has_settled_ = true;
    }
    body_.begin_step(time_ ? std::max(0.0, time - *time_) : 0);
    return solve_step(time, pose);
  } catch (...) { // the step has not been: what is asked of the body is as of its last state
    body_.begin_step(0);
    throw;
  }
}

FiniteStep FiniteModel::solve_step(double time, const std::optional<topology::ToolPose>& pose) {
  solvers::FiniteLoading loading;
  if (equilibrium_.contact() != nullptr)
    loading.tool = pose;
  const solvers::EquilibriumStatus status = equilibrium_.solve(loading);
  body_.accept_step(equilibrium_.coefficients());
  time_ = time;
  pose_ = loading.tool;
  last_ = step_of(status, loading.tool, pose);
  return *last_;
}

FiniteStep FiniteModel::step_of(const solvers::EquilibriumStatus& status, const std::optional<topology::ToolPose>& tool,
                                const std::optional<topology::ToolPose>& pose) const {
  FiniteStep step;
  step.force = status.tool_force;
  step.torque = status.tool_torque;
  step.active_nodes = status.touching;
  step.closed_pairs = status.closed;
  step.iterations = status.iterations;
  step.residual = status.residual;
  step.least_jacobian = status.least_jacobian;
  step.energy = status.energy;
  step.loads = body_.loads().dot(equilibrium_.coefficients());
  step.friction_work = status.friction_work;
  if (tool) {
    step.tangential = equilibrium_.contact()->options().condition == solvers::ContactCondition::bonded
                          ? force_along_surface()
                          : status.friction;
    summarise_contact(step);
    step.penetration = deepest(*pose);
  }
  return step;
}

solvers::PointState FiniteModel::at(const Vector3& x) const {
  const solvers::FiniteState state = body_.at(x, coefficients());
  const Matrix3& f = state.deformation;
  return {state.displacement, f - Matrix3::Identity(), 0.5 * (f.transpose() * f - Matrix3::Identity()), state.cauchy};
}

void FiniteModel::shape_at(const Vector3& x, solvers::ShapeFunctions& shape) const {
  body_.shape_at(x, shape);
}

std::vector<int> FiniteModel::places_among_candidates(const std::vector<int>& nodes) const {
  std::vector<int> places;
  for (const int node : nodes)
    if (const auto found = std::lower_bound(candidates_.begin(), candidates_.end(), node);
        found != candidates_.end() && *found == node)
      places.push_back(static_cast<int>(found - candidates_.begin()));
  return places;
}

void FiniteModel::prepare_to_condense(const std::vector<int>& wanted) {
  static_cast<void>(equilibrium_.contact_compliance(places_among_candidates(wanted)));
}

void FiniteModel::condense(const std::vector<int>& wanted, solvers::ContactPatch& patch, solvers::ContactState& state) {
  const solvers::FiniteContact& contact = *equilibrium_.contact();
  const std::vector<Vector3> forces = contact.forces();
  std::vector<int> chosen = places_among_candidates(wanted);
  for (std::size_t c = 0; c < forces.size(); ++c)
    if (!forces[c].isZero(0))
      chosen.push_back(static_cast<int>(c));
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  patch = {};
  state = {};
  const bool is_bonded = contact.options().condition == solvers::ContactCondition::bonded;
  const bool keeps_way = contact.options().condition != solvers::ContactCondition::frictionless;
  VectorX acting = VectorX::Zero(3 * std::ssize(chosen));
  state.displacement.resize(acting.size());
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const int c = chosen[k];
    const int node = candidates_[c];
    patch.nodes.push_back(node);
    patch.rest.push_back(contact.places()[c]);
    patch.spacings.push_back(body_.problem().nodes.spacings[node]);
    patch.normals.push_back(body_.problem().nodes.normals[node]);
    state.nodal_forces.push_back(forces[c]);
    state.active.push_back(forces[c].isZero(0) ? 0 : 1);
    const auto row = 3 * static_cast<Eigen::Index>(k);
    acting.segment<3>(row) = forces[c];
    state.displacement.segment<3>(row) = contact.means()[c].of(equilibrium_.coefficients());
    if (keeps_way) {
      const solvers::ContactShare& share = equilibrium_.contact_shares()[c];
      state.along.push_back(is_bonded ? Vector3(Vector3::Zero()) : share.along);
      state.bond.push_back(is_bonded || !share.touches ? Vector3(state.displacement.segment<3>(row))
                                                       : Vector3(share.anchor - contact.places()[c]));
    }
  }
  patch.compliance = equilibrium_.contact_compliance(chosen);
  patch.base_displacement = state.displacement - patch.compliance * acting;
  state.pose = contact.pose();
  const FiniteStep& last = edge_ ? edge_->pressed : *last_; // the patch is of the body under the blade, too
  state.tool_force = last.force;
  state.tool_torque = last.torque;
  state.active_nodes = last.active_nodes;
  state.contact_radius = last.contact_radius;
}

std::vector<solvers::FrontState> FiniteModel::front_states(const std::function<double(const Vector3&)>& toughness,
                                                           double spacing) const {
  std::vector<Vector3> closed;
  if (const solvers::FiniteLips* lips = equilibrium_.lips()) {
    const std::vector<double>& forces = lips->contact().known_forces();
    for (std::size_t p = 0; p < forces.size(); ++p)
      if (forces[p] > 0)
        closed.push_back(body_.problem().nodes.positions[lips->pairs()[p].plus]);
  }
  return solvers::front_states(body_, coefficients(), toughness, spacing, closed, fibres_);
}

VectorX FiniteModel::nodal_displacements() const {
  return body_.nodal_displacements(coefficients());
}

} // namespace spherecut::app
