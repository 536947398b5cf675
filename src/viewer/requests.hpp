// JSON messages of viewers, as docs/viewer_protocol.md has them, read into structs.
#pragma once

#include "src/viewer/wire.hpp"

namespace spherecut::app {

inline constexpr int most_credit = 8; // frames on their way to a client

enum class RequestType {
  hello,
  credit,
  take,
  release,
  mode,
  pose,
  park,
  second,
  grip,
  reset,
  scenario,
  set,
  overlays,
  record,
  replay,
};
std::string_view to_string(RequestType type);
/// Whether only the client that holds the tool may ask for it.
bool needs_tool(RequestType type);

/// What a viewer wants changed; empty: as it is.
struct SettingsChange {
  std::optional<double> young_modulus, poisson_ratio, toughness; // Pa, 1, J/m2
  std::optional<double> fine_spacing, coarse_spacing;            // m
  std::optional<solvers::Method> method;
  std::optional<solvers::SightRule> sight;
};

struct OverlaysChange {
  std::optional<Overlays::Colour> colour;
  std::optional<bool> nodes, stages;
  std::optional<std::optional<ViewerRequest::Pick>> pick;
  std::optional<std::optional<ViewerRequest::Slice>> slice;
};

/// One message; the fields of its type count.
struct Request {
  RequestType type = RequestType::hello;
  int number = 0;                                  // hello: version; credit: frames
  std::uint32_t pose = 0;                          // pose: n
  Vector3 position = Vector3::Zero();              // pose, m
  std::optional<Eigen::Quaterniond> orientation{}; // pose, unit
  HandMode mode = HandMode::probe;
  WhichHand hand = WhichHand::first; // pose, park
  bool on = false;                   // record, grip, second
  std::optional<std::string> name{}; // scenario; replay: empty ends it
  SettingsChange settings{};
  OverlaysChange overlays{};
};

/// Throws InputError, in words for the reason of a close, when the text is not such a message.
Request parse_request(std::string_view text);

/// The scenario with the change. Throws InputError with the key, the value and what is allowed.
void apply(const SettingsChange& change, Scenario& scenario);

} // namespace spherecut::app
