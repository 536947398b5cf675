// What a blade tells: the field of the body under it, its force, and how that goes on.
#include "src/blade/force.hpp"

#include "src/model/finite_model.hpp"

#include <algorithm>

namespace spherecut::app {
namespace {

constexpr double probe_share = 0.05; // of the half width: a step along the way for the stiffness
constexpr double due_reach = 3;      // node spacings ahead in which the next cut is looked for

/// About the origin of the blade's frame where the blade is; it must be in the body.
solvers::BladeTorque torque_of(const BladeEdge& edge, const EdgeMeeting& meeting, const solvers::BladeState& state,
                               const topology::BladePose& at) {
  std::vector<Vector3> places;
  for (const int piece : meeting.pieces)
    places.push_back(edge.place(at, piece));
  return solvers::blade_torque(meeting.patch, state, places, at.position);
}

} // namespace

BladeReport report_of(const EdgeMeeting& meeting, const solvers::BladeState& state) {
  BladeReport report;
  report.force = state.blade_force;
  report.edge_force = state.edge_force.norm();
  report.converged = state.converged;
  double force = 0, length = 0;
  for (std::size_t c = 0; c < meeting.pieces.size(); ++c) {
    const auto entry = static_cast<Eigen::Index>(c);
    if (!(state.forces[entry] > 0))
      continue;
    ++report.contacts;
    force += state.forces[entry];
    length += meeting.patch.contacts[c].length;
    report.advance = std::max(report.advance, state.advance[entry] - meeting.patch.free[entry]);
  }
  if (length > 0)
    report.release = force / length;
  return report;
}

bool first_cut(const EdgeMeeting& meeting, const solvers::BladeState& state) {
  double surface = 0, all = 0;
  for (std::size_t c = 0; c < meeting.pieces.size(); ++c) {
    const double force = state.forces[static_cast<Eigen::Index>(c)];
    all += force;
    surface += meeting.stands[c] == EdgeStand::surface ? force : 0;
  }
  return surface > 0.5 * all;
}

solvers::Field BladeForce::field(const BodyModel& body) const {
  if (!state_)
    return body.field;
  if (body.finite == nullptr)
    return solvers::deform(meeting_.patch, *state_, without_lips(body, !meeting_.held.empty()));
  solvers::Field field = body.field;
  field.coefficients = body.finite->pressed_coefficients();
  return field;
}

bool BladeForce::is_gripped_as(const BodyModel& body) const {
  const bool grips = edge_.grasps() && body.finite == nullptr && body.state && !body.patch.nodes.empty();
  return grips ? meeting_.held == body.patch.nodes && meeting_.grip == body.state->tool.displacement
               : meeting_.held.empty();
}

VectorX BladeForce::on_held() const {
  return state_ && meeting_.patch.held_forces.size() > 0
             ? VectorX(meeting_.held_base + meeting_.patch.held_forces * state_->forces)
             : VectorX{};
}

BladeReport BladeForce::report() const {
  if (!state_)
    return BladeReport{.ledger = ledger_};
  BladeReport report = report_of(meeting_, *state_);
  report.ledger = ledger_;
  report.torque = torque_of(edge_, meeting_, *state_, way_.at()).blade;
  return report;
}

// Stiffness and the force at which the next cut is due come from the blade moved on along the way of its edge.
BladeGrip BladeForce::grip(const BodyModel& now) const {
  BladeGrip grip;
  grip.work = ledger_.work;
  grip.surface = ledger_.surface;
  if (!state_)
    return grip;
  const BladeReport here = report_of(meeting_, *state_);
  Vector3 way = Vector3::Zero(), turn = Vector3::Zero();
  for (std::size_t c = 0; c < meeting_.pieces.size(); ++c) {
    const solvers::EdgeContact& contact = meeting_.patch.contacts[c];
    way += contact.length * contact.push;
    const Vector3& point = edge_.pieces()[static_cast<std::size_t>(meeting_.pieces[c])].point;
    turn += contact.length * (way_.at().orientation * point).cross(contact.push);
  }
  if (!(way.norm() > 0)) // pieces that are driven apart
    return grip;
  grip.along = here.edge_force > 0 ? Vector3(-state_->edge_force / here.edge_force) : way.normalized();
  const solvers::BladeTorque torque = torque_of(edge_, meeting_, *state_, way_.at());
  grip.arm = here.edge_force > 0 ? Vector3(-torque.edge / here.edge_force) : Vector3(turn / way.norm());
  grip.contacts = static_cast<int>(meeting_.pieces.size());
  grip.places = std::min(grip.contacts, BladeGrip::most_places);
  for (int k = 0; k < grip.places; ++k) { // from the first to the last
    const int c = grip.places > 1 ? k * (grip.contacts - 1) / (grip.places - 1) : 0;
    const Vector3& point = edge_.pieces()[static_cast<std::size_t>(meeting_.pieces[static_cast<std::size_t>(c)])].point;
    grip.place[static_cast<std::size_t>(k)] = way_.target().orientation * point;
  }
  grip.force = state_->blade_force;
  grip.torque = torque.blade;
  grip.edge = here.edge_force;
  grip.drag = (meeting_.drawn_back ? -1.0 : 1.0) * (state_->blade_force - state_->edge_force);
  grip.drag_torque = (meeting_.drawn_back ? -1.0 : 1.0) * (torque.blade - torque.edge);
  grip.stored = state_->stored;
  grip.release = here.release;
  const double friction = meeting_.patch.dragged ? 1 : 0;
  const auto onward = [&](const EdgeMeeting& meeting, const VectorX& from, double distance) {
    VectorX to = from;
    for (Eigen::Index c = 0; c < to.size(); ++c)
      to[c] += distance * meeting.patch.contacts[static_cast<std::size_t>(c)].push.dot(grip.along);
    return to;
  };
  const double probe = probe_share * edge_.half_width();
  const auto edge_after = [&](double distance) {
    return solvers::push_blade(meeting_.patch, onward(meeting_, state_->advance, distance), friction).edge_force;
  };
  grip.stiffness = std::max(0.0, (-edge_after(probe).dot(grip.along) - grip.edge) / probe);
  if (proposal_ && !proposal_->meeting.pieces.empty()) {
    const double reach = due_reach * edge_.spacing();
    const VectorX coming = edge_.advances(proposal_->meeting, proposal_->body, way_.at());
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
    if (now.incision != nullptr && !first_cut(meeting_, *state_))
      grip.due = std::max(grip.edge, least);
    else
      grip.due = grip.edge > (1 + same_pose) * first_wait * least ? 2 * grip.edge : first_wait * least;
  }
  return grip;
}

} // namespace spherecut::app
