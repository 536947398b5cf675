#include "src/blade_force.hpp"

#include "src/schedule.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double least_width = 0.75;             // of the node spacing: half width of the edge's contact
constexpr double first_trigger = 1.2;            // of the needed release, at which a first cut is proposed
constexpr double first_wait = 2 * first_trigger; // the same, past which the blade waits for a first cut
constexpr double least_increment = 0.2;          // of the node spacing: no later cut is shorter, but where the edge
constexpr double smallest_increment = 0.05;      // gives way by less than half of that: then none shorter than this
constexpr double longer_proposal = 1.5;          // how much farther the blade is when a longer cut is proposed instead
constexpr double depth_factor = 2;               // of its depth in the body: how far a piece of the edge may push
constexpr int entry_steps = 12;                  // halvings towards the place where the edge entered
constexpr double probe_share = 0.05;             // of the half width: a step along the way for the stiffness
constexpr double due_reach = 3;                  // node spacings ahead in which the next cut is looked for
constexpr int stroke_parts = 4;                  // over which the forces are taken to change evenly
constexpr double lip_tolerance = 1e-6;           // m
constexpr double open_reach = 0.3;               // node spacings from a sheet: a place there lies in the cut
constexpr int way_parts = 32;                    // of a motion that is looked at for tissue
constexpr double same_contact = 1e-4;            // of the node spacing, and of one: what has not moved
constexpr double in_sheet = 0.1;                 // node spacings from a sheet: a place there is in it
constexpr double least_motion = 1e-3;            // of the node spacing, that tells a direction
constexpr double same_pose = 1e-6;               // of the way from one pose to the next: no other pose
constexpr int wait_steps = 20;                   // halvings towards the place where a cut is due
constexpr double stop_distance = 0.1; // node spacings: poses nearer to each other are one, of a way that is made up for

Vector3 placed(const topology::BladePose& pose, const Vector3& point) {
  return pose.orientation * point + pose.position;
}

/// Negative inside the body; outside where there is no telling.
double signed_distance(const topology::Domain& domain, const topology::RestMap& to_rest, const Vector3& x) {
  try {
    return domain.signed_distance(to_rest(x));
  } catch (const NumericalError&) {
    return domain.signed_distance(x);
  }
}

/// Of the pairs of lips along their normals, m.
VectorX openings(const BodyModel& body, const solvers::Field& field) {
  std::vector<int> plus, minus;
  for (const solvers::LipPair& pair : body.pairs) {
    plus.push_back(pair.plus);
    minus.push_back(pair.minus);
  }
  const MatrixX apart =
      body.body->contact_displacements(plus, {field}) - body.body->contact_displacements(minus, {field});
  VectorX open(std::ssize(body.pairs));
  for (Eigen::Index p = 0; p < open.size(); ++p)
    open[p] = body.pairs[static_cast<std::size_t>(p)].normal.dot(apart.col(0).segment<3>(3 * p));
  return open;
}

/// The body under its loads and its tool: lips that the blade brings together are in its own contact.
solvers::Field without_lips(const BodyModel& body) {
  const bool tool = body.state && !body.patch.nodes.empty();
  return tool ? solvers::deform(*body.body, body.patch, body.state->tool) : body.base;
}

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

// Whether material that is now at x was at rest on a sheet.
bool BladeForce::lies_in(const topology::Incision& cut, const topology::RestMap& to_rest, const Vector3& x) const {
  try {
    const auto on = cut.closest(to_rest(x), in_sheet * spacing_);
    return on && !on->on_border;
  } catch (const NumericalError&) {
    return false;
  }
}

// The edge piece stands against the front, or against the surface where it came in after the front was left behind.
void BladeForce::add_contact(const BodyModel& body, const topology::RestMap& to_rest, std::size_t front, int piece,
                             Meeting& meeting, std::vector<solvers::EdgeContact>& contacts) const {
  const EdgePiece& part = edge_[static_cast<std::size_t>(piece)];
  const auto outside = [&](const topology::BladePose& pose) {
    return signed_distance(*domain_, to_rest, placed(pose, part.point)) >= 0;
  };
  std::size_t leg = front; // from way_[leg] to the next
  topology::BladePose met = way_[front];
  bool on_surface = outside(met);
  // Where on a leg, from a share of it on, something that is true of the pose ends: just before and just after.
  const auto end_of = [&](std::size_t at, double before, const auto& holds) {
    double after = 1;
    for (int k = 0; k < entry_steps; ++k) {
      const double middle = 0.5 * (before + after);
      (holds(pose_between(way_[at], way_[at + 1], middle)) ? before : after) = middle;
    }
    return std::pair{before, after};
  };
  if (on_surface) {
    while (leg + 1 < way_.size() && outside(way_[leg + 1]))
      ++leg;
    if (leg + 1 >= way_.size())
      return;
    const double in = end_of(leg, 0, outside).second;
    met = pose_between(way_[leg], way_[leg + 1], in);
    // Where it comes back into a cut it meets nothing before it has gone through that.
    const auto is_cut = [&](const topology::BladePose& pose) {
      return lies_in(*body.incision, to_rest, placed(pose, part.point));
    };
    if (body.incision != nullptr && is_cut(met)) {
      double begin = in;
      while (leg + 1 < way_.size() && is_cut(way_[leg + 1])) {
        ++leg;
        begin = 0;
      }
      if (leg + 1 >= way_.size())
        return;
      met = pose_between(way_[leg], way_[leg + 1], end_of(leg, begin, is_cut).first);
      on_surface = false;
    }
  }
  // Its way from there: to where it is clear of its start and, past a turn, of the cut that is there already, on whose
  // faces it does not push when it goes back.
  const Vector3 along = met.orientation * part.along, start = placed(way_[leg], part.point);
  Vector3 across = Vector3::Zero(), looked_at = start;
  for (std::size_t next = leg + 1; next < way_.size(); ++next) {
    const Vector3 x = placed(way_[next], part.point);
    const Vector3 way = x - start - (x - start).dot(along) * along;
    if (across.norm() < least_motion * spacing_)
      across = way;
    if (way.norm() < least_increment * spacing_ || (x - looked_at).norm() < least_increment * spacing_)
      continue;
    looked_at = x;
    if (on_surface || body.incision == nullptr || !lies_in(*body.incision, to_rest, x)) {
      across = way;
      break;
    }
  }
  if (across.norm() < 1e-6 * spacing_)
    return;
  solvers::EdgeContact contact;
  contact.push = across.normalized();
  contact.normal = along.cross(contact.push);
  contact.length = part.length;
  try {
    contact.point = to_rest(placed(met, part.point));
  } catch (const NumericalError&) {
    return;
  }
  if (!on_surface && body.incision != nullptr)
    if (const auto tip = body.incision->front_frame(contact.point, 2 * spacing_))
      contact.point = tip->point;
  if (domain_->signed_distance(contact.point + 0.5 * half_width_ * contact.push) > 0)
    return; // it grazes: there is no material ahead
  contacts.push_back(contact);
  meeting.pieces.push_back(piece);
  meeting.surface.push_back(on_surface ? 1 : 0);
}

// What is as it was in the `last` meeting need not be solved for again.
BladeForce::Meeting BladeForce::meet(const BodyModel& body, std::size_t front, const Meeting& last) const {
  Meeting meeting;
  meeting.area = body.incision != nullptr ? body.incision->area() : 0;
  if (front + 1 >= way_.size())
    return meeting;
  const topology::RestMap to_rest = map_of_(body);
  std::vector<solvers::EdgeContact> contacts;
  for (int piece = 0; piece < std::ssize(edge_); ++piece)
    add_contact(body, to_rest, front, piece, meeting, contacts);
  if (contacts.empty())
    return meeting;
  const solvers::BladePatch* known = last.is_with(body) ? &last.patch : nullptr;
  meeting.body = body.body.get();
  meeting.incision = body.incision;
  meeting.nodes = body.sprinkling.nodes.positions;
  for (std::size_t c = 0; known != nullptr && c < contacts.size(); ++c) { // rounding moves them from step to step
    const auto found = std::find(last.pieces.begin(), last.pieces.end(), meeting.pieces[c]);
    if (found == last.pieces.end() || last.surface[found - last.pieces.begin()] != meeting.surface[c])
      continue;
    const solvers::EdgeContact& there = known->contacts[found - last.pieces.begin()];
    if ((there.point - contacts[c].point).norm() < same_contact * spacing_ &&
        (there.push - contacts[c].push).norm() < same_contact)
      contacts[c] = there;
  }
  Vector3 course = Vector3::Zero();
  for (const solvers::EdgeContact& contact : contacts)
    course += contact.length * contact.push;
  meeting.drawn_back = (way_.back().position - way_[way_.size() - 2].position).dot(course) < 0;
  const solvers::ForcePattern flanks = drag(body, contacts, meeting.drawn_back ? Vector3(-course) : course);
  const solvers::Field base = without_lips(body);
  std::vector<solvers::LipPair> pairs;
  std::vector<char> used(body.pairs.size(), 0);
  for (std::size_t p = 0; known != nullptr && p < body.pairs.size(); ++p)
    if (std::any_of(known->pairs.begin(), known->pairs.end(),
                    [&](const solvers::LipPair& pair) { return pair.plus == body.pairs[p].plus; })) {
      used[p] = 1;
      pairs.push_back(body.pairs[p]);
    }
  for (int round = 0; round < 3; ++round) { // pairs that the blade would press through one another, and no others
    meeting.patch = solvers::condense_blade(*body.body, base, contacts, half_width_, pairs, flanks, known);
    known = &meeting.patch;
    if (lips_ == solvers::LipCondition::open || body.pairs.empty())
      break;
    const solvers::BladeState state = solvers::push_blade(meeting.patch, advances(meeting, body, way_.back()));
    const VectorX open = openings(body, solvers::deform(meeting.patch, state, base));
    const std::size_t before = pairs.size();
    for (std::size_t p = 0; p < body.pairs.size(); ++p)
      if (open[static_cast<Eigen::Index>(p)] < -lip_tolerance && used[p] == 0) {
        used[p] = 1;
        pairs.push_back(body.pairs[p]);
      }
    if (pairs.size() == before)
      break;
  }
  return meeting;
}

// Faces of the cut near the edge, behind it, against a motion along `way`.
solvers::ForcePattern BladeForce::drag(const BodyModel& body, const std::vector<solvers::EdgeContact>& contacts,
                                       const Vector3& way) const {
  if (settings_.friction == 0 || settings_.flank == 0 || body.incision == nullptr || way.norm() == 0)
    return {};
  std::vector<solvers::FlankPoint> flanks;
  for (const topology::SurfaceMesh& sheet : body.incision->sheets())
    for (const Triangle& t : sheet.triangles) {
      const Vector3 a = sheet.vertices[t[0]], b = sheet.vertices[t[1]], c = sheet.vertices[t[2]];
      const Vector3 middle = (a + b + c) / 3, area = 0.5 * (b - a).cross(c - a);
      const bool near = std::any_of(contacts.begin(), contacts.end(), [&](const solvers::EdgeContact& contact) {
        return (middle - contact.point).norm() < settings_.flank;
      });
      if (near && domain_->signed_distance(middle) < 0)
        flanks.push_back({middle, area.normalized(), area.norm()});
    }
  return flanks.empty() ? solvers::ForcePattern{}
                        : solvers::drag_pattern(flanks, settings_.friction, way.normalized(), spacing_);
}

// Past a contact's rest position; a piece of the edge that has come out of the body pushes nothing.
VectorX BladeForce::advances(const Meeting& meeting, const BodyModel& body, const topology::BladePose& pose) const {
  const topology::RestMap to_rest = map_of_(body);
  VectorX result(std::ssize(meeting.pieces));
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    const solvers::EdgeContact& contact = meeting.patch.contacts[static_cast<std::size_t>(c)];
    const Vector3 x = placed(pose, edge_[static_cast<std::size_t>(meeting.pieces[static_cast<std::size_t>(c)])].point);
    const double depth = std::max(0.0, -signed_distance(*domain_, to_rest, x));
    result[c] = std::min(contact.push.dot(x - contact.point), meeting.patch.base[c] + depth_factor * depth);
  }
  return result;
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
    const VectorX start = state_->advance, end = advances(meeting_, now, way_[stop]);
    if (!is_past_due(end)) {
      stroke(now, way_[stop], 1);
      continue;
    }
    double low = 0, high = 1;
    for (int k = 0; k < wait_steps; ++k) {
      const double middle = 0.5 * (low + high);
      (is_past_due(start + middle * (end - start)) ? high : low) = middle;
    }
    stroke(now, way_[stop], low);
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
    if (proposal_ && !proposal_->meeting.pieces.empty())
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
  const double slide = (target.position - from.position).norm();
  for (int k = 1; k <= stroke_parts; ++k) {
    const double part = share * k / stroke_parts;
    const solvers::BladeState next =
        solvers::push_blade(meeting_.patch, start + part * (end - start), meeting_.patch.dragged ? 1 : 0);
    ledger_.move(meeting_.patch, *state_, next, slide * share / stroke_parts);
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
  ledger_.cut(before, *state_, area > 0 ? paid / area : 0, settings_.sharpness, area);
  return body;
}

solvers::Field BladeForce::field(const BodyModel& body) const {
  return state_ ? solvers::deform(meeting_.patch, *state_, without_lips(body)) : body.field;
}

BladeReport BladeForce::report() const {
  return state_ ? report_of(*state_) : BladeReport{.ledger = ledger_};
}

// Stiffness and the force at which the next cut is due come from the blade moved on along the way of its edge.
BladeGrip BladeForce::grip(const BodyModel& now) const {
  BladeGrip grip;
  grip.work = ledger_.work;
  grip.surface = ledger_.surface;
  if (!state_)
    return grip;
  const BladeReport here = report_of(*state_);
  Vector3 way = Vector3::Zero();
  for (const solvers::EdgeContact& contact : meeting_.patch.contacts)
    way += contact.length * contact.push;
  if (!(way.norm() > 0)) // pieces that are driven apart
    return grip;
  grip.along = here.edge_force > 0 ? Vector3(-state_->edge_force / here.edge_force) : way.normalized();
  grip.contacts = static_cast<int>(meeting_.pieces.size());
  grip.places = std::min(grip.contacts, BladeGrip::most_places);
  for (int k = 0; k < grip.places; ++k) { // from the first to the last
    const int c = grip.places > 1 ? k * (grip.contacts - 1) / (grip.places - 1) : 0;
    const Vector3& point = edge_[static_cast<std::size_t>(meeting_.pieces[static_cast<std::size_t>(c)])].point;
    grip.place[static_cast<std::size_t>(k)] = way_.back().orientation * point;
  }
  grip.force = state_->blade_force;
  grip.edge = here.edge_force;
  grip.drag = (meeting_.drawn_back ? -1.0 : 1.0) * (state_->blade_force - state_->edge_force);
  grip.stored = state_->stored;
  grip.release = here.release;
  const double friction = meeting_.patch.dragged ? 1 : 0;
  const auto onward = [&](const Meeting& meeting, const VectorX& from, double distance) {
    VectorX to = from;
    for (Eigen::Index c = 0; c < to.size(); ++c)
      to[c] += distance * meeting.patch.contacts[static_cast<std::size_t>(c)].push.dot(grip.along);
    return to;
  };
  const double probe = probe_share * half_width_;
  const auto edge_after = [&](double distance) {
    return solvers::push_blade(meeting_.patch, onward(meeting_, state_->advance, distance), friction).edge_force;
  };
  grip.stiffness = std::max(0.0, (-edge_after(probe).dot(grip.along) - grip.edge) / probe);
  if (proposal_ && !proposal_->meeting.pieces.empty()) {
    const double reach = due_reach * spacing_;
    const VectorX coming = advances(proposal_->meeting, proposal_->body, at_);
    if (const auto share = solvers::cutting_share(
            meeting_.patch, {state_->advance, onward(meeting_, state_->advance, reach)}, proposal_->meeting.patch,
            {coming, onward(proposal_->meeting, coming, reach)}, needed_for_proposal(), friction))
      grip.due = std::max(grip.edge, -edge_after(*share * reach).dot(grip.along));
  } else {
    double length = 0;
    for (const solvers::EdgeContact& contact : meeting_.patch.contacts)
      length += contact.length;
    // Where nothing is cut yet it is not known: what the blade waits for a first cut at or, past that, twice what there
    // is, is as far as a solve may be gone on from.
    const double least = needed() * length;
    if (now.incision != nullptr && !first_cut(*state_))
      grip.due = std::max(grip.edge, least);
    else
      grip.due = grip.edge > (1 + same_pose) * first_wait * least ? 2 * grip.edge : first_wait * least;
  }
  return grip;
}

BladeReport BladeForce::report_of(const solvers::BladeState& state) const {
  BladeReport report;
  report.ledger = ledger_;
  report.force = state.blade_force;
  report.edge_force = state.edge_force.norm();
  report.converged = state.converged;
  double force = 0, length = 0;
  for (std::size_t c = 0; c < meeting_.pieces.size(); ++c) {
    const auto entry = static_cast<Eigen::Index>(c);
    if (!(state.forces[entry] > 0))
      continue;
    ++report.contacts;
    force += state.forces[entry];
    length += meeting_.patch.contacts[c].length;
    report.advance = std::max(report.advance, state.advance[entry] - meeting_.patch.base[entry]);
  }
  if (length > 0)
    report.release = force / length;
  return report;
}

} // namespace spherecut::app
