// Binary messages to the viewers, byte by byte as docs/viewer_protocol.md has them.
#pragma once

#include "src/viewer/live_session.hpp"

#include <string>

namespace spherecut::app {

inline constexpr int protocol_version = 2; // the newest; every one from 1 on is spoken

/// Bits of a frame's state.
enum : std::uint32_t {
  state_contact = 1,
  state_recording = 2,
  state_replay = 4,
  state_held = 8,
  state_cutting = 16,
  state_failed = 32,
  state_building = 64,
  state_limited = 128,
  state_fifo = 256,
};

/// Rates of the last second.
struct LiveRates {
  double ticks = 0, solves = 0, pictures = 0; // per second
  double tick_seconds = 0;                    // processor time of one, mean
};

/// What a frame tells besides picture and tick.
struct FrameContext {
  int version = protocol_version;       // of the client
  std::uint32_t message = 0, epoch = 0; // numbers in the header
  std::uint32_t state = 0;
  std::uint32_t number_in_solve = 0;        // of the viewer's message
  std::uint32_t second_number_in_solve = 0; // likewise, for the second hand
  std::uint32_t left_out = 0;
  LiveRates rates;
};

/// What one client has asked for.
struct Overlays {
  enum class Colour : std::uint8_t { none, displacement, von_mises };
  Colour colour = Colour::none;
  bool nodes = false, stages = false;
  std::optional<ViewerRequest::Pick> pick;
  std::optional<ViewerRequest::Slice> slice;
};

/// `version`: of the client.
std::string encode_topology(const ViewerTopology& topology, int version, std::uint32_t message, std::uint32_t epoch);

/// With the vertices and what goes with them, or with the tool's numbers alone. `client`: key of its picks and slices.
std::string encode_frame(const ViewerFrame& frame, const LiveTick& tick, const FrameContext& context,
                         const Overlays& overlays, int client, bool with_vertices);

} // namespace spherecut::app
