#include "src/tissue/window_renewal.hpp"

#include <algorithm>
#include <limits>
#include <string_view>

namespace spherecut::app {
namespace {

constexpr double background_spacings = 5; // fine spacings ahead of the blade, condensed in the background
constexpr double drifted = 1e-8;          // residual of an updated body from which it is condensed anew
constexpr double looked_after = 0.25;     // fine spacings that the blade goes before its way ahead is looked at again
constexpr int followed_in_one = 8;        // increments, where every step has one

/// Whether every corner of `way` is within `reach` m of one of `window`.
bool covers(const topology::SurfaceMesh& window, const topology::SurfaceMesh& way, double reach) {
  return std::all_of(way.vertices.begin(), way.vertices.end(), [&](const Vector3& x) {
    return std::any_of(window.vertices.begin(), window.vertices.end(),
                       [&](const Vector3& y) { return (x - y).squaredNorm() <= reach * reach; });
  });
}

} // namespace

std::optional<double> WindowRenewal::watch(const StepSample& sample, const std::optional<topology::BladePose>& last,
                                           const CutReport& cut) {
  if (recondensing_ != nullptr || state_.model.coarseness != state_.zone.coarseness())
    return std::nullopt;
  const double fine = state_.zone.fine();
  if (dynamic_cast<const solvers::Growable*>(state_.model.body.get()) != nullptr) {
    if (cut.update == SystemUpdate::none)
      return std::nullopt;
    const bool has_room = 2 * state_.model.added_nodes < growth_room;
    if (has_room && state_.model.window_seen &&
        edge_travel(state_.scenario.blade->edge, *state_.model.window_seen, *sample.blade) < looked_after * fine)
      return std::nullopt;
    const double error = residual(state_.model);
    const topology::SurfaceMesh way = way_ahead(sample, last, way_spacings * fine, state_.to_rest());
    if (has_room && error < drifted && covers(state_.model.window_way, way, fine)) {
      state_.model.window_seen = *sample.blade;
      return error;
    }
    begin(sample, last, 0);
    return error;
  }
  if (cut.triangles == 0)
    meet_blade(sample, last);
  return std::nullopt;
}

// A body that does not follow is made to as the blade comes near.
void WindowRenewal::meet_blade(const StepSample& sample, const std::optional<topology::BladePose>& last) {
  const double entry = way_into_body(sample);
  if (std::string_view(state_.model.not_following) != too_much_of_body && entry <= way_spacings * state_.zone.fine() &&
      state_.hindrance().empty())
    begin(sample, last, entry);
}

topology::SurfaceMesh WindowRenewal::way_of_blade(const StepSample& sample, const topology::RestMap& to_rest) const {
  return way_ahead(sample, blade_.last(), way_spacings * state_.zone.fine(), to_rest);
}

topology::SurfaceMesh WindowRenewal::way_ahead(const StepSample& sample, const std::optional<topology::BladePose>& last,
                                               double length, const topology::RestMap& to_rest) const {
  const IncisionBuilder& cut = *state_.incisions;
  return cut.way_through(blade_.ahead(sample, last, cut.is_placed(), state_.steps, length, state_.zone.fine()),
                         to_rest);
}

void WindowRenewal::begin(const StepSample& sample, const std::optional<topology::BladePose>& last, double entry) {
  const double fine = state_.zone.fine();
  for (const double spacings : {background_spacings, way_spacings}) {
    topology::SurfaceMesh way = way_ahead(sample, last, entry + spacings * fine, state_.to_rest());
    if (std::none_of(way.vertices.begin(), way.vertices.end(),
                     [&](const Vector3& x) { return state_.organ.domain->signed_distance(x) < 0; }))
      return;
    if (!can_follow(state_.scenario, state_.model, way))
      continue;
    recondensing_ =
        recondense(state_.scenario, state_.model, way,
                   blade_advance(state_.scenario, state_.options) == 0 ? followed_in_one : 1, std::move(given_up_));
    way_ = std::move(way);
    return;
  }
  // One that does not follow is not asked again before it is built anew; one that does, when the blade has gone on.
  state_.model.not_following = too_much_of_body;
  state_.model.window_seen = *sample.blade;
}

// m, from the edge to the surface at rest; 0 inside.
double WindowRenewal::way_into_body(const StepSample& sample) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vector3& x : state_.scenario.blade->edge)
    nearest =
        std::min(nearest, state_.organ.domain->signed_distance(sample.blade->orientation * x + sample.blade->position));
  return std::max(0.0, nearest);
}

void WindowRenewal::lead(const StepSample& sample, const solvers::SprinkleIncrement* followed,
                         const topology::RestMap& to_rest) {
  if (recondensing_ == nullptr)
    return;
  if (followed == nullptr)
    drop();
  else
    recondensing_->follow(*followed, state_.model.body->problem(), way_of_blade(sample, to_rest),
                          state_.model.patch.nodes);
}

void WindowRenewal::drop() {
  if (recondensing_ == nullptr)
    return;
  recondensing_->give_up();
  given_up_ = std::move(recondensing_);
}

bool WindowRenewal::take(solvers::ContactPatch& patch) {
  BodyModel& into = state_.model;
  Recondensed made = recondensing_->take();
  recondensing_.reset();
  if (made.body == nullptr)
    return false;
  into.body = std::move(made.body);
  into.watch.reset();
  into.not_following = "";
  into.window_way = std::move(way_);
  into.added_nodes = 0;
  into.window_seen.reset();
  patch = std::move(made.patch);
  return true;
}

} // namespace spherecut::app
