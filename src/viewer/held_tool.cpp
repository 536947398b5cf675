#include "src/viewer/held_tool.hpp"

#include <algorithm>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double inside_told_after = 1; // s, that a parked tool may be wanted inside the organ for before that is told
constexpr double reach = 2;             // of the organ's diagonal, from its middle: so far away a hand may be

} // namespace

bool HeldTool::take(int client) {
  if (holder_ != 0 && holder_ != client)
    return false;
  holder_ = client;
  return true;
}

void HeldTool::let_go(LiveSession& session) {
  holder_ = 0;
  put_down(session, target_.mode);
}

void HeldTool::put_down(LiveSession& session, HandMode mode) {
  aim_anew(session, session.places().parked(mode));
}

void HeldTool::lay_away(LiveSession& session) {
  aim_anew(session, {});
}

void HeldTool::aim_anew(LiveSession& session, PointerTarget target) {
  target.number = target_.number;
  target.jumps = target_.jumps + 1;
  target_ = target;
  parked_ = true;
  inside_since_.reset();
  inside_told_ = false;
  session.aim(target_, hand_);
}

bool HeldTool::move(LiveSession& session, const Request& request) {
  PointerTarget target = target_;
  target.number = request.pose;
  const BoundingBox box = session.domain().bounds();
  const double most = reach * box.extent().norm();
  const Vector3 away = request.position - box.centre();
  target.position = box.centre() + (away.norm() > most ? Vector3(most / away.norm() * away) : away);
  if (request.orientation)
    target.orientation = *request.orientation;
  if (parked_ && !session.places().clear_of_organ(target)) {
    const auto now = std::chrono::steady_clock::now();
    if (!inside_since_)
      inside_since_ = now;
    const bool tell = !inside_told_ && std::chrono::duration<double>(now - *inside_since_).count() >= inside_told_after;
    inside_told_ = inside_told_ || tell;
    return !tell;
  }
  target_ = target;
  if (std::exchange(parked_, false))
    ++target_.jumps;
  session.aim(target_, hand_);
  return true;
}

void HeldTool::grip(LiveSession& session, bool closed) {
  target_.buttons = closed ? 1 : 0;
  session.aim(target_, hand_);
}

void HeldTool::change_session(LiveSession& session) {
  if (hand_ == WhichHand::second) {
    target_.jumps = 0;
    lay_away(session);
    return;
  }
  const std::vector<HandMode> modes = session.places().modes();
  const bool same = !session.replays() && std::find(modes.begin(), modes.end(), target_.mode) != modes.end();
  target_.jumps = 0;
  put_down(session, same ? target_.mode : modes.front());
}

} // namespace spherecut::app
