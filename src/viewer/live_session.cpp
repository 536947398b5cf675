#include "src/viewer/live_session.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <limits>
#include <system_error>
#include <utility>

namespace spherecut::app {
namespace {

constexpr int niceness = 5; // the viewer that draws beside the solver goes before it

/// `pointer` null: a replay, whose hand is where the tool was.
LiveHand where(const DeviceState& device, PointerHand* pointer) {
  if (pointer == nullptr)
    return {device.position, 0};
  const PointerHandState& state = pointer->state();
  return {state.hand, state.number};
}

} // namespace

LiveSession::LiveSession(Scenario scenario, const LiveOptions& options, std::function<void(const std::string&)> say)
    : scenario_(std::move(scenario)), simulation_(std::make_unique<HapticSimulation>(scenario_, std::move(say))) {
  const Session& session = simulation_->session();
  domain_ = session.organ().domain;
  nodes_ = session.model().sprinkling.nodes.size();
  fine_ = session.zone().spacing.fine;
  coarse_ = session.zone().spacing.coarse;
  if (nodes_ > most_live_nodes)
    throw InputError(
        fmt::format("{} nodes; a live session takes at most {}: give a coarser spacing", nodes_, most_live_nodes));
  places_ = std::make_unique<const ToolPlaces>(scenario_, session);
  const HapticSettings& settings = scenario_.haptics;
  if (options.replay != nullptr) {
    device_ = std::make_unique<RecordedMotion>(*options.replay, settings.rate);
    if (options.replay->two_hands) {
      simulation_->require_two_hands();
      second_device_ = std::make_unique<RecordedMotion>(*options.replay, settings.rate, WhichHand::second);
    }
  } else {
    auto hand = std::make_unique<PointerHand>(settings.hand, settings.rate, options.speed,
                                              places_->parked(places_->modes().front()));
    hand_ = hand.get();
    device_ = std::move(hand);
    if (takes_two_hands()) {
      auto second = std::make_unique<PointerHand>(settings.hand, settings.rate, options.speed, PointerTarget{});
      second_ = second.get();
      second_device_ = std::move(second);
    }
  }
  feed_ = std::make_unique<ViewerFeed>(settings.viewer_rate);
  simulation_->prepare(device_->read(0));
  if (!options.record.empty())
    recorder_.begin(options.record, recording_header(scenario_, domain_->surface()));
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
    failures_.add(fmt::format("the loop cannot begin, no thread can be made: {}", error.what()));
    failing_ = true;
  }
}

void LiveSession::run() {
  RealtimeOptions options;
  options.keep = false;
  options.solve_at_rest = false;
  options.follow_in_background = true;
  options.niceness = niceness;
  // Between solves the tangent force is that of the body all the same; more of them than pictures are of no use, and
  // the viewer may need the processor.
  if (scenario_.haptics.model == ForceModelKind::tangent)
    options.most_solves = scenario_.haptics.viewer_rate;
  options.feed = feed_.get();
  options.second = second_device_.get();
  options.stop = [this] { return stop_.load(); };
  options.on_tick = [this](const TickRecord& record) { note(record); };
  options.on_solve = [this](const SolveRecord& record) { note(record); };
  RealtimeReport report;
  try {
    static_cast<void>(run_realtime(scenario_.haptics, *simulation_, *device_, std::numeric_limits<double>::infinity(),
                                   options, report));
  } catch (const std::exception& error) {
    failures_.add(fmt::format("the loop has ended: {}", error.what()));
    failing_ = true;
  }
  recorder_.end(report.lost);
}

void LiveSession::aim(const PointerTarget& target, WhichHand hand) {
  PointerHand* const pointer = hand == WhichHand::first ? hand_ : second_;
  if (pointer != nullptr)
    pointer->aim(target);
}

void LiveSession::note(const TickRecord& record) {
  recorder_.add(record);
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
  recorder_.add(record);
  failing_ = record.failed;
  if (record.failed) {
    failures_.add_once(record.reason);
    return;
  }
  if (record.cut_triangles > 0)
    ++cuts_;
  ++solves_;
}

const LiveTick& LiveSession::tick() {
  if (!ticks_.fetch())
    return newest_;
  newest_ = ticks_.front();
  newest_.hand = where(newest_.record.device, hand_);
  const ToolPlaces::Touch touch = places_->touch(simulation_->tool(), newest_.record.device);
  newest_.contact = touch.contact;
  newest_.axis = touch.axis;
  newest_.record.depth = touch.depth.value_or(newest_.record.depth);
  if (const auto& second = newest_.record.second) {
    newest_.second_hand = where(second->device, second_);
    newest_.second_depth = places_->touch(simulation_->tool(), second->device).depth.value_or(0);
  }
  return newest_;
}

} // namespace spherecut::app
