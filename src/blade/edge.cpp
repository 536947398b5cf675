// Where the edge of a blade meets the body: contacts, lips beside it, drag of its flanks, how far it pushes.
#include "src/blade/edge.hpp"

#include "src/model/finite_model.hpp"
#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double least_needed = 1e-9; // of the toughness: what the edge releases where the loads pay for it all
constexpr double least_width = 0.75;  // of the node spacing: half width of the edge's contact
constexpr double open_reach = 0.3;    // node spacings from a sheet: a place there lies in the cut
constexpr int way_parts = 32;         // of a motion that is looked at for tissue
constexpr double depth_factor = 2;    // of its depth in the body: how far a piece of the edge may push
constexpr double ahead = 0.1;         // of the half width: less material than that before a piece of the edge is none
constexpr int entry_steps = 12;       // halvings towards the place where the edge entered
constexpr double opening_tolerance = 1e-6; // m
constexpr double same_contact = 1e-4;      // of the node spacing, and of one: what has not moved
constexpr double in_sheet = 0.1;           // node spacings from a sheet: a place there is in it
constexpr double least_motion = 1e-3;      // of the node spacing, that tells a direction
constexpr double most_across = 0.1;        // of a way along its own line: an edge that goes across by no more slides in

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

/// The way of a piece of the edge in the body at rest; one that is linear turns little.
Vector3 at_rest(const BodyModel& body, const solvers::EdgeContact& contact) {
  if (body.finite == nullptr)
    return contact.push;
  try {
    return body.finite->turned_back(contact.point, contact.push);
  } catch (const InputError&) { // beside the body
    return contact.push;
  }
}

/// Negative inside the body as it is; outside where there is no telling.
double signed_distance(const topology::Domain& domain, const topology::RestMap& to_rest, const Vector3& x) {
  try {
    return domain.signed_distance(to_rest(x));
  } catch (const NumericalError&) {
    return domain.signed_distance(x);
  }
}

} // namespace

BladeEdge::BladeEdge(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double spacing,
                     MapOf map_of, std::function<double(const Vector3&)> toughness)
    : settings_(*scenario.blade), toughness_(std::move(toughness)), spacing_(spacing),
      half_width_(solvers::edge_half_width(scenario.material, settings_.edge_radius, scenario.toughness)),
      lips_(scenario.cut.lips), grasps_(scenario.tool && scenario.tool->grasp), domain_(std::move(domain)),
      map_of_(std::move(map_of)) {
  finer_ = half_width_ < least_width * spacing;
  half_width_ = std::max(half_width_, least_width * spacing);
  for (std::size_t i = 1; i < settings_.edge.size(); ++i) {
    const Vector3 side = settings_.edge[i] - settings_.edge[i - 1];
    const int parts = std::max(1, static_cast<int>(std::ceil(side.norm() / spacing)));
    for (int k = 0; k < parts; ++k)
      pieces_.push_back({settings_.edge[i - 1] + (k + 0.5) / parts * side, side.normalized(), side.norm() / parts});
  }
}

bool BladeEdge::inside(const topology::BladePose& pose, const BodyModel& body) const {
  const topology::RestMap to_rest = map_of_(body);
  return std::any_of(pieces_.begin(), pieces_.end(), [&](const Piece& piece) {
    return signed_distance(*domain_, to_rest, placed(pose, piece.point)) < 0;
  });
}

bool BladeEdge::is_in_open_cut(const topology::BladePose& pose, const BodyModel& body) const {
  if (body.incision == nullptr)
    return false;
  const topology::RestMap to_rest = map_of_(body);
  bool any = false;
  for (const Piece& piece : pieces_) {
    Vector3 rest;
    try {
      rest = to_rest(placed(pose, piece.point));
    } catch (const NumericalError&) {
      return false;
    }
    if (domain_->signed_distance(rest) >= 0)
      continue;
    any = true;
    if (!body.incision->closest(rest, open_reach * spacing_) || body.incision->front_frame(rest, spacing_))
      return false;
  }
  return any;
}

namespace {

/// The patch held where it is, without lips.
solvers::ContactState held_patch_alone(const BodyModel& body) {
  std::vector<Vector3> places;
  for (Eigen::Index c = 0; c < std::ssize(body.patch.nodes); ++c)
    places.emplace_back(body.state->tool.displacement.segment<3>(3 * c));
  return solvers::prescribe(body.patch, places);
}

} // namespace

solvers::Field without_lips(const BodyModel& body, bool grasped) {
  if (!body.state || body.patch.nodes.empty())
    return body.base;
  return solvers::deform(*body.body, body.patch, grasped ? held_patch_alone(body) : body.state->tool);
}

// Whether material that is now at x was at rest on a sheet.
bool BladeEdge::lies_in(const topology::Incision& cut, const topology::RestMap& to_rest, const Vector3& x) const {
  try {
    const auto on = cut.closest(to_rest(x), in_sheet * spacing_);
    return on && !on->on_border;
  } catch (const NumericalError&) {
    return false;
  }
}

// The edge piece stands against the front, or against the surface where it came in after the front was left behind.
void BladeEdge::add_contact(const BodyModel& body, const topology::RestMap& to_rest, const BladePoses& poses,
                            std::size_t front, int piece, EdgeMeeting& meeting,
                            std::vector<solvers::EdgeContact>& contacts) const {
  const Piece& part = pieces_[static_cast<std::size_t>(piece)];
  const auto outside = [&](const topology::BladePose& pose) {
    return signed_distance(*domain_, to_rest, placed(pose, part.point)) >= 0;
  };
  std::size_t leg = front; // from poses[leg] to the next
  topology::BladePose met = poses[front];
  bool on_surface = outside(met);
  // Where on a leg, from a share of it on, something that is true of the pose ends: just before and just after.
  const auto end_of = [&](std::size_t at, double before, const auto& holds) {
    double after = 1;
    for (int k = 0; k < entry_steps; ++k) {
      const double middle = 0.5 * (before + after);
      (holds(pose_between(poses[at], poses[at + 1], middle)) ? before : after) = middle;
    }
    return std::pair{before, after};
  };
  double in = 0;
  if (on_surface) {
    while (leg + 1 < poses.size() && outside(poses[leg + 1]))
      ++leg;
    if (leg + 1 >= poses.size())
      return;
    in = end_of(leg, 0, outside).second;
    met = pose_between(poses[leg], poses[leg + 1], in);
  }
  // Where it comes into a cut, or stands in one far from its front, it meets nothing before it has gone through that.
  const auto is_cut = [&](const topology::BladePose& pose) {
    return lies_in(*body.incision, to_rest, placed(pose, part.point));
  };
  if (body.incision != nullptr && is_cut(met) &&
      (on_surface || !body.incision->front_frame(to_rest(placed(met, part.point)), 2 * spacing_))) {
    while (leg + 1 < poses.size() && is_cut(poses[leg + 1])) {
      ++leg;
      in = 0;
    }
    if (leg + 1 >= poses.size())
      return;
    met = pose_between(poses[leg], poses[leg + 1], end_of(leg, in, is_cut).first);
    on_surface = false;
  }
  // Along its own line it slides in, and pushes nothing: it stands where it has come to before it goes across.
  bool slides_in = false;
  if (on_surface) {
    const Vector3 line = met.orientation * part.along, entered = placed(met, part.point);
    Vector3 stands = entered;
    std::size_t last = leg;
    for (std::size_t next = leg + 1; next < poses.size(); ++next) {
      const Vector3 way = placed(poses[next], part.point) - stands;
      const double slid = std::abs(way.dot(line)), across = (way - way.dot(line) * line).norm();
      if (across > least_increment * spacing_)
        break;
      if (across > most_across * slid || outside(poses[next]))
        continue;
      stands += way;
      last = next;
    }
    slides_in = std::abs((stands - entered).dot(line)) > least_increment * spacing_;
    if (slides_in) {
      leg = last;
      met = poses[leg];
    }
  }
  // Its way from there: to where it is clear of its start and, past a turn, of the cut that is there already, on whose
  // faces it does not push when it goes back.
  const Vector3 along = met.orientation * part.along, start = placed(poses[leg], part.point);
  Vector3 across = Vector3::Zero(), looked_at = start;
  for (std::size_t next = leg + 1; next < poses.size(); ++next) {
    const Vector3 x = placed(poses[next], part.point);
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
  if (domain_->signed_distance(contact.point + ahead * half_width_ * at_rest(body, contact)) > 0)
    return; // it grazes: there is no material ahead
  contacts.push_back(contact);
  meeting.pieces.push_back(piece);
  meeting.stands.push_back(slides_in ? EdgeStand::inside : on_surface ? EdgeStand::surface : EdgeStand::front);
}

EdgeMeeting BladeEdge::meet(const BodyModel& body, const BladePoses& poses, std::size_t front,
                            const EdgeMeeting& last) const {
  EdgeMeeting meeting;
  meeting.area = body.incision != nullptr ? body.incision->area() : 0;
  if (front + 1 >= poses.size() || !body.built())
    return meeting;
  const topology::RestMap to_rest = map_of_(body);
  std::vector<solvers::EdgeContact> contacts;
  for (int piece = 0; piece < std::ssize(pieces_); ++piece)
    add_contact(body, to_rest, poses, front, piece, meeting, contacts);
  if (contacts.empty())
    return meeting;
  if (grasps_ && body.finite == nullptr && body.state && !body.patch.nodes.empty()) {
    meeting.held = body.patch.nodes;
    meeting.grip = body.state->tool.displacement;
    const solvers::ContactState alone = held_patch_alone(body);
    meeting.held_base.resize(meeting.grip.size());
    for (Eigen::Index c = 0; 3 * c < meeting.grip.size(); ++c)
      meeting.held_base.segment<3>(3 * c) = alone.nodal_forces[static_cast<std::size_t>(c)];
  }
  const solvers::BladePatch* known = last.is_with(body) && last.held == meeting.held ? &last.patch : nullptr;
  meeting.body = body.body.get();
  meeting.finite = body.finite.get();
  meeting.incision = body.incision;
  meeting.nodes = body.sprinkling.nodes.positions;
  for (std::size_t c = 0; known != nullptr && c < contacts.size(); ++c) { // rounding moves them from step to step
    const auto found = std::find(last.pieces.begin(), last.pieces.end(), meeting.pieces[c]);
    if (found == last.pieces.end() || last.stands[found - last.pieces.begin()] != meeting.stands[c])
      continue;
    const solvers::EdgeContact& there = known->contacts[found - last.pieces.begin()];
    if ((there.point - contacts[c].point).norm() < same_contact * spacing_ &&
        (there.push - contacts[c].push).norm() < same_contact)
      contacts[c] = there;
  }
  Vector3 course = Vector3::Zero();
  for (const solvers::EdgeContact& contact : contacts)
    course += contact.length * contact.push;
  meeting.drawn_back = (poses.back().position - poses[poses.size() - 2].position).dot(course) < 0;
  const solvers::ForcePattern flanks = drag(body, contacts, meeting.drawn_back ? Vector3(-course) : course);
  if (body.finite != nullptr) {
    meeting.patch = body.finite->edge_patch(contacts, half_width_, flanks);
    return meeting;
  }
  const solvers::Field base = without_lips(body, !meeting.held.empty());
  std::vector<solvers::LipPair> pairs;
  std::vector<char> used(body.pairs.size(), 0);
  for (std::size_t p = 0; known != nullptr && p < body.pairs.size(); ++p)
    if (std::any_of(known->pairs.begin(), known->pairs.end(),
                    [&](const solvers::LipPair& pair) { return pair.plus == body.pairs[p].plus; })) {
      used[p] = 1;
      pairs.push_back(body.pairs[p]);
    }
  for (int round = 0; round < 3; ++round) { // pairs that the blade would press through one another, and no others
    meeting.patch = solvers::condense_blade(*body.body, base, contacts, half_width_, pairs, flanks, known,
                                            meeting.held.empty() ? nullptr : &body.patch);
    known = &meeting.patch;
    if (lips_ == solvers::LipCondition::open || body.pairs.empty())
      break;
    const solvers::BladeState state = solvers::push_blade(meeting.patch, advances(meeting, body, poses.back()));
    const VectorX open = openings(body, solvers::deform(meeting.patch, state, base));
    const std::size_t before = pairs.size();
    for (std::size_t p = 0; p < body.pairs.size(); ++p)
      if (open[static_cast<Eigen::Index>(p)] < -opening_tolerance && used[p] == 0) {
        used[p] = 1;
        pairs.push_back(body.pairs[p]);
      }
    if (pairs.size() == before)
      break;
  }
  return meeting;
}

// Faces of the cut near the edge, behind it, against a motion along `way`.
solvers::ForcePattern BladeEdge::drag(const BodyModel& body, const std::vector<solvers::EdgeContact>& contacts,
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

VectorX BladeEdge::motions(const EdgeMeeting& meeting, const topology::BladePose& pose) const {
  VectorX result(std::ssize(meeting.pieces));
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    const solvers::EdgeContact& contact = meeting.patch.contacts[static_cast<std::size_t>(c)];
    const Vector3 x =
        placed(pose, pieces_[static_cast<std::size_t>(meeting.pieces[static_cast<std::size_t>(c)])].point);
    result[c] = contact.push.dot(x - contact.point);
  }
  return result;
}

// How far a piece of the edge at x may push before tissue slips off it, m. A piece that goes out of the body sideways,
// or back through the cut, has less and less of it; one that goes out straight ahead has the tissue there before it
// still, and pushes that out.
double BladeEdge::reach(const EdgeMeeting& meeting, Eigen::Index contact, const BodyModel& body,
                        const topology::RestMap& to_rest, const Vector3& x) const {
  const solvers::EdgeContact& there = meeting.patch.contacts[static_cast<std::size_t>(contact)];
  double depth = -signed_distance(*domain_, to_rest, x); // m
  bool is_cut_ahead = false;
  if (body.incision != nullptr)
    if (const auto on =
            body.incision->closest(there.point + 0.5 * spacing_ * at_rest(body, there), in_sheet * spacing_))
      is_cut_ahead = !on->on_border;
  if (!is_cut_ahead)
    depth = std::max(depth, -domain_->signed_distance(x - (there.push.dot(x - there.point) + spacing_) * there.push));
  return meeting.patch.free[contact] + depth_factor * std::max(0.0, depth);
}

VectorX BladeEdge::advances(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& pose) const {
  const topology::RestMap to_rest = map_of_(body);
  VectorX result = motions(meeting, pose);
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    const int piece = meeting.pieces[static_cast<std::size_t>(c)];
    result[c] = std::min(
        result[c], reach(meeting, c, body, to_rest, placed(pose, pieces_[static_cast<std::size_t>(piece)].point)));
  }
  return result;
}

bool BladeEdge::pushes(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& pose) const {
  const topology::RestMap to_rest = map_of_(body);
  const VectorX motion = motions(meeting, pose);
  for (Eigen::Index c = 0; c < motion.size(); ++c) {
    const int piece = meeting.pieces[static_cast<std::size_t>(c)];
    const Vector3 x = placed(pose, pieces_[static_cast<std::size_t>(piece)].point);
    if (motion[c] > meeting.patch.free[c] && motion[c] < reach(meeting, c, body, to_rest, x))
      return true;
  }
  return false;
}

bool BladeEdge::leaves_bridge(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& end,
                              double cut) const {
  const topology::RestMap to_rest = map_of_(body);
  for (std::size_t c = 0; c < meeting.pieces.size(); ++c) {
    const solvers::EdgeContact& contact = meeting.patch.contacts[c];
    const Vector3 x = place(end, meeting.pieces[c]);
    if (signed_distance(*domain_, to_rest, x) < 0 || domain_->signed_distance(x) < 0 ||
        domain_->signed_distance(contact.point + (cut + spacing_) * contact.push) < 0)
      return false;
  }
  return true;
}

// Ahead of its contact where it pressed; else, in a motion that came from outside, whatever lies between.
double BladeEdge::passed_uncut(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& from,
                               const topology::BladePose& to) const {
  const topology::RestMap to_rest = map_of_(body);
  double most = 0;
  const auto length_inside = [&](int parts, double part, const auto& place) {
    int inside = 0;
    for (int k = 0; k < parts; ++k)
      inside += domain_->signed_distance(place((k + 0.5) / parts)) < 0 ? 1 : 0;
    most = std::max(most, inside * part);
  };
  for (int piece = 0; piece < std::ssize(pieces_); ++piece) {
    const Vector3& point = pieces_[static_cast<std::size_t>(piece)].point;
    const Vector3 start = placed(from, point), end = placed(to, point), motion = end - start;
    const auto met = std::find(meeting.pieces.begin(), meeting.pieces.end(), piece);
    if (met != meeting.pieces.end()) {
      const solvers::EdgeContact& contact =
          meeting.patch.contacts[static_cast<std::size_t>(met - meeting.pieces.begin())];
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

// The same everywhere without layers.
double BladeEdge::toughness(const EdgeMeeting& meeting) const {
  double sum = 0, length = 0;
  for (const solvers::EdgeContact& contact : meeting.patch.contacts) {
    sum += contact.length * toughness_(contact.point + 0.5 * half_width_ * contact.push);
    length += contact.length;
  }
  return length > 0 ? sum / length : 0;
}

double BladeEdge::needed(const EdgeMeeting& meeting, double paid) const {
  const double all = toughness(meeting);
  return std::max(least_needed * all, all - paid) / settings_.sharpness;
}

} // namespace spherecut::app
