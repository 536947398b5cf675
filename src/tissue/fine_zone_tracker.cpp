#include "src/tissue/fine_zone_tracker.hpp"

#include "solvers/nodes/sheets.hpp"
#include "src/model/body_model.hpp"
#include "src/model/wall_bending.hpp"
#include "src/scenario/schedule.hpp"
#include "src/tissue/cut_checks.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/gap_walls.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double least_nodes_through = 1; // spacings through a wall, below which nothing is computed
// In fine spacings:
constexpr double crowded_by_sheet = 0.3; // nearer to a sheet no node of a contact is put
constexpr double coarse_for_hand = 1.5;  // a front that a hand leads goes through finer nodes
constexpr double way_of_hand = 2;        // so far ahead of it they are fine then
constexpr double zone_ahead = 1;         // so far ahead of a front that may tear nodes are fine beforehand
constexpr double zone_left = 0.5;        // a front this far off the middle of the fine zone has left it

} // namespace

// Where neither the coarsest spacing nor a number of nodes is given, the derived one follows the walls.
FineZoneTracker::FineZoneTracker(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain)
    : scenario_(scenario), domain_(std::move(domain)), zone_(fine_zone(scenario, *domain_)),
      walls_(measure_walls(*domain_, zone_.spacing.coarse / 3, topology::widest_gap * zone_.spacing.coarse)) {
  if (scenario_.nodes.coarse_spacing <= 0 && scenario_.nodes.count <= 0)
    follow_walls(walls_, *domain_, wall_budget, zone_.spacing);
}

void FineZoneTracker::coarsen(double factor) {
  if (!(factor > 0) || !std::isfinite(factor))
    throw InputError(fmt::format("spacings {:g} times those of the scenario; allowed: above 0", factor));
  zone_.spacing.fine *= factor / coarseness_;
  zone_.spacing.coarse *= factor / coarseness_;
  coarseness_ = factor;
  led_segments_.clear();
}

// The nodes there become finer and coarser as the fine zone goes along.
bool FineZoneTracker::find_gaps() {
  if (walls_.narrowest)
    gap_walls_ = topology::gap_walls(domain_, [h = zone_.spacing.coarse](const Vector3&) { return h; });
  return gap_walls_ != nullptr;
}

void FineZoneTracker::judge_walls(SessionLog& log) const {
  // Three nodes through a wall do for the weak form; collocation bends by a tenth too little with one more.
  constexpr double through_by_collocation = 3;
  const bool is_stiff = scenario_.method.method == solvers::Method::collocation;
  if (is_stiff)
    if (const auto gap = stiff_gap(walls_, zone_.spacing))
      log.warn("gap",
               fmt::format("a gap of {:.3g} mm at [{:.4g}, {:.4g}, {:.4g}] m, nodes {:.3g} mm apart: method "
                           "collocation is 5 to 14 % too stiff beside gaps of half a spacing to two; finer nodes "
                           "or method galerkin do",
                           1e3 * gap->width, gap->place.x(), gap->place.y(), gap->place.z(),
                           1e3 * zone_.spacing(gap->place)));
  std::optional<CoarseWall> wall = coarsest_wall(walls_, zone_.spacing);
  const bool has_three = !wall;
  if (has_three && is_stiff)
    wall = coarsest_wall(walls_, zone_.spacing, through_by_collocation);
  if (!wall)
    return;
  const std::string what = fmt::format(
      "the wall at [{:.4g}, {:.4g}, {:.4g}] m is {:.3g} mm thick and the nodes there are {:.3g} mm apart: {}",
      wall->place.x(), wall->place.y(), wall->place.z(), 1e3 * wall->thickness, 1e3 * wall->spacing,
      bending_error(wall->nodes_through(), scenario_.method.method));
  const std::string remedy =
      has_three ? "Method galerkin errs by a quarter of that at most"
                : fmt::format("nodes.coarse_spacing = {:.2g} m puts three nodes through it", wall->wanted);
  if (wall->nodes_through() < least_nodes_through)
    throw InputError(
        fmt::format("{}; allowed: at most {:.2g} m there. {}", what, wall->thickness / least_nodes_through, remedy));
  log.warn("walls", fmt::format("{}. {}", what, remedy));
}

topology::SurfaceContact FineZoneTracker::centre_of(const topology::SurfaceContact& contact,
                                                    const topology::ToolPose& pose) const {
  const auto* punch = std::get_if<topology::FlatPunch>(&scenario_.tool->shape);
  if (punch == nullptr)
    return contact;
  topology::SurfaceContact centre = contact;
  centre.point = domain_->closest_surface_point(pose.point);
  centre.normal = domain_->normal(centre.point);
  const bool below = (centre.point - contact.point).norm() < 1.5 * punch->radius && centre.normal.dot(pose.axis) > 0.5;
  return below ? centre : contact;
}

void FineZoneTracker::lay_out(std::vector<Vector3> places, const std::shared_ptr<const topology::Incision>& incision,
                              const topology::Wound* wound) {
  if (centre_)
    zone_.spacing.centres = std::move(places);
  if (scenario_.blade)
    tracks_ = blade_tracks(*scenario_.blade, *domain_, 2 * zone_.spacing.fine);
  zone_.spacing.segments = incision != nullptr ? fine_segments(*incision) : tracks_;
  if (wound != nullptr)
    refine_small_pieces(*wound, zone_.spacing);
  if (scenario_.nodes.count > 0)
    zone_.spacing =
        solvers::spacing_for_count(*domain_, zone_.spacing, scenario_.nodes.count, sprinkle_options(incision, nullptr));
}

// A bonded contact stays with its nodes, so its zone stays too.
bool FineZoneTracker::must_follow(const topology::SurfaceContact& contact) const {
  if (scenario_.contact.condition == solvers::ContactCondition::bonded || scenario_.tool->grasp || contact.depth <= 0)
    return false;
  const double away = (contact.point - centre_->point).norm();
  return away > scenario_.contact.follow_fraction * zone_.spacing.radius;
}

bool FineZoneTracker::is_left_by(const topology::SurfaceContact& contact) const {
  return (contact.point - centre_->point).norm() > zone_.spacing.radius;
}

// Centres of the fine zone lie on a lattice about the first one, as far apart as the contact may leave a centre. So the
// zone goes through the same places, with the same nodes, however often the way is looked at: a session that solves now
// and then has the body of one that solves all the time. A flat punch wants its rings where it is.
topology::SurfaceContact FineZoneTracker::next_centre(const topology::SurfaceContact& contact) const {
  if (std::holds_alternative<topology::FlatPunch>(scenario_.tool->shape))
    return contact;
  const double pitch = scenario_.contact.follow_fraction * zone_.spacing.radius;
  const Vector3 cell = ((contact.point - first_->point) / pitch).array().round();
  topology::SurfaceContact zone = contact;
  zone.point = domain_->closest_surface_point(first_->point + pitch * cell);
  zone.normal = domain_->normal(zone.point);
  const bool near = (zone.point - contact.point).norm() < 0.9 * pitch && zone.normal.dot(contact.normal) > 0.5;
  return near ? zone : contact;
}

void FineZoneTracker::move_to(const topology::SurfaceContact& centre) {
  centre_ = centre;
  zone_.spacing.centres = {centre.point};
}

std::optional<Vector3> FineZoneTracker::facing() const {
  if (!centre_ || !scenario_.tool || scenario_.tool->grasp)
    return std::nullopt;
  return centre_->normal;
}

// The way of the blade and the front of the cut.
std::vector<std::array<Vector3, 2>> FineZoneTracker::fine_segments(const topology::Incision& incision) const {
  std::vector<std::array<Vector3, 2>> segments = tracks_;
  const auto fronts = solvers::front_segments(incision, zone_.spacing.fine);
  segments.insert(segments.end(), fronts.begin(), fronts.end());
  return segments;
}

void FineZoneTracker::follow_fronts(const topology::Incision& incision) {
  zone_.spacing.segments = solvers::front_segments(incision, fine());
}

void FineZoneTracker::follow_fronts_and_way(const topology::Incision& incision) {
  zone_.spacing.segments = fine_segments(incision);
}

void FineZoneTracker::add_way_ahead(const topology::Incision& incision, double spacings) {
  for (std::array<Vector3, 2> ends : solvers::front_segments(incision, fine())) {
    for (Vector3& x : ends)
      if (const auto front = incision.front_frame(x, fine()))
        x += spacings * fine() * front->ahead;
    zone_.spacing.segments.push_back(ends);
  }
}

std::string FineZoneTracker::lead_by_hand(const topology::Incision& incision, const solvers::NodeCloud& nodes) {
  const auto is_coarse = [&](const Vector3& x) {
    double nearest = std::numeric_limits<double>::infinity(), spacing = 0;
    for (int i = 0; i < nodes.size(); ++i)
      if (const double distance = (nodes.positions[i] - x).squaredNorm(); distance < nearest) {
        nearest = distance;
        spacing = nodes.spacings[i];
      }
    return spacing > coarse_for_hand * fine();
  };
  const std::vector<topology::FrontSegment>& front = incision.front();
  if (std::none_of(front.begin(), front.end(),
                   [&](const topology::FrontSegment& segment) { return is_coarse(segment.to); }))
    return "";
  follow_fronts(incision);
  add_way_ahead(incision, way_of_hand);
  return "the front has left the fine nodes";
}

// The way ahead is in the fine zone too, so that the zone lasts for some increments.
std::string FineZoneTracker::lead_ahead(const topology::Incision& incision) {
  const bool leads = !led_segments_.empty() && zone_.spacing.segments == led_segments_;
  const bool holds =
      leads && std::all_of(incision.front().begin(), incision.front().end(), [&](const topology::FrontSegment& front) {
        return solvers::distance_to_segments(front.to, zone_.spacing.segments) <= zone_left * fine();
      });
  if (holds)
    return "";
  zone_.spacing.segments = fine_segments(incision);
  add_way_ahead(incision, zone_ahead);
  led_segments_ = zone_.spacing.segments;
  return leads ? "the front has left the fine zone" : "the fine zone had nothing of the way ahead";
}

void FineZoneTracker::go_back(Mark mark) {
  zone_.spacing.segments = std::move(mark.segments);
  led_segments_ = std::move(mark.led);
}

solvers::SprinkleOptions FineZoneTracker::sprinkle_options(const std::shared_ptr<const topology::Incision>& incision,
                                                           const std::vector<solvers::SeedNode>* kept) const {
  solvers::SprinkleOptions options;
  options.spacing = zone_.spacing;
  if (kept != nullptr)
    options.seeds = *kept;
  else if (centre_)
    options.seeds = contact_seeds(scenario_, *domain_, *centre_, zone_.spacing.fine);
  if (incision != nullptr) // nodes on it belong to one of its faces
    std::erase_if(options.seeds, [&](const solvers::SeedNode& seed) {
      return incision->closest(seed.position, crowded_by_sheet * zone_.spacing.fine).has_value();
    });
  options.random_seed = scenario_.nodes.random_seed;
  options.incision = incision;
  options.walls = gap_walls_;
  options.ring_ahead = solvers::wants_ring_ahead(scenario_.method.method);
  options.lips_apart = cut_appends(scenario_);
  return options;
}

} // namespace spherecut::app
