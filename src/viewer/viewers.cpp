#include "src/viewer/viewers.hpp"

#include <utility>

namespace spherecut::app {
namespace {

double seconds_since(ViewerState::Clock::time_point then) {
  return std::chrono::duration<double>(ViewerState::Clock::now() - then).count();
}

} // namespace

ViewerState* Viewers::find(int id) {
  const auto found = viewers_.find(id);
  return found == viewers_.end() ? nullptr : &found->second;
}

std::vector<int> Viewers::ids() const {
  std::vector<int> ids;
  ids.reserve(viewers_.size());
  for (const auto& [id, viewer] : viewers_)
    ids.push_back(id);
  return ids;
}

void Viewers::send_all(const std::string& text) {
  std::vector<int> greeted;
  for (const auto& [id, viewer] : viewers_)
    if (viewer.greeted)
      greeted.push_back(id);
  for (const int id : greeted)
    send(id, text);
}

void Viewers::close_silent(double patience) {
  std::vector<int> silent;
  for (const auto& [id, viewer] : viewers_)
    if (!viewer.greeted && seconds_since(viewer.since) > patience)
      silent.push_back(id);
  for (const int id : silent)
    server_->close(id, {CloseCode::policy, "hello did not come"});
}

void Viewers::change_overlays(int id, const OverlaysChange& change) {
  Overlays& overlays = viewers_.at(id).overlays;
  if (change.colour)
    overlays.colour = *change.colour;
  if (change.nodes)
    overlays.nodes = *change.nodes;
  if (change.stages)
    overlays.stages = *change.stages;
  if (change.pick)
    overlays.pick = *change.pick;
  if (change.slice)
    overlays.slice = *change.slice;
  if (overlays.pick)
    overlays.pick->key = id;
  if (overlays.slice)
    overlays.slice->key = id;
}

ViewerRequest Viewers::wanted() const {
  ViewerRequest request;
  for (const auto& [id, viewer] : viewers_) {
    const Overlays& overlays = viewer.overlays;
    request.displacement = request.displacement || overlays.colour == Overlays::Colour::displacement;
    request.von_mises = request.von_mises || overlays.colour == Overlays::Colour::von_mises;
    request.nodes = request.nodes || overlays.nodes;
    if (overlays.pick)
      request.picks.push_back(*overlays.pick);
    if (overlays.slice)
      request.slices.push_back(*overlays.slice);
  }
  return request;
}

void Viewers::send_frames(const ViewerFrame& frame, const LiveTick& tick, std::uint32_t epoch,
                          const CommonContext& context) {
  for (const int id : ids()) {
    ViewerState* viewer = find(id);
    if (viewer == nullptr || !viewer->greeted)
      continue;
    const bool picture = viewer->picture != frame.number || viewer->epoch != epoch;
    const bool due = seconds_since(viewer->last_frame) >= 1 / frame_rate_;
    if (server_->waiting(id) > 0 || viewer->credit == 0) {
      if (picture && viewer->picture != 0 && std::exchange(viewer->missed, frame.number) != frame.number)
        ++viewer->left_out;
    } else if (due && (picture || viewer->tick != tick.record.device.tick)) {
      send_frame(id, *viewer, frame, tick, context(), picture);
    }
  }
}

void Viewers::send_frame(int id, ViewerState& viewer, const ViewerFrame& frame, const LiveTick& tick,
                         FrameContext context, bool picture) {
  if (viewer.topology != frame.topology->number || viewer.epoch != context.epoch) {
    viewer.topology = frame.topology->number;
    server_->send_binary(id, encode_topology(*frame.topology, viewer.version, ++viewer.messages, context.epoch));
  }
  viewer.epoch = context.epoch;
  viewer.picture = frame.number;
  viewer.tick = tick.record.device.tick;
  viewer.last_frame = ViewerState::Clock::now();
  --viewer.credit;
  context.version = viewer.version;
  context.message = ++viewer.messages;
  context.left_out = viewer.left_out;
  const Overlays overlays = viewer.overlays;
  server_->send_binary(id, encode_frame(frame, tick, context, overlays, id, picture));
}

} // namespace spherecut::app
