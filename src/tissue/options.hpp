// How a session is run, besides what its scenario says; and by which policy its body follows a blade.
#pragma once

#include "src/scenario/scenario.hpp"

#include <optional>

namespace spherecut::app {

/// Switches of a session. They may change between two steps.
struct SessionOptions {
  /// Steps find contact and force alone and leave out what only output needs, node states, the residual (but where a
  /// cut has appended to the body), the opening volume and the hash of the wound; the rotation of the tissue is then
  /// not watched.
  bool force_only = false;
  /// The last of the steps is not the end, and what is put off there waits for the steps that follow.
  bool going_on = false;
  /// A tear makes one increment a step at most, and goes on in the next: a loop in real time gets its solutions.
  bool tear_gradually = false;
  /// Off: every cut builds its system from scratch, on the nodes of one that appends; what that is measured by.
  bool updating = true;
  /// Nodes that follow a tool are sprinkled, and their body assembled and condensed, on a thread of their own, and so
  /// are those that follow a cut which was put off (blade.advance), or which the blade has left off at rest. It takes
  /// over at Session::swap_body(), or, after waiting for it, once the contact has left the fine zone that it would
  /// replace, or the blade has gone most_advances times blade.advance since; until then cut and wound are those of the
  /// body. When it begins, and what it becomes, depends on the steps alone. So is what a blade that the tissue resists
  /// proposes to cut, for which it is waited when the blade leaves the body, too.
  bool following_in_background = false;
  /// Whether a grasper is closed: a hand's in place of the times of the scenario; empty: by those.
  std::optional<bool> grip{};
};

/// How the body comes to follow what the blade cuts.
enum class CutPolicy : std::uint8_t {
  none,                   // there is no blade
  in_step,                // the step that cuts appends to it or rebuilds it
  in_background,          // it is made in the background, while the blade goes on
  proposed,               // it is made and solved before the blade, which the tissue resists, has paid for it
  proposed_in_background, // likewise, in the background
};
CutPolicy cut_policy(const Scenario& scenario, const SessionOptions& options);

/// Whether the tissue resists the blade, which then cuts as far as its work allows.
bool resists(const Scenario& scenario);

/// Fine spacings that the blade goes before its body follows the cut.
double blade_advance(const Scenario& scenario, const SessionOptions& options);

/// Fine spacings of blade.advance where it is left out and a body is made in the background, and times blade.advance
/// that a blade goes on before the steps wait for that.
inline constexpr double background_advance = 0.5, most_advances = 3;

/// Whether the scenario has a blade or a precut, or tissue that tears.
bool has_cuts(const Scenario& scenario);
/// Whether the tissue has a load of its own, that of weight or pretension.
bool has_loads(const Scenario& scenario);
/// Whether the tool is a grasper.
bool has_grasper(const Scenario& scenario);

} // namespace spherecut::app
