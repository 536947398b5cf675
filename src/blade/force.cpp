// How a blade goes on against tissue that resists it, and cuts.
#include "src/blade/meeting.hpp"

#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double least_width = 0.75;        // of the node spacing: half width of the edge's contact
constexpr double smallest_increment = 0.05; // of the node spacing: no later cut is shorter at all
constexpr double longer_proposal = 1.5;     // how much farther the blade is when a longer cut is proposed instead
constexpr int stroke_parts = 4;             // over which the forces are taken to change evenly
constexpr double open_reach = 0.3;          // node spacings from a sheet: a place there lies in the cut
constexpr int way_parts = 32;               // of a motion that is looked at for tissue
constexpr int wait_steps = 20;              // halvings towards the place where a cut is due
constexpr double stop_distance = 0.1; // node spacings: poses nearer to each other are one, of a way that is made up for

} // namespace

BladeForce::BladeForce(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double spacing,
                       MapOf map_of, std::function<double(const Vector3&)> toughness)
    : settings_(*scenario.blade), toughness_(std::move(toughness)), spacing_(spacing),
      half_width_(solvers::edge_half_width(scenario.material, settings_.edge_radius, scenario.toughness)),
      tears_(scenario.tearing.enabled), lips_(scenario.cut.lips), domain_(std::move(domain)),
      map_of_(std::move(map_of)) {
  finer_ = half_width_ < least_width * spacing;
  half_width_ = std::max(half_width_, least_width * spacing);
  for (std::size_t i = 1; i < settings_.edge.size(); ++i) {
    const Vector3 side = settings_.edge[i] - settings_.edge[i - 1];
    const int parts = std::max(1, static_cast<int>(std::ceil(side.norm() / spacing)));
    for (int k = 0; k < parts; ++k)
      edge_.push_back({settings_.edge[i - 1] + (k + 0.5) / parts * side, side.normalized(), side.norm() / parts});
  }
}

bool BladeForce::inside(const topology::BladePose& pose, const BodyModel& body) const {
  const topology::RestMap to_rest = map_of_(body);
  return std::any_of(edge_.begin(), edge_.end(), [&](const EdgePiece& piece) {
    return signed_distance(*domain_, to_rest, placed(pose, piece.point)) < 0;
  });
}

void BladeForce::go_to(const topology::BladePose& pose, const BodyModel& body) {
  if (way_.empty())
    at_ = pose;
  way_.push_back(pose);
  pass_open_cut(body);
  meeting_ = meet(body, 0, meeting_);
  if (proposal_)
    proposal_->meeting = meet(proposal_->body, proposal_->poses, proposal_->meeting);
  press(body);
}

void BladeForce::go_to(std::span<const topology::BladePose> poses, const BodyModel& body) {
  pass_by(poses.first(poses.size() - 1));
  go_to(poses.back(), body);
}

// Where a tear has run ahead of the blade, its edge is in the open cut and meets nothing until it comes to the front.
void BladeForce::pass_open_cut(const BodyModel& now) {
  if (!tears_ || now.incision == nullptr || proposal_)
    return;
  const topology::RestMap to_rest = map_of_(now);
  const auto is_open = [&](const topology::BladePose& pose) {
    bool any = false;
    for (const EdgePiece& piece : edge_) {
      Vector3 rest;
      try {
        rest = to_rest(placed(pose, piece.point));
      } catch (const NumericalError&) {
        return false;
      }
      if (domain_->signed_distance(rest) >= 0)
        continue;
      any = true;
      if (!now.incision->closest(rest, open_reach * spacing_) || now.incision->front_frame(rest, spacing_))
        return false;
    }
    return any;
  };
  while (way_.size() > 1 && is_open(way_[1]))
    way_.pop_front();
}

void BladeForce::meet_again(const BodyModel& now) {
  if (way_.empty())
    return;
  proposal_.reset();
  pass_open_cut(now);
  const double stored = state_ ? state_->stored : 0;
  meeting_ = meet(now, 0, meeting_);
  press(now);
  ledger_.excess += stored - (state_ ? state_->stored : 0); // the tear has taken it
  ledger_.stored = state_ ? state_->stored : 0;
}

// Ahead of its contact where it pressed; else, in a motion that came from outside, whatever lies between.
double BladeForce::passed_uncut(const BodyModel& body) const {
  if (way_.size() < 2)
    return 0;
  const topology::BladePose &from = way_[way_.size() - 2], &to = way_.back();
  const topology::RestMap to_rest = map_of_(body);
  double most = 0;
  const auto length_inside = [&](int parts, double part, const auto& place) {
    int inside = 0;
    for (int k = 0; k < parts; ++k)
      inside += domain_->signed_distance(place((k + 0.5) / parts)) < 0 ? 1 : 0;
    most = std::max(most, inside * part);
  };
  for (int piece = 0; piece < std::ssize(edge_); ++piece) {
    const Vector3& point = edge_[static_cast<std::size_t>(piece)].point;
    const Vector3 start = placed(from, point), end = placed(to, point), motion = end - start;
    const auto met = std::find(meeting_.pieces.begin(), meeting_.pieces.end(), piece);
    if (met != meeting_.pieces.end()) {
      const solvers::EdgeContact& contact =
          meeting_.patch.contacts[static_cast<std::size_t>(met - meeting_.pieces.begin())];
      const double gone = contact.push.dot(end - contact.point);
      if (gone > 0 && contact.push.dot(motion) > 0.5 * motion.norm())
        length_inside(way_parts, gone / way_parts,
                      [&](double share) { return Vector3(contact.point + share * gone * contact.push); });
    } else if (signed_distance(*domain_, to_rest, start) >= 0) {
      length_inside(way_parts, motion.norm() / way_parts, [&](double share) {
        const Vector3 x = start + share * motion;
        const bool is_cut = body.incision != nullptr && body.incision->closest(x, open_reach * spacing_);
        return is_cut ? end : x;
      });
    }
  }
  return most > least_increment * spacing_ ? most : 0;
}

void BladeForce::leave() {
  const topology::BladePose last = way_.back();
  lift();
  way_ = {last};
  at_ = last;
}

void BladeForce::lift() {
  way_.clear();
  meeting_ = {};
  state_.reset();
  proposal_.reset();
  ledger_.excess += ledger_.stored; // what snaps back
  ledger_.stored = 0;
}

// The state of the edge where it is.
void BladeForce::press(const BodyModel& now) {
  state_.reset();
  if (!meeting_.pieces.empty())
    state_ = solvers::push_blade(meeting_.patch, advances(meeting_, now, at_), meeting_.patch.dragged ? 1 : 0);
}

bool BladeForce::first_cut(const solvers::BladeState& state) const {
  double surface = 0, all = 0;
  for (std::size_t c = 0; c < meeting_.pieces.size(); ++c) {
    const double force = state.forces[static_cast<Eigen::Index>(c)];
    all += force;
    surface += meeting_.surface[c] != 0 ? force : 0;
  }
  return surface > 0.5 * all;
}

// Mean way of the edge from one pose of way_ to another, m.
double BladeForce::travel(std::size_t from, std::size_t to) const {
  double sum = 0;
  for (std::size_t k = from; k < to; ++k)
    for (const EdgePiece& piece : edge_)
      sum += (placed(way_[k + 1], piece.point) - placed(way_[k], piece.point)).norm();
  return sum / static_cast<double>(edge_.size());
}

// Poses after way_[front] up to the place from which there are `remaining` m to way_[last]; that becomes a pose of
// way_.
std::vector<topology::BladePose> BladeForce::poses_up_to(std::size_t front, std::size_t last, double remaining) {
  std::size_t leg = last;
  while (leg > front) {
    const double length = travel(leg - 1, leg);
    if (remaining <= same_pose * length)
      break;
    if (remaining < (1 - same_pose) * length) {
      const topology::BladePose stop = pose_between(way_[leg - 1], way_[leg], 1 - remaining / length);
      way_.insert(way_.begin() + static_cast<std::ptrdiff_t>(leg), stop);
      break;
    }
    remaining -= length;
    --leg;
  }
  return {way_.begin() + static_cast<std::ptrdiff_t>(front) + 1, way_.begin() + static_cast<std::ptrdiff_t>(leg) + 1};
}

std::vector<topology::BladePose> BladeForce::wanted(const BodyModel& now) {
  if (meeting_.pieces.empty() || way_.size() < 2)
    return {};
  // Where the edge is pressed most of what lies ahead of it: that is its pose, or a place before it comes out.
  std::size_t last = 0;
  solvers::BladeState coming;
  BladeReport pressed;
  for (const std::size_t stop : stops()) {
    solvers::BladeState there =
        solvers::push_blade(meeting_.patch, advances(meeting_, now, way_[stop]), meeting_.patch.dragged ? 1 : 0);
    if (const BladeReport report = report_of(there); last == 0 || report.release > pressed.release) {
      last = stop;
      coming = std::move(there);
      pressed = report;
    }
  }
  const double way = travel(0, last);
  if (proposal_ && way < longer_proposal * proposal_->way)
    return {};
  if (!(pressed.release > needed()))
    return {};
  const double share = needed() / pressed.release; // of its advance that the edge can keep
  double remaining = share * way;
  // A cut of the least length is due when the edge has as much to spare before it as it lacks after it: half of that
  // length farther on. Where the edge gives way by less than that before it cuts, no more is cut at a time.
  const double kept = share * way;
  const double least = kept < 0.5 * least_increment * spacing_ ? std::max(kept, smallest_increment * spacing_)
                                                               : least_increment * spacing_;
  bool near = way - remaining >= 0.5 * least;
  if (way - remaining < least)
    remaining = std::max(0.0, way - least);
  if (first_cut(coming)) {
    near = first_trigger * share <= 1;
    remaining = (1 - first_trigger * share) * std::min(pressed.advance, way);
  }
  const std::size_t front = proposal_ ? proposal_->poses : 0;
  if (!near || front >= last || !(remaining < travel(front, last)))
    return {};
  if (leaves_bridge(now, last, way - remaining))
    remaining = 0;
  return poses_up_to(front, last, remaining);
}

// Poses on the way that the blade has still to go, not too near to each other; the last is among them.
std::vector<std::size_t> BladeForce::stops() const {
  std::vector<std::size_t> stops;
  const std::size_t last = way_.size() - 1;
  std::size_t next = last;
  while (next > 0 && way_[next - 1].time > at_.time)
    --next;
  topology::BladePose from = at_;
  for (; next < last; ++next)
    if (edge_travel(settings_.edge, from, way_[next]) > stop_distance * spacing_) {
      stops.push_back(next);
      from = way_[next];
    }
  stops.push_back(last);
  return stops;
}

bool BladeForce::is_past_due(const VectorX& advance) const {
  const solvers::BladeState state = solvers::push_blade(meeting_.patch, advance, meeting_.patch.dragged ? 1 : 0);
  return report_of(state).release > (first_cut(state) ? first_wait : 1) * needed();
}

bool BladeForce::lags() const {
  return state_ && edge_travel(settings_.edge, at_, way_.back()) > 0.5 * least_increment * spacing_;
}

void BladeForce::wait(const BodyModel& now) {
  if (!state_) {
    advance(now);
    return;
  }
  for (const std::size_t stop : stops()) {
    // By poses: what lies behind the edge may end its advance before the motion does.
    const topology::BladePose from = at_;
    const auto is_late = [&](const topology::BladePose& pose) { return is_past_due(advances(meeting_, now, pose)); };
    if (!is_late(way_[stop])) {
      stroke(now, way_[stop], 1);
      continue;
    }
    double low = 0, high = 1;
    for (int k = 0; k < wait_steps; ++k) {
      const double middle = 0.5 * (low + high);
      (is_late(pose_between(from, way_[stop], middle)) ? high : low) = middle;
    }
    stroke(now, pose_between(from, way_[stop], low), 1);
    return;
  }
}

// Where the edge stands; the same everywhere without layers.
double BladeForce::toughness_of(const Meeting& meeting) const {
  double sum = 0, length = 0;
  for (const solvers::EdgeContact& contact : meeting.patch.contacts) {
    sum += contact.length * toughness_(contact.point + 0.5 * half_width_ * contact.push);
    length += contact.length;
  }
  return length > 0 ? sum / length : 0;
}

double BladeForce::needed_for_proposal() const {
  constexpr double least = 1e-9; // of what the cut takes: the loads pay for it all
  const double all = needed() * (proposal_->meeting.area - meeting_.area);
  return std::max(least * all, all - proposal_->drawn);
}

double BladeForce::proposed_surface() const {
  return toughness_of(meeting_) * (proposal_->meeting.area - meeting_.area);
}

void BladeForce::propose(BodyModel body, std::size_t poses, double drawn) {
  Proposal next;
  next.drawn = drawn;
  next.way = travel(0, way_.size() - 1);
  next.poses = poses + (proposal_ ? proposal_->poses : 0);
  next.body = std::move(body);
  proposal_ = std::move(next);
  proposal_->meeting = meet(proposal_->body, proposal_->poses, {});
  proposal_->through = !inside(way_[proposal_->poses], proposal_->body);
}

void BladeForce::pass(std::size_t poses, const BodyModel& now) {
  way_.erase(way_.begin(), way_.begin() + static_cast<std::ptrdiff_t>(poses));
  meeting_ = meet(now, 0, meeting_);
  press(now);
}

bool BladeForce::advance(const BodyModel& now) {
  if (!state_) {
    at_ = way_.back();
    press(now);
    if (state_)
      ledger_.stored = state_->stored;
    return false;
  }
  const double friction = meeting_.patch.dragged ? 1 : 0;
  for (const std::size_t stop : stops()) {
    const topology::BladePose target = way_[stop];
    std::optional<double> share;
    if (proposal_ && (proposal_->through || !proposal_->meeting.pieces.empty()))
      share = solvers::cutting_share(
          meeting_.patch, {state_->advance, advances(meeting_, now, target)}, proposal_->meeting.patch,
          {advances(proposal_->meeting, proposal_->body, at_), advances(proposal_->meeting, proposal_->body, target)},
          needed_for_proposal(), friction);
    stroke(now, target, share.value_or(1));
    if (share)
      return true;
  }
  return false;
}

// A share of the blade's motion to a pose, straight.
void BladeForce::stroke(const BodyModel& now, const topology::BladePose& target, double share) {
  const topology::BladePose from = at_;
  const VectorX start = state_->advance, end = advances(meeting_, now, target);
  const VectorX motion = share / stroke_parts * (motions(meeting_, target) - motions(meeting_, from));
  const double slide = (target.position - from.position).norm();
  for (int k = 1; k <= stroke_parts; ++k) {
    const double part = share * k / stroke_parts;
    const solvers::BladeState next =
        solvers::push_blade(meeting_.patch, start + part * (end - start), meeting_.patch.dragged ? 1 : 0);
    ledger_.move(meeting_.patch, *state_, next, motion, slide * share / stroke_parts);
    state_ = next;
  }
  at_ = share < 1 ? pose_between(from, target, share) : target;
}

BodyModel BladeForce::take() {
  const double area = proposal_->meeting.area - meeting_.area, paid = needed_for_proposal() * settings_.sharpness;
  const solvers::BladeState before = *state_;
  way_.erase(way_.begin(), way_.begin() + static_cast<std::ptrdiff_t>(proposal_->poses));
  meeting_ = std::move(proposal_->meeting);
  BodyModel body = std::move(proposal_->body);
  proposal_.reset();
  press(body);
  ledger_.cut(before, state_ ? *state_ : solvers::BladeState{}, area > 0 ? paid / area : 0, settings_.sharpness, area);
  return body;
}

} // namespace spherecut::app
