#include "src/viewer/live_session.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <system_error>
#include <utility>

namespace spherecut::app {
namespace {

constexpr std::uint64_t recording_flush_ticks = 256;     // between two writes of a recording
constexpr std::uint64_t most_recorded_ticks = 3'600'000; // an hour: then it ends
constexpr int solver_niceness = 5;                       // the viewer that draws beside the solver goes before it
constexpr double parking = 0.15;                         // of the organ's diagonal, beyond where the tool starts

PathPose start_of(const std::vector<StepSample>& steps, bool blade) {
  for (const StepSample& sample : steps)
    if (blade && sample.blade)
      return {0, sample.blade->position, sample.blade->orientation};
    else if (!blade && sample.tool)
      return {0, sample.tool->point, Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), sample.tool->axis)};
  return {};
}

} // namespace

LiveSession::LiveSession(Scenario scenario, const LiveOptions& options, std::function<void(const std::string&)> say)
    : scenario_(std::move(scenario)), simulation_(std::make_unique<HapticSimulation>(scenario_, std::move(say))),
      record_(options.record) {
  const Session& session = simulation_->session();
  domain_ = session.organ().domain;
  nodes_ = session.model().sprinkling.nodes.size();
  fine_ = session.zone().spacing.fine;
  coarse_ = session.zone().spacing.coarse;
  if (nodes_ > most_live_nodes)
    throw InputError(
        fmt::format("{} nodes; a live session takes at most {}: give a coarser spacing", nodes_, most_live_nodes));
  if (scenario_.tool)
    tool_start_ = start_of(session.steps(), false);
  if (scenario_.blade)
    blade_start_ = start_of(session.steps(), true);
  query_ = std::make_unique<topology::ContactQuery>(domain_->surface());
  const HapticSettings& settings = scenario_.haptics;
  if (options.replay != nullptr) {
    device_ = std::make_unique<RecordedMotion>(*options.replay, settings.rate);
  } else {
    auto hand = std::make_unique<PointerHand>(settings.hand, settings.rate, options.speed, parked(modes().front()));
    hand_ = hand.get();
    device_ = std::move(hand);
  }
  feed_ = std::make_unique<ViewerFeed>(settings.viewer_rate);
  simulation_->prepare(device_->read(0));
  if (!record_.empty()) {
    writer_ = std::make_unique<RecordingWriter>(record_, recording_header(scenario_, domain_->surface()));
    recording_ = true;
  }
}

LiveSession::~LiveSession() {
  stop_ = true;
  if (thread_.joinable())
    thread_.join();
}

void LiveSession::start() {
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error& error) {
    const std::lock_guard lock(failures_mutex_);
    failures_.push_back(fmt::format("the loop cannot begin, no thread can be made: {}", error.what()));
    failing_ = true;
  }
}

void LiveSession::run() {
  RealtimeOptions options;
  options.keep = false;
  options.solve_at_rest = false;
  options.follow_aside = true;
  options.niceness = solver_niceness;
  // Between solves the tangent force is that of the body all the same; more of them than pictures are of no use, and
  // the viewer may need the processor.
  if (scenario_.haptics.model == ForceModelKind::tangent)
    options.most_solves = scenario_.haptics.viewer_rate;
  options.feed = feed_.get();
  options.stop = [this] { return stop_.load(); };
  options.on_tick = [this](const TickRecord& record) { note(record); };
  options.on_solve = [this](const SolveRecord& record) { note(record); };
  RealtimeReport report;
  try {
    static_cast<void>(run_realtime(scenario_.haptics, *simulation_, *device_, std::numeric_limits<double>::infinity(),
                                   options, report));
  } catch (const std::exception& error) {
    const std::lock_guard lock(failures_mutex_);
    failures_.push_back(fmt::format("the loop has ended: {}", error.what()));
    failing_ = true;
  }
  end_recording(report.lost);
}

void LiveSession::aim(const PointerTarget& target) {
  if (hand_ != nullptr)
    hand_->aim(target);
}

// A recording that cannot be written any more ends; the session goes on.
void LiveSession::end_recording(std::uint64_t lost) {
  if (writer_ == nullptr)
    return;
  try {
    writer_->finish(lost);
  } catch (const InputError& error) {
    const std::lock_guard lock(failures_mutex_);
    failures_.push_back(fmt::format("the recording could not be ended: {}", error.what()));
  }
  writer_.reset();
  recording_ = false;
}

void LiveSession::note(const TickRecord& record) {
  if (writer_ != nullptr) {
    const bool full = record.device.tick >= most_recorded_ticks;
    try {
      writer_->add(record);
      if (record.device.tick % recording_flush_ticks == recording_flush_ticks - 1)
        writer_->flush();
    } catch (const InputError& error) {
      const std::lock_guard lock(failures_mutex_);
      failures_.push_back(fmt::format("the recording has ended: {}", error.what()));
      writer_.reset();
      recording_ = false;
    }
    if (full || stop_recording_)
      end_recording(0);
  }
  latency_ = std::max(latency_, record.latency);
  if (record.device.tick % 1000 == 999)
    summed_.worst_latency = std::exchange(latency_, 0.0);
  summed_.record = record;
  summed_.compute += record.compute;
  if (record.latency + record.compute > 1 / scenario_.haptics.rate)
    ++summed_.overruns;
  ticks_.back() = summed_;
  ticks_.publish();
}

void LiveSession::note(const SolveRecord& record) {
  if (writer_ != nullptr)
    writer_->add(record);
  failing_ = record.failed;
  if (record.failed) {
    const std::lock_guard lock(failures_mutex_);
    if (std::exchange(last_failure_, record.reason) != record.reason)
      failures_.push_back(record.reason);
    return;
  }
  if (record.cut_triangles > 0)
    ++cuts_;
  ++solves_;
}

std::vector<std::string> LiveSession::failures() {
  const std::lock_guard lock(failures_mutex_);
  return std::exchange(failures_, {});
}

const LiveTick& LiveSession::tick() {
  if (!ticks_.fetch())
    return newest_;
  newest_ = ticks_.front();
  newest_.hand = newest_.record.device.position;
  newest_.number = 0;
  if (hand_ != nullptr) {
    const PointerHandState& state = hand_->state();
    newest_.hand = state.hand;
    newest_.number = state.number;
  }
  find_contact();
  return newest_;
}

void LiveSession::find_contact() {
  const DeviceState& device = newest_.record.device;
  if (device.mode != static_cast<std::uint16_t>(HandMode::blade)) {
    const topology::ToolPose pose = tool_pose(simulation_->tool(), device);
    newest_.axis = pose.axis;
    newest_.contact = query_->first_touch(simulation_->tool(), pose);
    if (device.mode == static_cast<std::uint16_t>(HandMode::grasper)) // held or not: against the surface at rest
      newest_.record.depth = -domain_->signed_distance(device.position);
    return;
  }
  newest_.axis = device.orientation * Vector3::UnitZ();
  double least = std::numeric_limits<double>::infinity();
  for (const Vector3& x : scenario_.blade->edge) {
    const Vector3 place = device.orientation * x + device.position;
    if (const double distance = domain_->signed_distance(place); distance < least) {
      least = distance;
      newest_.contact.point = domain_->closest_surface_point(place);
    }
  }
  newest_.contact.normal = domain_->normal(newest_.contact.point);
  newest_.record.depth = -least;
}

std::vector<HandMode> LiveSession::modes() const {
  std::vector<HandMode> modes;
  if (scenario_.tool)
    modes.push_back(scenario_.tool->grasp ? HandMode::grasper : HandMode::probe);
  if (scenario_.blade)
    modes.push_back(HandMode::blade);
  return modes;
}

PointerTarget LiveSession::parked(HandMode mode) const {
  const double away = parking * domain_->bounds().extent().norm();
  PointerTarget target;
  target.mode = mode;
  if (mode == HandMode::blade) {
    target.orientation = blade_start_->orientation;
    target.position = blade_start_->position + away * domain_->normal(blade_start_->position);
    return target;
  }
  target.orientation = tool_start_->orientation;
  const topology::ToolPose pose =
      topology::pose_at(scenario_.tool->shape, tool_start_->position, tool_start_->orientation * Vector3::UnitZ());
  target.position = pose.point + away * pose.axis;
  return target;
}

bool LiveSession::clear_of_organ(const PointerTarget& target) const {
  if (target.mode != HandMode::blade) {
    const double radius = topology::tip_radius(scenario_.tool->shape);
    const topology::ToolPose pose =
        tool_pose(scenario_.tool->shape, {0, 0, target.position, target.orientation, true, 0, 0});
    return domain_->signed_distance(pose.point + radius * pose.axis) > radius;
  }
  const std::vector<Vector3>& edge = scenario_.blade->edge;
  return std::all_of(edge.begin(), edge.end(), [&](const Vector3& x) {
    return domain_->signed_distance(target.orientation * x + target.position) > 0;
  });
}

} // namespace spherecut::app
