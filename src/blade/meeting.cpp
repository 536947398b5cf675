// Where the edge of a blade meets the body: contacts, lips beside it, drag of its flanks, how far it pushes.
#include "src/blade/meeting.hpp"

#include "src/scenario/schedule.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double depth_factor = 2; // of its depth in the body: how far a piece of the edge may push
constexpr double ahead = 0.1;      // of the half width: less material than that before a piece of the edge is none
constexpr int entry_steps = 12;    // halvings towards the place where the edge entered
constexpr double opening_tolerance = 1e-6; // m
constexpr double same_contact = 1e-4;      // of the node spacing, and of one: what has not moved
constexpr double in_sheet = 0.1;           // node spacings from a sheet: a place there is in it
constexpr double least_motion = 1e-3;      // of the node spacing, that tells a direction

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

} // namespace

double signed_distance(const topology::Domain& domain, const topology::RestMap& to_rest, const Vector3& x) {
  try {
    return domain.signed_distance(to_rest(x));
  } catch (const NumericalError&) {
    return domain.signed_distance(x);
  }
}

solvers::Field without_lips(const BodyModel& body) {
  const bool tool = body.state && !body.patch.nodes.empty();
  return tool ? solvers::deform(*body.body, body.patch, body.state->tool) : body.base;
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
  if (domain_->signed_distance(contact.point + ahead * half_width_ * contact.push) > 0)
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

// Of each piece of the edge that meets something, past its contact's rest position, m.
VectorX BladeForce::motions(const Meeting& meeting, const topology::BladePose& pose) const {
  VectorX result(std::ssize(meeting.pieces));
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    const solvers::EdgeContact& contact = meeting.patch.contacts[static_cast<std::size_t>(c)];
    const Vector3 x = placed(pose, edge_[static_cast<std::size_t>(meeting.pieces[static_cast<std::size_t>(c)])].point);
    result[c] = contact.push.dot(x - contact.point);
  }
  return result;
}

// How far a piece of the edge at x may push before tissue slips off it, m. A piece that goes out of the body sideways,
// or back through the cut, has less and less of it; one that goes out straight ahead has the tissue there before it
// still, and pushes that out.
double BladeForce::reach(const Meeting& meeting, Eigen::Index contact, const BodyModel& body,
                         const topology::RestMap& to_rest, const Vector3& x) const {
  const solvers::EdgeContact& there = meeting.patch.contacts[static_cast<std::size_t>(contact)];
  double depth = -signed_distance(*domain_, to_rest, x); // m
  bool is_cut_ahead = false;
  if (body.incision != nullptr)
    if (const auto on = body.incision->closest(there.point + 0.5 * spacing_ * there.push, in_sheet * spacing_))
      is_cut_ahead = !on->on_border;
  if (!is_cut_ahead)
    depth = std::max(depth, -domain_->signed_distance(x - (there.push.dot(x - there.point) + spacing_) * there.push));
  return meeting.patch.base[contact] + depth_factor * std::max(0.0, depth);
}

VectorX BladeForce::advances(const Meeting& meeting, const BodyModel& body, const topology::BladePose& pose) const {
  const topology::RestMap to_rest = map_of_(body);
  VectorX result = motions(meeting, pose);
  for (Eigen::Index c = 0; c < result.size(); ++c) {
    const int piece = meeting.pieces[static_cast<std::size_t>(c)];
    result[c] = std::min(result[c],
                         reach(meeting, c, body, to_rest, placed(pose, edge_[static_cast<std::size_t>(piece)].point)));
  }
  return result;
}

bool BladeForce::meets(const topology::BladePose& pose, const BodyModel& body) const {
  if (inside(pose, body))
    return true;
  if (!state_)
    return false;
  const topology::RestMap to_rest = map_of_(body);
  const VectorX motion = motions(meeting_, pose);
  for (Eigen::Index c = 0; c < motion.size(); ++c) {
    const int piece = meeting_.pieces[static_cast<std::size_t>(c)];
    const Vector3 x = placed(pose, edge_[static_cast<std::size_t>(piece)].point);
    if (motion[c] > meeting_.patch.base[c] && motion[c] < reach(meeting_, c, body, to_rest, x))
      return true;
  }
  return false;
}

// Whether a cut by `cut` m from the front on leaves less than a node spacing of tissue, which the nodes cannot tell of,
// before an edge that will have gone through all of it.
bool BladeForce::leaves_bridge(const BodyModel& now, std::size_t last, double cut) const {
  const topology::RestMap to_rest = map_of_(now);
  for (std::size_t c = 0; c < meeting_.pieces.size(); ++c) {
    const solvers::EdgeContact& contact = meeting_.patch.contacts[c];
    const Vector3 end = placed(way_[last], edge_[static_cast<std::size_t>(meeting_.pieces[c])].point);
    if (signed_distance(*domain_, to_rest, end) < 0 || domain_->signed_distance(end) < 0 ||
        domain_->signed_distance(contact.point + (cut + spacing_) * contact.push) < 0)
      return false;
  }
  return true;
}

} // namespace spherecut::app
