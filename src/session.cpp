#include "src/session.hpp"

#include "solvers/contact_rings.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::app {
namespace {

constexpr double stretched_rotation = 10;   // degrees, beyond which linear elasticity is being stretched
constexpr double allowed_force_jump = 0.02; // at a re-sprinkle
constexpr double patch_gap = 0.02;          // of the fine spacing: penetration outside the patch that makes it grow
constexpr int patch_growths = 6;            // in one step
constexpr int most_iterations = 300;        // of the contact: deep presses converge slowly

// Adds its lifetime to a stage of the profile.
class StageTimer {
 public:
  explicit StageTimer(double& seconds) : seconds_(seconds) {}
  ~StageTimer() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

Organ timed_organ(const OrganSettings& settings, double& seconds) {
  const StageTimer timer(seconds);
  return make_organ(settings);
}

FineZone fine_zone(const Scenario& scenario, const topology::Domain& domain) {
  const NodeSettings& nodes = scenario.nodes;
  const double tip = topology::tip_radius(scenario.tool.shape);
  FineZone zone;
  zone.spacing.fine = nodes.fine_spacing > 0 ? nodes.fine_spacing : tip / 3;
  zone.spacing.coarse = nodes.coarse_spacing > 0
                            ? nodes.coarse_spacing
                            : std::max(zone.spacing.fine, domain.bounds().extent().maxCoeff() / 10);
  if (zone.spacing.coarse < zone.spacing.fine)
    throw InputError(fmt::format("nodes.coarse_spacing = {:g} m is below the fine spacing, one third of the tip radius "
                                 "= {:g} m; allowed: at least that, or give nodes.fine_spacing",
                                 zone.spacing.coarse, zone.spacing.fine));
  zone.spacing.slope = nodes.slope;
  zone.spacing.radius = nodes.fine_radius > 0 ? nodes.fine_radius : 1.5 * tip;
  return zone;
}

// A node at the contact; about a flat punch on a flat surface also rings on both sides of its edge, where the pressure
// peaks.
std::vector<solvers::SeedNode> contact_seeds(const Scenario& scenario, const topology::Domain& domain,
                                             const topology::SurfaceContact& contact, double spacing) {
  std::vector<solvers::SeedNode> tip{{contact.point, solvers::NodeKind::surface}};
  const auto* punch = std::get_if<topology::FlatPunch>(&scenario.tool.shape);
  if (punch == nullptr || punch->radius < 2 * spacing)
    return tip;
  const auto flat = [&](const solvers::SeedNode& seed) {
    return domain.normal(seed.position).dot(contact.normal) > 0.95 &&
           std::abs((seed.position - contact.point).dot(contact.normal)) < 0.25 * spacing;
  };
  try {
    std::vector<solvers::SeedNode> rings =
        solvers::contact_rings(domain, contact.point, contact.normal, punch->radius, spacing,
                               solvers::contact_ring_offset(scenario.method.method));
    return std::all_of(rings.begin(), rings.end(), flat) ? rings : tip;
  } catch (const InputError&) { // the end of the punch reaches over the edge of the organ
    return tip;
  }
}

} // namespace

Session::Session(Scenario scenario, std::function<void(const std::string&)> say)
    : scenario_(std::move(scenario)), say_(std::move(say)), organ_(timed_organ(scenario_.organ, profile_.organ)),
      query_(organ_.domain->surface()), motion_(tool_motion(scenario_.tool, query_, *organ_.domain)),
      touch_(first_touch(scenario_.tool, motion_, query_)) {
  for (const std::string& remark : organ_.remarks)
    warn(remark, remark);
  zone_ = fine_zone(scenario_, *organ_.domain);
  if (scenario_.method.method == solvers::Method::published)
    warn("published", "the published scheme does not converge and its force is not one in newtons: see docs");
  if (!touch_) {
    warn("touch", "the tool never touches the organ on its way");
    return;
  }
  sprinkle(centre_of(touch_->contact, touch_->pose));
  static_cast<void>(fixed_nodes());
}

topology::SurfaceContact Session::find_contact(const topology::ToolPose& pose) const {
  const bool near = last_contact_ && last_contact_->depth > -topology::tip_radius(scenario_.tool.shape);
  return near ? query_.walk(scenario_.tool.shape, pose, *last_contact_)
              : query_.first_touch(scenario_.tool.shape, pose);
}

// Where fine nodes belong: at the contact; under a flat punch, whose deepest point may be anywhere on its end, below
// the middle of that.
topology::SurfaceContact Session::centre_of(const topology::SurfaceContact& contact,
                                            const topology::ToolPose& pose) const {
  const auto* punch = std::get_if<topology::FlatPunch>(&scenario_.tool.shape);
  if (punch == nullptr)
    return contact;
  topology::SurfaceContact centre = contact;
  centre.point = organ_.domain->closest_surface_point(pose.point);
  centre.normal = organ_.domain->normal(centre.point);
  const bool below = (centre.point - contact.point).norm() < 1.5 * punch->radius && centre.normal.dot(pose.axis) > 0.5;
  return below ? centre : contact;
}

StepResult Session::step(const ToolSample& sample) {
  StepResult result;
  result.time = sample.time;
  result.pose = sample.pose;
  const auto start = std::chrono::steady_clock::now();
  result.contact = find_contact(sample.pose);
  last_contact_ = result.contact;
  // Without weight the organ keeps its rest shape until the tool is on it.
  const bool loaded = touch_ && (result.contact.depth > 0 || body_ != nullptr || scenario_.gravity);
  if (loaded) {
    if (body_ == nullptr)
      build();
    press(sample.pose);
    const topology::SurfaceContact centre = centre_of(result.contact, sample.pose);
    if (must_follow(centre)) {
      const Vector3 before = state_->tool_force;
      say_(fmt::format("the fine zone follows the tool, t = {:g} s", sample.time));
      sprinkle(centre);
      build();
      press(sample.pose);
      result.resprinkled = true;
      result.force_jump = before.norm() > 0 ? (state_->tool_force - before).norm() / before.norm() : 0;
      if (result.force_jump > allowed_force_jump)
        warn("jump", fmt::format("the force jumped by {:.1f} % at a re-sprinkle (t = {:g} s); finer nodes or a larger "
                                 "fine radius bring it under {:g} %",
                                 100 * result.force_jump, sample.time, 100 * allowed_force_jump));
    }
    evaluate(result);
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

// A bonded contact stays with its nodes, so its zone stays too.
bool Session::must_follow(const topology::SurfaceContact& contact) const {
  if (scenario_.contact.condition == solvers::ContactCondition::bonded || contact.depth <= 0)
    return false;
  const double away = (contact.point - zone_contact_.point).norm();
  return away > scenario_.contact.follow_fraction * zone_.spacing.radius;
}

solvers::SprinkleOptions Session::sprinkle_options(const topology::SurfaceContact& contact) const {
  solvers::SprinkleOptions options;
  options.spacing = zone_.spacing;
  options.spacing.centres = {contact.point};
  options.seeds = contact_seeds(scenario_, *organ_.domain, contact, zone_.spacing.fine);
  options.random_seed = scenario_.nodes.random_seed;
  return options;
}

void Session::sprinkle(const topology::SurfaceContact& contact) {
  const StageTimer timer(profile_.sprinkle);
  const bool first = sprinkling_.nodes.size() == 0;
  if (first && scenario_.nodes.count > 0) {
    zone_.spacing.centres = {contact.point};
    zone_.spacing =
        solvers::spacing_for_count(*organ_.domain, zone_.spacing, scenario_.nodes.count, sprinkle_options(contact));
  }
  const solvers::SprinkleOptions options = sprinkle_options(contact);
  sprinkling_ = first ? solvers::sprinkle(*organ_.domain, options)
                      : solvers::resprinkle(*organ_.domain, options, sprinkling_.nodes);
  zone_contact_ = contact;
  zone_.candidate_radius = scenario_.contact.candidate_radius > 0 ? scenario_.contact.candidate_radius
                                                                  : zone_.spacing.radius + 2 * zone_.spacing.fine;
}

std::vector<solvers::Prescribed> Session::fixed_nodes() const {
  const solvers::NodeCloud& nodes = sprinkling_.nodes;
  std::vector<solvers::Prescribed> prescribed;
  std::vector<int> held(scenario_.fixed.size(), 0);
  for (int i = 0; i < nodes.size(); ++i) {
    if (nodes.kinds[i] == solvers::NodeKind::interior)
      continue;
    solvers::Prescribed entry{i, {false, false, false}, Vector3::Zero()};
    for (std::size_t r = 0; r < scenario_.fixed.size(); ++r)
      if (scenario_.fixed[r].holds(nodes.positions[i])) {
        ++held[r];
        for (int c = 0; c < 3; ++c)
          entry.components[c] = entry.components[c] || scenario_.fixed[r].components[c];
      }
    if (entry.components[0] || entry.components[1] || entry.components[2])
      prescribed.push_back(entry);
  }
  for (std::size_t r = 0; r < scenario_.fixed.size(); ++r)
    if (held[r] == 0) {
      const BoundingBox box = organ_.domain->bounds();
      throw InputError(fmt::format("{}:{}: fixed region '{}' holds no surface node; the organ spans [{:.4g}, {:.4g}, "
                                   "{:.4g}] to [{:.4g}, {:.4g}, {:.4g}] m: move or widen the region, or sprinkle finer",
                                   scenario_.file.string(), scenario_.fixed[r].line, scenario_.fixed[r].name,
                                   box.lower.x(), box.lower.y(), box.lower.z(), box.upper.x(), box.upper.y(),
                                   box.upper.z()));
    }
  return prescribed;
}

// Surface nodes near the contact on its side of the organ, without those that are held.
std::vector<int> Session::candidates() const {
  const solvers::NodeCloud& nodes = sprinkling_.nodes;
  std::vector<char> held(nodes.size(), 0);
  for (const solvers::Prescribed& entry : body_->problem().prescribed)
    held[entry.node] = 1;
  std::vector<int> near;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] != solvers::NodeKind::interior && held[i] == 0 &&
        (nodes.positions[i] - zone_contact_.point).norm() <= zone_.candidate_radius &&
        nodes.normals[i].dot(zone_contact_.normal) > 0)
      near.push_back(i);
  if (near.empty())
    throw InputError(fmt::format("no free surface node within {:g} m of the contact at [{:.4g}, {:.4g}, {:.4g}] m: the "
                                 "tool presses on a fixed region, or contact.candidate_radius is too small",
                                 zone_.candidate_radius, zone_contact_.point.x(), zone_contact_.point.y(),
                                 zone_contact_.point.z()));
  return near;
}

void Session::build() {
  {
    const StageTimer timer(profile_.discretise);
    solvers::Problem problem;
    problem.domain = organ_.domain;
    problem.nodes = sprinkling_.nodes;
    problem.material = scenario_.material;
    problem.prescribed = fixed_nodes();
    const bool held_fully = std::all_of(scenario_.fixed.begin(), scenario_.fixed.end(), [](const FixedRegion& region) {
      return region.components == std::array<bool, 3>{true, true, true};
    });
    if (held_fully)
      problem.prescribed_region = [regions = scenario_.fixed](const Vector3& x, const Vector3&) {
        return std::any_of(regions.begin(), regions.end(), [&](const FixedRegion& region) { return region.holds(x); });
      };
    if (scenario_.gravity) {
      const Vector3 weight = scenario_.material.density * *scenario_.gravity;
      problem.loads.body_force = [weight](const Vector3&) -> const Vector3& { return weight; };
    }
    say_(fmt::format("{} nodes, {} of them on the surface, {} fixed", problem.nodes.size(),
                     sprinkling_.report.surface_nodes + sprinkling_.report.edge_nodes, problem.prescribed.size()));
    body_ = solvers::discretise(std::move(problem), scenario_.method);
  }
  condense(candidates());
}

void Session::condense(const std::vector<int>& candidates) {
  const StageTimer timer(profile_.condense);
  patch_ = solvers::condense(*body_, candidates);
  state_.reset();
}

void Session::press(const topology::ToolPose& pose) {
  const solvers::ContactOptions options{.condition = scenario_.contact.condition,
                                        .maximum_iterations = most_iterations};
  for (int growth = 0; growth <= patch_growths; ++growth) {
    {
      const StageTimer timer(profile_.press);
      state_ = solvers::press(patch_, scenario_.tool.shape, pose, options, state_ ? &*state_ : nullptr);
      field_ = solvers::deform(patch_, *state_);
    }
    const std::vector<int> missed = penetrated_outside_patch(pose);
    if (missed.empty())
      return;
    std::vector<int> grown = patch_.nodes;
    grown.insert(grown.end(), missed.begin(), missed.end());
    std::sort(grown.begin(), grown.end());
    condense(grown);
  }
  warn("patch", "the tool reaches surface nodes beyond its candidate patch; give a larger contact.candidate_radius");
}

// Surface nodes that the tool has gone into although they were not candidates.
std::vector<int> Session::penetrated_outside_patch(const topology::ToolPose& pose) const {
  const solvers::NodeCloud& nodes = sprinkling_.nodes;
  std::vector<char> known(nodes.size(), 0);
  for (const int node : patch_.nodes)
    known[node] = 1;
  for (const solvers::Prescribed& entry : body_->problem().prescribed)
    known[entry.node] = 1;
  std::vector<int> missed;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] != solvers::NodeKind::interior && known[i] == 0 &&
        topology::tool_distance(scenario_.tool.shape, pose,
                                body_->contact_point(i) + body_->contact_displacement(i, field_)) <
            -patch_gap * zone_.spacing.fine)
      missed.push_back(i);
  return missed;
}

void Session::evaluate(StepResult& result) {
  const StageTimer timer(profile_.evaluate);
  result.force = state_->tool_force;
  result.contact_radius = state_->contact_radius;
  result.active_nodes = state_->active_nodes;
  result.candidates = static_cast<int>(patch_.nodes.size());
  result.nodes = sprinkling_.nodes.size();
  result.iterations = state_->iterations;
  result.converged = state_->converged;
  result.largest_penetration = state_->largest_penetration;
  result.residual = body_->residual(field_, patch_.nodes, state_->nodal_forces);
  if (!result.force.allFinite())
    throw NumericalError(fmt::format("the tool force at t = {:g} s is not finite; residual {:.1e}, condition estimate "
                                     "{:.1e}",
                                     result.time, result.residual, body_->report().condition_estimate));
  node_states_.clear();
  for (const Vector3& x : sprinkling_.nodes.positions) {
    node_states_.push_back(body_->at(x, field_));
    const Matrix3& gradient = node_states_.back().gradient;
    const Matrix3 skew = 0.5 * (gradient - gradient.transpose());
    const double angle = Vector3(skew(2, 1), skew(0, 2), skew(1, 0)).norm() * 180 / std::numbers::pi;
    result.rotation_degrees = std::max(result.rotation_degrees, angle);
  }
  if (result.rotation_degrees > stretched_rotation)
    warn("rotation",
         fmt::format("tissue rotates by {:.0f} degrees at t = {:g} s (over {:g}): linear elasticity is being "
                     "stretched",
                     result.rotation_degrees, result.time, stretched_rotation));
  if (!result.converged)
    warn("contact", fmt::format("the contact did not converge at t = {:g} s: {:.2g} m of penetration left", result.time,
                                result.largest_penetration));
}

void Session::warn(const std::string& key, const std::string& text) {
  if (std::find(warned_.begin(), warned_.end(), key) != warned_.end())
    return;
  warned_.push_back(key);
  warnings_.push_back(text);
  say_("warning: " + text);
}

} // namespace spherecut::app
