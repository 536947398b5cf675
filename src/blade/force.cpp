// How a blade goes on against tissue that resists it, and cuts.
#include "src/blade/force.hpp"

#include "src/model/finite_model.hpp"
#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double smallest_increment = 0.05; // of the node spacing: no later cut is shorter at all
constexpr double longer_proposal = 1.5;     // how much farther the blade is when a longer cut is proposed instead
constexpr int stroke_parts = 4;             // over which the forces are taken to change evenly
constexpr int most_looks = 5;               // at a cut that is due by small motions, and is not where the edge is then
constexpr double early = 0.01;              // of the energy that a cut needs: so much less is enough
constexpr int wait_steps = 20;              // halvings towards the place where a cut is due

} // namespace

BladeForce::BladeForce(const Scenario& scenario, BladeEdge edge)
    : edge_(std::move(edge)), tears_(scenario.tearing.enabled) {}

bool BladeForce::meets(const topology::BladePose& pose, const BodyModel& body) const {
  return edge_.inside(pose, body) || (state_ && edge_.pushes(meeting_, body, pose));
}

void BladeForce::go_to(std::span<const topology::BladePose> poses, const BodyModel& body) {
  way_.lead_through(poses);
  if (tears_ && !proposal_)
    way_.skip_open_cut(edge_, body);
  meeting_ = edge_.meet(body, way_.poses(), 0, meeting_);
  press(body);
  if (!proposal_)
    return;
  const EdgeMeeting last = proposal_->meeting;
  proposal_->meeting = edge_.meet(proposal_->body, way_.poses(), proposal_->poses, last);
  try {
    press_proposal();
  } catch (const NumericalError&) { // small motions about the last equilibrium have to do
    if (last.pieces != proposal_->meeting.pieces)
      throw;
    proposal_->meeting = last;
  }
}

void BladeForce::meet_again(const BodyModel& now) {
  if (way_.empty())
    return;
  proposal_.reset();
  if (tears_)
    way_.skip_open_cut(edge_, now);
  const double stored = state_ ? state_->stored : 0;
  meeting_ = edge_.meet(now, way_.poses(), 0, meeting_);
  press(now);
  ledger_.excess += stored - (state_ ? state_->stored : 0); // the tear has taken it
  ledger_.stored = state_ ? state_->stored : 0;
}

double BladeForce::passed_uncut(const BodyModel& body) const {
  const BladePoses& poses = way_.poses();
  return poses.size() < 2 ? 0 : edge_.passed_uncut(meeting_, body, poses[poses.size() - 2], poses.back());
}

void BladeForce::leave() {
  const topology::BladePose last = way_.target();
  lift();
  way_.lead_through({&last, 1});
}

void BladeForce::lift() {
  way_.clear();
  meeting_ = {};
  state_.reset();
  proposal_.reset();
  ledger_.excess += ledger_.stored; // what snaps back
  ledger_.stored = 0;
}

// A body at finite strain is solved with the edge there, and its patch becomes that of small motions about this state.
solvers::BladeState BladeForce::state_at(EdgeMeeting& meeting, const BodyModel& body, const VectorX& advance) {
  if (body.finite != nullptr)
    body.finite->press_edge(advance, drag_of(meeting), meeting.patch);
  return solvers::push_blade(meeting.patch, advance, drag_of(meeting));
}

// The state of the edge where it is.
void BladeForce::press(const BodyModel& now) {
  state_.reset();
  if (!meeting_.pieces.empty())
    state_ = state_at(meeting_, now, edge_.advances(meeting_, now, way_.at()));
  else if (now.finite != nullptr)
    now.finite->leave_edge();
}

void BladeForce::meet_proposal(const EdgeMeeting& last) {
  proposal_->meeting = edge_.meet(proposal_->body, way_.poses(), proposal_->poses, last);
  press_proposal();
  proposal_->through = !edge_.inside(way_.poses()[proposal_->poses], proposal_->body);
}

void BladeForce::press_proposal() {
  EdgeMeeting& meeting = proposal_->meeting;
  if (proposal_->body.finite != nullptr && !meeting.pieces.empty())
    static_cast<void>(state_at(meeting, proposal_->body, edge_.advances(meeting, proposal_->body, way_.at())));
}

std::vector<topology::BladePose> BladeForce::wanted(const BodyModel& now) {
  if (meeting_.pieces.empty() || way_.poses().size() < 2)
    return {};
  // Where the edge is pressed most of what lies ahead of it: that is its pose, or a place before it comes out.
  std::size_t last = 0;
  solvers::BladeState coming;
  BladeReport pressed;
  for (const std::size_t stop : way_.stops(edge_)) {
    solvers::BladeState there = solvers::push_blade(meeting_.patch, edge_.advances(meeting_, now, way_.poses()[stop]),
                                                    meeting_.patch.dragged ? 1 : 0);
    if (const BladeReport report = report_of(meeting_, there); last == 0 || report.release > pressed.release) {
      last = stop;
      coming = std::move(there);
      pressed = report;
    }
  }
  const double way = way_.travel(edge_, 0, last);
  if (proposal_ && way < longer_proposal * proposal_->way)
    return {};
  if (!(pressed.release > needed()))
    return {};
  const double share = needed() / pressed.release; // of its advance that the edge can keep
  double remaining = share * way;
  // A cut of the least length is due when the edge has as much to spare before it as it lacks after it: half of that
  // length farther on. Where the edge gives way by less than that before it cuts, no more is cut at a time.
  const double kept = share * way;
  const double least = kept < 0.5 * least_increment * edge_.spacing()
                           ? std::max(kept, smallest_increment * edge_.spacing())
                           : least_increment * edge_.spacing();
  bool near = way - remaining >= 0.5 * least;
  if (way - remaining < least)
    remaining = std::max(0.0, way - least);
  if (first_cut(meeting_, coming)) {
    near = first_trigger * share <= 1;
    remaining = (1 - first_trigger * share) * std::min(pressed.advance, way);
  }
  const std::size_t front = proposal_ ? proposal_->poses : 0;
  if (!near || front >= last || !(remaining < way_.travel(edge_, front, last)))
    return {};
  if (edge_.leaves_bridge(meeting_, now, way_.poses()[last], way - remaining))
    remaining = 0;
  return way_.up_to(edge_, front, last, remaining);
}

bool BladeForce::lags() const {
  return state_ &&
         edge_travel(edge_.settings().edge, way_.at(), way_.target()) > 0.5 * least_increment * edge_.spacing();
}

void BladeForce::wait(const BodyModel& now) {
  if (!state_) {
    advance(now);
    return;
  }
  for (const std::size_t stop : way_.stops(edge_)) {
    // By poses: what lies behind the edge may end its advance before the motion does.
    const topology::BladePose from = way_.at();
    const auto is_late = [&](const topology::BladePose& pose) {
      const solvers::BladeState there =
          solvers::push_blade(meeting_.patch, edge_.advances(meeting_, now, pose), meeting_.patch.dragged ? 1 : 0);
      return report_of(meeting_, there).release > (first_cut(meeting_, there) ? first_wait : 1) * needed();
    };
    if (!is_late(way_.poses()[stop])) {
      stroke(now, way_.poses()[stop], 1);
      continue;
    }
    double low = 0, high = 1;
    for (int k = 0; k < wait_steps; ++k) {
      const double middle = 0.5 * (low + high);
      (is_late(pose_between(from, way_.poses()[stop], middle)) ? high : low) = middle;
    }
    stroke(now, pose_between(from, way_.poses()[stop], low), 1);
    return;
  }
}

void BladeForce::propose(BodyModel body, std::size_t poses) {
  Proposal next;
  next.way = way_.travel(edge_, 0, way_.last());
  next.poses = poses + (proposal_ ? proposal_->poses : 0);
  next.body = std::move(body);
  std::optional<Proposal> before = std::exchange(proposal_, std::move(next));
  try {
    meet_proposal({});
  } catch (...) {
    proposal_ = std::move(before);
    throw;
  }
}

void BladeForce::solve_proposal(const std::function<void(BodyModel&)>& solve) {
  solve(proposal_->body);
  meet_proposal(EdgeMeeting(proposal_->meeting));
}

std::vector<FrontPlace> BladeForce::places_at_front() const {
  double length = 0;
  for (const solvers::EdgeContact& contact : meeting_.patch.contacts)
    length += contact.length;
  std::vector<FrontPlace> places;
  for (std::size_t c = 0; c < meeting_.patch.contacts.size(); ++c)
    if (meeting_.stands[c] == EdgeStand::front)
      places.push_back({meeting_.patch.contacts[c].point, meeting_.patch.contacts[c].length / length});
  return places;
}

void BladeForce::pass(std::size_t poses, const BodyModel& now) {
  way_.move_front(poses);
  meeting_ = edge_.meet(now, way_.poses(), 0, meeting_);
  press(now);
}

bool BladeForce::advance(const BodyModel& now) {
  if (!state_) {
    way_.come_to(way_.target());
    press(now);
    if (state_)
      ledger_.stored = state_->stored;
    return false;
  }
  for (const std::size_t stop : way_.stops(edge_)) {
    const topology::BladePose target = way_.poses()[stop];
    for (int look = 0; look < most_looks; ++look) {
      const std::optional<double> share = due_on_way_to(now, target);
      if (!share)
        break;
      stroke(now, target, *share);
      if (now.finite == nullptr || is_due())
        return true;
    }
    stroke(now, target, 1);
  }
  return false;
}

// The share of the motion to a pose at which the proposal is due.
std::optional<double> BladeForce::due_on_way_to(const BodyModel& now, const topology::BladePose& target) const {
  if (!proposal_ || (!proposal_->through && proposal_->meeting.pieces.empty()))
    return std::nullopt;
  const EdgeMeeting& meeting = proposal_->meeting;
  return solvers::cutting_share(
      meeting_.patch, {state_->advance, edge_.advances(meeting_, now, target)}, meeting.patch,
      {edge_.advances(meeting, proposal_->body, way_.at()), edge_.advances(meeting, proposal_->body, target)},
      needed_for_proposal(), drag_of(meeting_));
}

// At finite strain the patches are those of small motions about where the edge was last. Where the blade has come to
// they may tell that the cut is not due yet.
bool BladeForce::is_due() {
  press_proposal();
  const EdgeMeeting& meeting = proposal_->meeting;
  const double kept =
      meeting.pieces.empty()
          ? 0
          : solvers::push_blade(meeting.patch, edge_.advances(meeting, proposal_->body, way_.at()), drag_of(meeting_))
                .driving;
  return state_->driving - kept >= (1 - early) * needed_for_proposal();
}

// A share of the blade's motion to a pose, straight.
void BladeForce::stroke(const BodyModel& now, const topology::BladePose& target, double share) {
  const topology::BladePose from = way_.at();
  const VectorX start = state_->advance, end = edge_.advances(meeting_, now, target);
  const VectorX motion = share / stroke_parts * (edge_.motions(meeting_, target) - edge_.motions(meeting_, from));
  const double slide = (target.position - from.position).norm();
  solvers::BladeLedger ledger = ledger_;
  solvers::BladeState state = *state_;
  for (int k = 1; k <= stroke_parts; ++k) {
    const double part = share * k / stroke_parts;
    solvers::BladeState next = state_at(meeting_, now, start + part * (end - start));
    ledger.move(meeting_.patch, state, next, motion, slide * share / stroke_parts);
    state = std::move(next);
  }
  ledger_ = ledger;
  state_ = std::move(state);
  way_.come_to(share < 1 ? pose_between(from, target, share) : target);
}

BladeForce::Taken BladeForce::take() {
  press_proposal(); // where it has no equilibrium all stays as it is
  const double surface = edge_.toughness(meeting_) * (proposal_->meeting.area - meeting_.area);
  const double area = proposal_->meeting.area - meeting_.area,
               paid = needed_for_proposal() * edge_.settings().sharpness;
  const solvers::BladeState before = *state_;
  way_.move_front(proposal_->poses);
  meeting_ = std::move(proposal_->meeting);
  BodyModel body = std::move(proposal_->body);
  proposal_.reset();
  press(body);
  ledger_.cut(before, state_ ? *state_ : solvers::BladeState{}, area > 0 ? paid / area : 0, edge_.settings().sharpness,
              area);
  return {std::move(body), surface};
}

} // namespace spherecut::app
