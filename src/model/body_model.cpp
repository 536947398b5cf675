#include "src/model/body_model.hpp"

#include "solvers/appended/appended_body.hpp"
#include "solvers/contact/bank_pairs.hpp"
#include "src/model/finite_model.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/scenario/region_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/gap_walls.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>

namespace spherecut::app {
namespace {

constexpr int most_iterations = 300;     // of the contact: deep presses converge slowly
constexpr double lip_tolerance = 1e-9;   // m, lips this far through one another are in contact
constexpr double crowded_by_sheet = 0.3; // of the fine spacing: nearer to a sheet no node of a fixed region is kept
constexpr double crowded_by_seed = 0.7;  // likewise, to a node that must be where it is
constexpr int most_bank_rounds = 6;      // in which banks that have come to each other are held apart
constexpr double rim = 1e-2; // of its spacing: a lip node so near to the surface stands on the rim of its wound

bool carries_surface(const topology::Domain& domain, const solvers::NodeCloud& nodes, int node) {
  switch (nodes.kinds[node]) {
  case solvers::NodeKind::interior:
    return false;
  case solvers::NodeKind::lip:
    return domain.signed_distance(nodes.positions[node]) > -rim * nodes.spacings[node];
  case solvers::NodeKind::surface:
  case solvers::NodeKind::edge:
    return true;
  }
  return true;
}

/// Whether a node can be held where it is: at finite strain lip nodes of a cut that appends are places without
/// unknowns.
bool can_be_held(const Scenario& scenario, const topology::Domain& domain, const solvers::NodeCloud& nodes, int node) {
  const bool is_place =
      nodes.kinds[node] == solvers::NodeKind::lip && is_nonlinear(scenario.law) && cut_appends(scenario);
  return !is_place && carries_surface(domain, nodes, node);
}

/// Sets of axes that the same regions hold: what one of them holds, all of its set are.
std::vector<std::array<bool, 3>> axes_held_together(const std::vector<FixedRegion>& fixed) {
  const auto alike = [&](std::size_t a, std::size_t b) {
    return std::all_of(fixed.begin(), fixed.end(),
                       [&](const FixedRegion& region) { return region.components[a] == region.components[b]; });
  };
  std::vector<std::array<bool, 3>> sets;
  std::array<bool, 3> known{};
  for (std::size_t a = 0; a < 3; ++a) {
    if (known[a])
      continue;
    sets.emplace_back();
    for (std::size_t b = a; b < 3; ++b)
      if (alike(a, b))
        sets.back()[b] = known[b] = true;
  }
  return sets;
}

solvers::DiscretisationOptions method_of(const Scenario& scenario) {
  solvers::DiscretisationOptions options = scenario.method;
  options.unheld = scenario.cut.unheld;
  options.sight = sight_of(scenario);
  options.tip_functions = !scenario.tool && !scenario.blade && !scenario.tearing.enabled;
  return options;
}

} // namespace

solvers::Problem problem_of(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                            const BodyModel& model) {
  solvers::Problem problem;
  problem.domain = domain;
  problem.incision = model.incision;
  if (model.sprinkling.walls != nullptr)
    problem.opaque = topology::with_walls(model.incision, model.sprinkling.walls);
  problem.nodes = model.sprinkling.nodes;
  problem.material = scenario.material;
  problem.regions = regions_of(scenario, domain);
  problem.prescribed = fixed_nodes(scenario, *domain, problem.nodes);
  const bool held_fully = std::all_of(scenario.fixed.begin(), scenario.fixed.end(), [](const FixedRegion& region) {
    return region.components == std::array<bool, 3>{true, true, true};
  });
  if (held_fully)
    problem.prescribed_region = [regions = scenario.fixed](const Vector3& x, const Vector3&) {
      return std::any_of(regions.begin(), regions.end(), [&](const FixedRegion& region) { return region.holds(x); });
    };
  else
    problem.prescribed_region = [regions = scenario.fixed](const Vector3& x, const Vector3&, int axis) {
      return std::any_of(regions.begin(), regions.end(), [&](const FixedRegion& region) {
        return region.components[static_cast<std::size_t>(axis)] && region.holds(x);
      });
    };
  problem.touched_from = model.touched_from;
  if (scenario.gravity) {
    const Vector3 weight = scenario.material.density * *scenario.gravity;
    if (problem.regions == nullptr)
      problem.loads.body_force = [weight](const Vector3&) -> const Vector3& { return weight; };
    else
      problem.loads.body_force = [regions = problem.regions, elsewhere = scenario.material,
                                  gravity = *scenario.gravity](const Vector3& x) -> Vector3 {
        return regions->material_at(x, elsewhere).density * gravity;
      };
  }
  problem.loads.initial_strain = -scenario.pretension;
  const bool pressed = std::any_of(scenario.precuts.begin(), scenario.precuts.end(),
                                   [](const PrecutSettings& precut) { return precut.pressure != 0; });
  if (pressed && model.incision != nullptr) {
    std::vector<double> pressures; // by sheet: the precuts come first
    for (const PrecutSettings& precut : scenario.precuts)
      pressures.push_back(precut.pressure);
    problem.loads.lip_traction = [pressures, incision = model.incision](const Vector3& x,
                                                                        const Vector3& normal) -> Vector3 {
      const auto on = incision->closest(x, std::numeric_limits<double>::infinity());
      if (!on || on->sheet >= std::ssize(pressures))
        return Vector3::Zero();
      return -pressures[static_cast<std::size_t>(on->sheet)] * normal;
    };
  }
  return problem;
}

// At finite strain release rates ask for nodes on the faces behind a front.
solvers::SightRule sight_of(const Scenario& scenario) {
  const bool is_cut = scenario.blade || !scenario.precuts.empty();
  const bool appends = is_nonlinear(scenario.law) && is_cut && !scenario.tearing.enabled;
  return scenario.cut.sight.value_or(appends ? solvers::SightRule::appended : scenario.method.sight);
}

bool cut_appends(const Scenario& scenario) {
  return scenario.method.method == solvers::Method::galerkin && sight_of(scenario) == solvers::SightRule::appended;
}

int BodyModel::nearest_seen(const Vector3& x) const {
  const std::vector<Vector3>& nodes = sprinkling.nodes.positions;
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (const double distance = (nodes[i] - x).squaredNorm();
        distance < least && (incision == nullptr || !incision->blocks(x, nodes[i])) &&
        (sprinkling.walls == nullptr || !sprinkling.walls->blocks(x, nodes[i]))) {
      least = distance;
      nearest = i;
    }
  return static_cast<int>(nearest);
}

const solvers::NodeCloud& BodyModel::nodes() const {
  return finite != nullptr ? sprinkling.nodes : body->problem().nodes;
}

int BodyModel::sphere_count() const {
  return finite != nullptr ? finite->spheres().size() : body->sphere_count();
}

double BodyModel::sphere_radius(int node) const {
  if (finite == nullptr)
    return body->sphere_radius(node);
  return node < finite->spheres().size() ? finite->spheres().radii()[static_cast<std::size_t>(node)] : 0;
}

int BodyModel::coefficient_count() const {
  return finite != nullptr ? 3 * finite->functions() : body->coefficient_count();
}

bool BodyModel::solved() const {
  return finite != nullptr ? finite->solved() : state.has_value();
}

VectorX BodyModel::nodal_displacements() const {
  return finite != nullptr ? finite->nodal_displacements() : body->nodal_displacements(field);
}

solvers::PointState BodyModel::at(const Vector3& x) const {
  if (!solved())
    return {};
  const auto there = [this](const Vector3& place) {
    return finite != nullptr ? finite->at(place) : body->at(place, field);
  };
  try {
    return there(x);
  } catch (const InputError&) {
    return there(sprinkling.nodes.positions[nearest_seen(x)]);
  }
}

void BodyModel::shape_at(const Vector3& x, solvers::ShapeFunctions& shape) const {
  const auto find = [&](const Vector3& place) {
    finite != nullptr ? finite->shape_at(place, shape) : body->shape_at(place, shape);
  };
  try {
    find(x);
  } catch (const InputError&) {
    find(sprinkling.nodes.positions[nearest_seen(x)]);
  }
}

std::vector<solvers::Prescribed> fixed_nodes(const Scenario& scenario, const topology::Domain& domain,
                                             const solvers::NodeCloud& nodes) {
  std::vector<solvers::Prescribed> prescribed;
  std::vector<int> held(scenario.fixed.size(), 0);
  const std::vector<std::array<bool, 3>> sets = axes_held_together(scenario.fixed);
  for (int i = 0; i < nodes.size(); ++i) {
    if (!can_be_held(scenario, domain, nodes, i))
      continue;
    std::array<bool, 3> axes{};
    for (std::size_t r = 0; r < scenario.fixed.size(); ++r)
      if (scenario.fixed[r].holds(nodes.positions[i])) {
        ++held[r];
        for (int c = 0; c < 3; ++c)
          axes[c] = axes[c] || scenario.fixed[r].components[c];
      }
    for (const std::array<bool, 3>& set : sets)
      if ((set[0] && axes[0]) || (set[1] && axes[1]) || (set[2] && axes[2]))
        prescribed.push_back({i, set, Vector3::Zero()});
  }
  for (std::size_t r = 0; r < scenario.fixed.size(); ++r)
    if (held[r] == 0) {
      const BoundingBox box = domain.bounds();
      throw InputError(fmt::format("{}:{}: fixed region '{}' holds no surface node; the organ spans [{:.4g}, {:.4g}, "
                                   "{:.4g}] to [{:.4g}, {:.4g}, {:.4g}] m: move or widen the region, or sprinkle finer",
                                   scenario.file.string(), scenario.fixed[r].line, scenario.fixed[r].name,
                                   box.lower.x(), box.lower.y(), box.lower.z(), box.upper.x(), box.upper.y(),
                                   box.upper.z()));
    }
  return prescribed;
}

int held_nodes(const std::vector<solvers::Prescribed>& prescribed) {
  int count = 0;
  for (std::size_t k = 0; k < prescribed.size(); ++k) // those of a node lie together
    count += k == 0 || prescribed[k].node != prescribed[k - 1].node ? 1 : 0;
  return count;
}

std::vector<std::array<bool, 3>> held_axes(const std::vector<solvers::Prescribed>& prescribed, int count) {
  std::vector<std::array<bool, 3>> held(static_cast<std::size_t>(count), {false, false, false});
  for (const solvers::Prescribed& entry : prescribed)
    for (std::size_t c = 0; c < 3; ++c)
      held[static_cast<std::size_t>(entry.node)][c] |= entry.components[c];
  return held;
}

bool gives_way(const std::array<bool, 3>& held, const Vector3& normal) {
  constexpr double least = 0.3; // of the normal along free axes: less would take many times the force
  Vector3 free = normal;
  for (std::size_t c = 0; c < 3; ++c)
    if (held[c])
      free[static_cast<Eigen::Index>(c)] = 0;
  return free.norm() > least;
}

std::vector<int> touchable_nodes(const Scenario& scenario, const topology::Domain& domain,
                                 const solvers::NodeCloud& nodes, const topology::SurfaceContact& centre,
                                 double reach) {
  const std::vector<std::array<bool, 3>> held = held_axes(fixed_nodes(scenario, domain, nodes), nodes.size());
  std::vector<int> near;
  for (int i = 0; i < nodes.size(); ++i)
    if (on_surface(nodes.kinds[i]) && gives_way(held[i], centre.normal) &&
        (nodes.positions[i] - centre.point).norm() <= reach && nodes.normals[i].dot(centre.normal) > 0)
      near.push_back(i);
  if (near.empty())
    throw InputError(fmt::format("no free surface node within {:g} m of the contact at [{:.4g}, {:.4g}, {:.4g}] m: the "
                                 "tool presses on a fixed region, or contact.candidate_radius is too small",
                                 reach, centre.point.x(), centre.point.y(), centre.point.z()));
  return near;
}

solvers::Sprinkling resprinkle_held(const Scenario& scenario, const topology::Domain& domain,
                                    const solvers::SprinkleOptions& options, const solvers::NodeCloud& previous) {
  solvers::Sprinkling made = solvers::resprinkle(domain, options, previous);
  solvers::SprinkleOptions held = options;
  for (const FixedRegion& region : scenario.fixed) {
    const auto holds = [&](const solvers::NodeCloud& nodes, int i) {
      return region.holds(nodes.positions[i]) && can_be_held(scenario, domain, nodes, i);
    };
    const auto any = [&](const solvers::NodeCloud& nodes) {
      for (int i = 0; i < nodes.size(); ++i)
        if (holds(nodes, i))
          return true;
      return false;
    };
    if (any(made.nodes))
      continue;
    for (int i = 0; i < previous.size(); ++i)
      if (holds(previous, i) && on_surface(previous.kinds[i]) &&
          (options.incision == nullptr ||
           !options.incision->closest(previous.positions[i], crowded_by_sheet * options.spacing.fine)) &&
          std::none_of(held.seeds.begin(), held.seeds.end(), [&](const solvers::SeedNode& seed) {
            return (seed.position - previous.positions[i]).norm() < crowded_by_seed * options.spacing.fine;
          }))
        held.seeds.push_back({previous.positions[i], previous.kinds[i]});
  }
  return held.seeds.size() == options.seeds.size() ? made : solvers::resprinkle(domain, held, previous);
}

void assemble(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain, BodyModel& model) {
  require_linear(scenario.file, scenario.law);
  const solvers::DiscretisationOptions options = method_of(scenario);
  model.pairs = solvers::lip_pairs(model.sprinkling.nodes);
  solvers::Problem problem = problem_of(scenario, domain, model);
  model.body = cut_appends(scenario) ? solvers::make_appended(std::move(problem), options, model.uncut)
                                     : solvers::discretise(std::move(problem), options);
}

std::string hindrance_to_growth(const Scenario& scenario, const BodyModel& model, bool severed) {
  if (model.finite != nullptr)
    return not_linear;
  if (model.sprinkling.walls != nullptr)
    return "the organ has narrow gaps of its own";
  if (scenario.method.method == solvers::Method::published)
    return fmt::format("method {} makes all nodes anew", solvers::to_string(scenario.method.method));
  if (severed && scenario.cut.unheld == solvers::UnheldPieces::drop && !cut_appends(scenario))
    return "a severed piece has left the computation";
  return "";
}

solvers::SprinkleIncrement exchange_nodes(const topology::Domain& domain, const solvers::SprinkleOptions& options,
                                          const BodyModel& before, solvers::Sprinkling& after) {
  const solvers::NodeCloud& nodes = before.sprinkling.nodes;
  solvers::SprinkleIncrement change = solvers::extend_sprinkling(domain, options, nodes, before.incision.get());
  after = {};
  after.walls = before.sprinkling.walls;
  after.report = before.sprinkling.report;
  auto removed = change.removed.begin();
  for (int i = 0; i < nodes.size(); ++i) {
    if (removed != change.removed.end() && *removed == i) {
      ++removed;
      continue;
    }
    after.nodes.add(nodes, i);
    after.kept_from.push_back(i);
  }
  const solvers::NodeCloud& added = change.added;
  for (int i = 0; i < added.size(); ++i) {
    after.nodes.add(added, i);
    after.kept_from.push_back(-1);
  }
  const auto count = [&](solvers::NodeKind kind) {
    return static_cast<int>(std::count(after.nodes.kinds.begin(), after.nodes.kinds.end(), kind));
  };
  after.report.surface_nodes = count(solvers::NodeKind::surface);
  after.report.edge_nodes = count(solvers::NodeKind::edge);
  after.report.interior_nodes = count(solvers::NodeKind::interior);
  after.report.lip_nodes = count(solvers::NodeKind::lip);
  return change;
}

std::string follow_cut(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                       const solvers::SprinkleIncrement& change, std::unique_ptr<solvers::Discretisation> body,
                       BodyModel& after) {
  auto* const appended = dynamic_cast<solvers::AppendedBody*>(body.get());
  if (appended == nullptr)
    return "the body is made anew behind its cut";
  if (std::string why_not = appended->grow(change, problem_of(scenario, domain, after)); !why_not.empty())
    return why_not;
  after.pairs = solvers::lip_pairs(after.sprinkling.nodes);
  after.body = std::move(body);
  return "";
}

std::unique_ptr<solvers::Discretisation> body_to_grow(const BodyModel& model) {
  const auto* const appended = dynamic_cast<const solvers::AppendedBody*>(model.body.get());
  return appended == nullptr ? nullptr : appended->copy();
}

void condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses) {
  model.lips.reset();
  model.state.reset();
  model.presses = 0;
  model.watch.reset();
  if (candidates.empty()) {
    model.patch = {};
    model.base = model.body->solve();
  } else {
    const bool knows_compliance = model.body->method() == solvers::Method::galerkin;
    model.patch = for_few_presses && knows_compliance ? solvers::condense_without_fields(*model.body, candidates)
                                                      : solvers::condense(*model.body, candidates);
    model.base = model.patch.base;
  }
}

void find_lips(BodyModel& model) {
  model.field = model.base;
  static_cast<void>(normal_openings(model));
}

namespace {

/// What a later solve and the haptic loop ask of a patch that is held: where it is bonded to the tool, and where that
/// is.
void bond(const std::vector<Vector3>& displacements, const topology::ToolPose& pose, solvers::ContactState& state) {
  state.bond = displacements;
  state.tool_torque = solvers::torque_about(state, pose.point); // so far about the origin
  state.pose = pose;
}

} // namespace

namespace {

/// One solution for tool and lips.
void solve_with_lips(const ToolSettings* tool, const topology::ToolPose* pose, const Scenario& scenario,
                     BodyModel& model, const std::vector<Vector3>* grasped,
                     const std::optional<solvers::GripMemory>& memory, bool lips_touch) {
  const solvers::ContactOptions options{.condition = scenario.contact.condition,
                                        .friction = scenario.contact.friction,
                                        .maximum_iterations = most_iterations,
                                        .gap_tolerance = lip_tolerance};
  const bool in_reach = tool != nullptr && !model.patch.nodes.empty();
  solvers::CutContactState remembered;
  remembered.tool.memory = memory;
  const solvers::CutContactState* previous = model.state ? &*model.state : memory ? &remembered : nullptr;
  const bool are_open = scenario.cut.lips == solvers::LipCondition::open;
  if (!model.lips && (!lips_touch || are_open)) { // lips that stay apart by themselves need no contact
    solvers::CutContactState state;
    if (in_reach)
      state.tool = grasped != nullptr
                       ? solvers::prescribe(model.patch, *grasped)
                       : solvers::press(model.patch, tool->shape, *pose, options, previous ? &previous->tool : nullptr);
    if (in_reach && grasped != nullptr)
      bond(*grasped, *pose, state.tool);
    model.field = in_reach ? solvers::deform(*model.body, model.patch, state.tool) : model.base;
    const std::vector<double> openings = normal_openings(model);
    const bool apart =
        std::all_of(openings.begin(), openings.end(), [](double opening) { return opening >= -lip_tolerance; });
    if (apart || are_open) {
      model.state = std::move(state);
      return;
    }
  }
  if (!model.lips) {
    std::vector<solvers::LipPair> pairs = model.pairs;
    pairs.insert(pairs.end(), model.banks.begin(), model.banks.end());
    model.lips = solvers::condense_lips(*model.body, pairs, scenario.cut.lips, in_reach ? &model.patch : nullptr);
  }
  solvers::CutContactState state;
  if (in_reach) {
    const bool goes_on = previous != nullptr && (previous->lips.closed.size() == model.lips->pairs.size() ||
                                                 options.condition == solvers::ContactCondition::frictional);
    state = grasped != nullptr
                ? solvers::prescribe(model.patch, *model.lips, *grasped, lip_tolerance)
                : solvers::press(model.patch, *model.lips, tool->shape, *pose, options, goes_on ? previous : nullptr);
    if (grasped != nullptr)
      bond(*grasped, *pose, state.tool);
    model.field = solvers::deform(*model.body, model.patch, *model.lips, state);
  } else {
    state.lips = solvers::close_lips(*model.lips, model.lips->base_opening, lip_tolerance,
                                     previous ? previous->lips.closed : std::vector<char>{});
    model.field = solvers::deform(*model.body, model.base, *model.lips, state.lips);
  }
  model.state = std::move(state);
}

/// Looks where the surface has come to itself. True: places where it has passed through that no pair holds apart yet,
/// which are now among the banks.
bool finds_banks(BodyModel& model) {
  const solvers::BankPairs found =
      solvers::bank_pairs(model.sprinkling.nodes, model.body->nodal_displacements(model.field), near_banks);
  model.passed_through = {};
  std::vector<solvers::LipPair> fresh;
  bool passes = false;
  for (std::size_t p = 0; p < found.pairs.size(); ++p) {
    const solvers::LipPair& pair = found.pairs[p];
    const double depth = -found.openings[p];
    if (depth > model.passed_through.depth)
      model.passed_through = {depth, model.sprinkling.nodes.positions[pair.minus],
                              model.sprinkling.nodes.spacings[pair.minus]};
    const bool known = std::any_of(model.banks.begin(), model.banks.end(), [&](const solvers::LipPair& bank) {
      return (bank.plus == pair.plus && bank.minus == pair.minus) ||
             (bank.plus == pair.minus && bank.minus == pair.plus);
    });
    passes = passes || (depth > lip_tolerance && (!known || !model.lips));
    if (!known)
      fresh.push_back(pair);
  }
  if (passes)
    model.banks = solvers::joined_without_rings(model.banks, fresh, model.sprinkling.nodes.size());
  return passes;
}

} // namespace

void solve_contact(const ToolSettings* tool, const topology::ToolPose* pose, const Scenario& scenario, BodyModel& model,
                   const std::vector<Vector3>* grasped, const std::optional<solvers::GripMemory>& memory,
                   bool lips_touch) {
  const std::optional<solvers::CutContactState> before = model.state;
  solve_with_lips(tool, pose, scenario, model, grasped, memory, lips_touch);
  for (int round = 0;
       finds_banks(model) && scenario.cut.lips != solvers::LipCondition::open && round < most_bank_rounds; ++round) {
    model.lips.reset();
    model.state = before;
    solve_with_lips(tool, pose, scenario, model, grasped, memory, true);
  }
}

double residual(const BodyModel& model) {
  std::vector<int> loaded = model.patch.nodes;
  std::vector<Vector3> forces = model.state->tool.nodal_forces;
  if (model.lips) {
    const std::vector<Vector3> pair_forces = solvers::pair_forces(*model.lips, model.state->lips);
    for (std::size_t p = 0; p < pair_forces.size(); ++p) {
      loaded.push_back(model.lips->pairs[p].plus);
      forces.push_back(pair_forces[p]);
      loaded.push_back(model.lips->pairs[p].minus);
      forces.emplace_back(-pair_forces[p]);
    }
  }
  return model.body->residual(model.field, loaded, forces);
}

std::vector<double> normal_openings(const BodyModel& model) {
  if (model.finite != nullptr)
    return model.finite->openings();
  std::vector<double> openings;
  if (model.pairs.empty())
    return openings;
  std::vector<int> plus;
  std::vector<int> minus;
  for (const solvers::LipPair& pair : model.pairs) {
    plus.push_back(pair.plus);
    minus.push_back(pair.minus);
  }
  const MatrixX apart =
      model.body->contact_displacements(plus, {model.field}) - model.body->contact_displacements(minus, {model.field});
  for (std::size_t p = 0; p < model.pairs.size(); ++p)
    openings.push_back(model.pairs[p].normal.dot(apart.col(0).segment<3>(3 * static_cast<Eigen::Index>(p))));
  return openings;
}

} // namespace spherecut::app
