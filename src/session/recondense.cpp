// Condensing a body anew beside the updates by which it follows its cut, so that no step has to do it.
#include "src/base/stage_timer.hpp"
#include "src/session/session.hpp"

#include <algorithm>

namespace spherecut::app {
namespace {

constexpr double background_spacings = 5; // fine spacings ahead of the blade for which it is condensed beside the steps
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

void Session::set_recondensing(bool on) {
  recondensing_on_ = on;
  if (!on)
    drop_recondensing();
}

// By an update alone where a replacement is on its way; where that cannot be, the replacement takes over and follows.
solvers::BodyGrowth Session::follow_cut(const std::function<topology::SurfaceMesh()>& way_ahead, BodyModel& next,
                                        BodyUpdate& report) {
  const bool follows = dynamic_cast<const solvers::Growable*>(model_.body.get()) != nullptr;
  const auto grow = [&](bool only_update) {
    return app::follow_cut(scenario_, organ_.domain, *followed_, way_ahead, model_, next, only_update);
  };
  // Where motion is put off a body that leaves its window is only given another one if that pays.
  const auto pays = [&](const topology::SurfaceMesh& way) {
    return way.triangles.empty() || can_follow(scenario_, model_, way);
  };
  const bool renews = !follows || !scenario_.blade || advance() == 0 || pays(way_ahead());
  solvers::BodyGrowth growth = grow(recondensing_ != nullptr || !renews);
  bool taken = false;
  if (next.body == nullptr && recondensing_ != nullptr && (growth.update.declined || !follows)) {
    solvers::ContactPatch unused;
    taken = take_recondensed(model_, unused);
    if (taken || follows)
      growth = grow(false);
  }
  if (next.body != nullptr)
    report.update = growth.update.condensed_anew ? SystemUpdate::condensed_anew
                    : taken                      ? SystemUpdate::taken_over
                                                 : SystemUpdate::updated;
  return growth;
}

// What one that follows the blade's cut is condensed anew for: its window has not much left of what lies ahead, it is
// running out of room, or rounding has added up.
void Session::watch_window(const StepSample& sample, const std::optional<topology::BladePose>& last,
                           StepResult& result) {
  if (recondensing_ != nullptr || model_.coarseness != coarseness_ || !result.cut)
    return;
  const double fine = zone_.spacing.fine;
  if (dynamic_cast<const solvers::Growable*>(model_.body.get()) != nullptr) {
    if (result.cut->update == SystemUpdate::none)
      return;
    const bool has_room = 2 * model_.added_nodes < growth_room;
    if (has_room && model_.window_seen &&
        edge_travel(scenario_.blade->edge, *model_.window_seen, *sample.blade) < looked_after * fine)
      return;
    result.residual = residual(model_);
    const topology::SurfaceMesh way = way_ahead_of(sample, last, way_spacings * fine);
    if (has_room && result.residual < drifted && covers(model_.window_way, way, fine)) {
      model_.window_seen = *sample.blade;
      return;
    }
    begin_recondensing(sample, last, 0);
  } else if (result.cut->triangles == 0) {
    meet_blade(sample, last);
  }
}

// A body that does not follow is made to as the blade comes near.
void Session::meet_blade(const StepSample& sample, const std::optional<topology::BladePose>& last) {
  const double entry = way_into_body(sample);
  if (std::string_view(model_.not_following) != too_much_of_body && entry <= way_spacings * zone_.spacing.fine &&
      hindrance_to_growth(scenario_, model_, !unheld_pieces(incisions_->wound(), scenario_.fixed).empty()).empty())
    begin_recondensing(sample, last, entry);
}

topology::SurfaceMesh Session::way_ahead_of(const StepSample& sample, const std::optional<topology::BladePose>& last,
                                            double length) const {
  return incisions_->way_through(blade_ahead(sample, last, length),
                                 [this](const Vector3& x) { return rest_position(x); });
}

void Session::begin_recondensing(const StepSample& sample, const std::optional<topology::BladePose>& last,
                                 double entry) {
  const double fine = zone_.spacing.fine;
  for (const double spacings : {background_spacings, way_spacings}) {
    topology::SurfaceMesh way = way_ahead_of(sample, last, entry + spacings * fine);
    if (std::none_of(way.vertices.begin(), way.vertices.end(),
                     [&](const Vector3& x) { return organ_.domain->signed_distance(x) < 0; }))
      return;
    if (!can_follow(scenario_, model_, way))
      continue;
    recondensing_ = recondense(scenario_, model_, way, advance() == 0 ? followed_in_one : 1, std::move(given_up_));
    recondensing_way_ = std::move(way);
    return;
  }
  // One that does not follow is not asked again before it is built anew; one that does, when the blade has gone on.
  model_.not_following = too_much_of_body;
  model_.window_seen = *sample.blade;
}

// m, from the edge to the surface at rest; 0 inside.
double Session::way_into_body(const StepSample& sample) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vector3& x : scenario_.blade->edge)
    nearest = std::min(nearest, organ_.domain->signed_distance(sample.blade->orientation * x + sample.blade->position));
  return std::max(0.0, nearest);
}

// The one under way goes with the cut that the body has just followed.
void Session::lead_recondensing(const StepSample& sample, const topology::RestMap& to_rest) {
  if (recondensing_ == nullptr)
    return;
  if (followed_)
    recondensing_->follow(*followed_, model_.body->problem(), way_of_blade(sample, to_rest), model_.patch.nodes);
  else
    drop_recondensing();
}

void Session::drop_recondensing() {
  if (recondensing_ == nullptr)
    return;
  recondensing_->give_up();
  given_up_ = std::move(recondensing_);
}

// Waits for it; false: it could not follow.
bool Session::take_recondensed(BodyModel& into, solvers::ContactPatch& patch) {
  Recondensed made = recondensing_->take();
  recondensing_.reset();
  if (made.body == nullptr)
    return false;
  into.body = std::move(made.body);
  into.watch.reset();
  into.not_following = "";
  into.window_way = std::move(recondensing_way_);
  into.added_nodes = 0;
  into.window_seen.reset();
  patch = std::move(made.patch);
  return true;
}

bool Session::recondensed() const {
  const auto is_there = [](const std::future<MadeAside>& made) {
    return made.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  if (following_)
    return is_there(following_->made);
  if (proposing_)
    return !proposing_->arrived && is_there(proposing_->made);
  return recondensing_ != nullptr && recondensing_->ready();
}

bool Session::swap_body() {
  if (following_) {
    take_following();
    return !(aside_cut_ && aside_cut_->refused);
  }
  if (proposing_) { // becomes the blade's once a step has solved it
    proposing_->made.wait();
    return proposing_->arrived = true;
  }
  if (recondensing_ == nullptr)
    return false;
  solvers::ContactPatch patch;
  if (!take_recondensed(model_, patch))
    return false;
  model_.lips.reset();
  if (patch.nodes != model_.patch.nodes) {
    condense_again();
    return true;
  }
  model_.base = patch.base;
  patch.lifts = std::move(model_.patch.lifts);
  model_.patch = std::move(patch);
  return true;
}

} // namespace spherecut::app
