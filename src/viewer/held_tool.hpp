// A tool of a session, in one of two hands: which viewer holds it, and where it is led.
#pragma once

#include "src/viewer/live_session.hpp"
#include "src/viewer/requests.hpp"

#include <chrono>

namespace spherecut::app {

class HeldTool {
 public:
  /// The first hand holds the session's first tool, the second nothing.
  explicit HeldTool(const LiveSession& session, WhichHand hand = WhichHand::first) : hand_(hand) {
    if (hand == WhichHand::first)
      target_ = session.places().parked(session.places().modes().front());
  }

  /// The client that holds it; 0: nobody.
  [[nodiscard]] int holder() const { return holder_; }
  [[nodiscard]] HandMode mode() const { return target_.mode; }

  /// False: another client holds it.
  [[nodiscard]] bool take(int client);
  void let_go(LiveSession& session);
  /// Puts a tool away to its parking place.
  void put_down(LiveSession& session, HandMode mode);
  /// The second hand's: it holds nothing then.
  void lay_away(LiveSession& session);
  /// Where a viewer leads it, no further than two diagonals from the organ's middle. A tool that comes from its parking
  /// place is put down where it is led; inside the organ it stays parked: on its way there it would press or cut what
  /// nobody has asked for, as when a new session takes over from one that was worked in. False where the viewer is to
  /// be told so: once each time that the tool is parked, after a second of such poses (those that were under way when a
  /// session was replaced take less).
  [[nodiscard]] bool move(LiveSession& session, const Request& request);
  void grip(LiveSession& session, bool closed);
  /// Another session has taken over: the tool is put away, the same one if the session has it and no replay moves it.
  void change_session(LiveSession& session);

 private:
  void aim_anew(LiveSession& session, PointerTarget target);

  WhichHand hand_;
  int holder_ = 0;
  PointerTarget target_;
  bool parked_ = true; // the tool has not been led anywhere since it was put away
  /// Since when it is wanted inside the organ all the same.
  std::optional<std::chrono::steady_clock::time_point> inside_since_;
  bool inside_told_ = false;
};

} // namespace spherecut::app
