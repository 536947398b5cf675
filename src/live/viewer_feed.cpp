#include "src/live/viewer_feed.hpp"

#include "src/live/shown_opening.hpp"

#include "src/output/cut_output.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spherecut::app {
namespace {

constexpr double share = 0.2; // of the simulation thread's time that frames may take

double seconds_between(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

/// u_h of every node of a body that is solved, m.
std::vector<Vector3> deformed_nodes(const BodyModel& model) {
  std::vector<Vector3> places = model.nodes().positions;
  if (model.solved()) {
    const VectorX displacements = model.nodal_displacements();
    for (std::size_t i = 0; i < places.size(); ++i)
      places[i] += displacements.segment<3>(3 * static_cast<Eigen::Index>(i));
  }
  return places;
}

/// Radius of a node's sphere; of a place without a sphere (on the face of a cut) that of the nearest sphere, m.
double reach_of(int node, const BodyModel& body) {
  if (const double radius = body.sphere_radius(node); radius > 0)
    return radius;
  const std::vector<Vector3>& rest = body.nodes().positions;
  const Vector3& centre = rest[static_cast<std::size_t>(node)];
  double least = std::numeric_limits<double>::infinity(), reach = 0;
  for (int other = 0; other < static_cast<int>(rest.size()); ++other)
    if (const double distance = (rest[static_cast<std::size_t>(other)] - centre).squaredNorm();
        distance < least && body.sphere_radius(other) > 0) {
      least = distance;
      reach = body.sphere_radius(other);
    }
  return reach;
}

PickedNode picked(const ViewerRequest::Pick& pick, const BodyModel& model, const std::vector<Vector3>& deformed) {
  PickedNode result;
  result.key = pick.key;
  if (pick.node >= 0) {
    result.node = std::min(pick.node, static_cast<int>(deformed.size()) - 1);
  } else {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < deformed.size(); ++i)
      if (const double distance = (deformed[i] - pick.place).squaredNorm(); distance < least) {
        least = distance;
        result.node = static_cast<int>(i);
      }
  }
  const std::vector<Vector3>& rest = model.nodes().positions;
  const Vector3& centre = rest[static_cast<std::size_t>(result.node)];
  result.position = deformed[static_cast<std::size_t>(result.node)];
  result.radius = reach_of(result.node, model);
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const int node = static_cast<int>(i);
    if (node == result.node || (rest[i] - centre).norm() >= result.radius || model.sphere_radius(node) <= 0)
      continue;
    const bool hidden = model.incision != nullptr && model.incision->blocks(centre, rest[i]);
    (hidden ? result.hidden : result.seen).push_back(node);
  }
  return result;
}

FieldSlice sliced(const ViewerRequest::Slice& slice, const Session& session) {
  FieldSlice result;
  result.key = slice.key;
  result.count = std::clamp(slice.count, 2, 256);
  const Vector3 normal = slice.normal.normalized();
  const Vector3 side = std::abs(normal.z()) > 0.9 ? Vector3::UnitX() : Vector3::UnitZ();
  result.along = slice.size * side.cross(normal).normalized();
  result.up = normal.cross(result.along);
  result.corner = slice.point - 0.5 * (result.along + result.up);
  const topology::Domain& domain = *session.organ().domain;
  const double reach = 0.5 * slice.size;
  for (int row = 0; row < result.count; ++row)
    for (int column = 0; column < result.count; ++column) {
      const Vector3 x = result.corner + static_cast<double>(column) / (result.count - 1) * result.along +
                        static_cast<double>(row) / (result.count - 1) * result.up;
      result.organ.push_back(static_cast<float>(domain.signed_distance(x)));
      const auto on = session.model().incision != nullptr ? session.model().incision->closest(x, reach) : std::nullopt;
      result.cut.push_back(on ? static_cast<float>(on->distance) : 1.0F);
    }
  return result;
}

} // namespace

void ViewerFeed::request(ViewerRequest request) {
  const std::lock_guard lock(request_mutex_);
  wanted_ = std::move(request);
  newly_wanted_ = true;
}

void ViewerFeed::offer(const HapticSimulation& simulation, const SolveRecord& solve) {
  const StepResult& result = simulation.result();
  last_.solve = solve.event.sequence;
  last_.pose_tick = solve.event.pose_tick;
  last_.time = result.time;
  last_.tool = result.pose;
  last_.force = solve.force;
  last_.contact_radius = result.contact_radius;
  last_.nodes = solve.nodes;
  last_.active = result.active_nodes;
  last_.degradation = solve.event.degradation;
  if (result.cut) {
    last_.cut_area = result.cut->area;
    last_.front_length = result.cut->front_length;
  }
  last_.tear = tear_status(result, last_.tear);
  last_.solve_seconds = solve.seconds;
  pending_ = true;
  offer_again(simulation);
}

void ViewerFeed::offer_again(const HapticSimulation& simulation) {
  if (rate_ <= 0)
    return;
  {
    const std::lock_guard lock(request_mutex_);
    if (newly_wanted_) {
      request_ = wanted_;
      newly_wanted_ = false;
      pending_ = true;
    }
  }
  const Clock::time_point now = Clock::now();
  if (!pending_ || buffer_.waiting() || (number_ > 0 && seconds_between(made_, now) < 1 / rate_) ||
      seconds_ > share * seconds_between(start_, now))
    return;
  make(simulation);
  pending_ = false;
  made_ = now;
  seconds_ += seconds_between(now, Clock::now());
}

void ViewerFeed::make(const HapticSimulation& simulation) {
  const Session& session = simulation.session();
  follower_.follow(session);
  ViewerFrame& frame = buffer_.back();
  std::vector<Eigen::Vector3f> vertices = std::move(frame.vertices); // its memory
  frame = last_;
  frame.vertices = std::move(vertices);
  frame.number = ++number_;
  frame.topology = follower_.topology();
  follower_.deform(session, frame.vertices);
  const ShownOpening open = shown_opening(*frame.topology, frame.vertices);
  frame.opening = open.largest;
  frame.opening_volume = open.volume;
  float largest = 0;
  for (std::size_t v = 0; v < frame.vertices.size(); ++v)
    largest = std::max(largest, (frame.vertices[v] - frame.topology->vertices[v]).squaredNorm());
  frame.largest_displacement = std::sqrt(static_cast<double>(largest));
  frame.profile = session.profile();
  frame.picture_seconds = seconds_;
  add_extras(simulation, frame);
  buffer_.publish();
}

void ViewerFeed::add_extras(const HapticSimulation& simulation, ViewerFrame& frame) {
  const Session& session = simulation.session();
  const BodyModel& model = session.model();
  if (request_.displacement)
    for (std::size_t v = 0; v < frame.vertices.size(); ++v)
      frame.displacement.push_back((frame.vertices[v] - frame.topology->vertices[v]).norm());
  for (const ViewerRequest::Slice& slice : request_.slices)
    frame.slices.push_back(sliced(slice, session));
  if (!model.built()) {
    if (request_.von_mises)
      frame.von_mises.assign(frame.vertices.size(), 0);
    return;
  }
  const solvers::NodeCloud& nodes = model.nodes();
  if (request_.von_mises) {
    std::vector<double> nodal;
    nodal.reserve(nodes.positions.size());
    for (const Vector3& x : nodes.positions)
      nodal.push_back(von_mises(session.model().at(x).stress));
    follower_.spread(nodal, frame.von_mises);
  }
  if (!request_.nodes && request_.picks.empty())
    return;
  const std::vector<Vector3> deformed = deformed_nodes(model);
  if (request_.nodes)
    for (std::size_t i = 0; i < deformed.size(); ++i)
      frame.node_list.push_back(
          {deformed[i].cast<float>(), static_cast<float>(model.sphere_radius(static_cast<int>(i))), nodes.kinds[i]});
  for (const ViewerRequest::Pick& pick : request_.picks)
    frame.picks.push_back(picked(pick, model, deformed));
}

} // namespace spherecut::app
