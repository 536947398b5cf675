#include "src/viewer/hub.hpp"

#include "src/live/replay.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <sched.h>
#include <system_error>
#include <utility>

namespace spherecut::app {
namespace {

constexpr double under_way = 2; // s, that poses of a hand which holds nothing any more may take to come

/// Whether threads of this process may have a real-time priority.
bool fifo_granted() {
  bool granted = false;
  try {
    std::thread([&granted] {
      sched_param parameter{};
      parameter.sched_priority = 80;
      granted = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
    }).join();
  } catch (const std::system_error&) { // no thread of any kind
  }
  return granted;
}

/// What a request costs besides the one message that it is: reading folders and files, beginning a session.
double cost_of(const Request& request) {
  switch (request.type) {
  case RequestType::hello:
    return 60;
  case RequestType::reset:
  case RequestType::scenario:
  case RequestType::set:
  case RequestType::record:
  case RequestType::replay:
    return 30;
  case RequestType::overlays:
    return 3;
  default:
    return 0;
  }
}

std::string shortened(const std::string& text) {
  return text.substr(0, std::min<std::size_t>(text.size(), 2000));
}

} // namespace

Hub::Hub(HubOptions options, std::function<void(const std::string&)> say)
    : options_(std::move(options)), say_(std::move(say)), files_(options_.scenario, options_.recordings),
      builder_([this](const std::string& line) { log_.add(line); }),
      session_(std::make_unique<LiveSession>(read_scenario(options_.scenario), LiveOptions{options_.speed, {}, {}},
                                             [this](const std::string& line) { log_.add(line); })),
      tool_(*session_), second_(*session_, WhichHand::second), viewers_(options_.frame_rate), fifo_(fifo_granted()) {
  session_->start();
}

void Hub::closed(int client) {
  viewers_.remove(client);
  session_->request(viewers_.wanted());
  if (tool_.holder() == client)
    let_go();
}

std::optional<CloseReason> Hub::message(int client, std::string_view text) {
  ViewerState* const viewer = viewers_.find(client);
  if (viewer == nullptr)
    return CloseReason{CloseCode::policy, "not known here"};
  Request request;
  try {
    request = parse_request(text);
  } catch (const InputError& error) {
    return CloseReason{CloseCode::invalid, error.what()};
  }
  viewers_.charge(client, cost_of(request));
  if (request.type == RequestType::hello) {
    if (request.number < 1 || request.number > protocol_version)
      return CloseReason{CloseCode::policy, fmt::format("versions 1 to {} are spoken here", protocol_version)};
    viewer->version = request.number;
    greet(client, *viewer);
  } else if (!viewer->greeted) {
    return CloseReason{CloseCode::policy, "hello comes first"};
  } else if (needs_tool(request.type) && tool_.holder() != client) {
    viewers_.send(client, error_text("no_tool", "take the tool first", to_string(request.type)));
  } else {
    try {
      act(client, *viewer, request);
    } catch (const InputError& error) {
      viewers_.send(client, error_text("refused", shortened(error.what()), to_string(request.type)));
    }
  }
  return std::nullopt;
}

void Hub::greet(int client, ViewerState& viewer) {
  viewer.greeted = true;
  viewers_.send(client, welcome_text(client, viewer.version, files_.lists(), options_.viewers, options_.speed));
  viewers_.send(client, session_text(*session_, epoch_, tool_.mode()));
  viewers_.send(client, holder_text(tool_.holder()));
  if (second_on_)
    viewers_.send(client, second_text(true));
  if (tear_.state != TearState::none)
    viewers_.send(client, tear_text(tear_));
  if (session_->replays())
    viewers_.send(client, replay_text(true, replaying_));
  if (recording_)
    viewers_.send(client, recording_text(true, {session_->recorder().file().filename().string(), 0},
                                         session_->tick().record.device.time));
  if (const SessionOrder* order = builder_.building())
    viewers_.send(client, building_text(order->what));
}

void Hub::act(int client, ViewerState& viewer, const Request& request) {
  switch (request.type) {
  case RequestType::hello:
    break;
  case RequestType::credit:
    viewer.credit = std::min(most_credit, viewer.credit + request.number);
    send_frames(session_->tick()); // what waits for it need not wait for the next tick of the server
    break;
  case RequestType::take:
    take(client);
    break;
  case RequestType::release:
    let_go();
    break;
  case RequestType::mode:
    set_mode(client, request.mode);
    break;
  case RequestType::pose:
    move(client, request);
    break;
  case RequestType::park:
    if (request.hand == WhichHand::first)
      tool_.put_down(*session_, tool_.mode());
    else if (second_on_)
      second_.put_down(*session_, HandMode::blade);
    break;
  case RequestType::second:
    set_second(client, request.on);
    break;
  case RequestType::grip:
    tool_.grip(*session_, request.on);
    break;
  case RequestType::reset:
    build({"reset", "from the start", client, session_->scenario(), {}, {}});
    break;
  case RequestType::scenario:
    build({"scenario", *request.name, client, files_.scenario(*request.name), {}, {}});
    break;
  case RequestType::set: {
    const Scenario* const ordered = builder_.newest();
    Scenario scenario = ordered != nullptr ? *ordered : session_->scenario();
    apply(request.settings, scenario);
    build({"set", "with other settings", client, std::move(scenario), {}, {}});
    break;
  }
  case RequestType::overlays:
    viewers_.change_overlays(client, request.overlays);
    session_->request(viewers_.wanted());
    break;
  case RequestType::record:
    record(client, request.on);
    break;
  case RequestType::replay:
    replay(client, request.name);
    break;
  }
}

void Hub::take(int client) {
  if (tool_.take(client))
    viewers_.send_all(holder_text(client));
  else
    viewers_.send(client, error_text("taken", "another viewer holds the tool", "take"));
}

void Hub::let_go() {
  lay_second_away();
  tool_.let_go(*session_);
  viewers_.send_all(holder_text(tool_.holder()));
}

void Hub::set_mode(int client, HandMode mode) {
  const std::vector<HandMode> modes = session_->places().modes();
  if (std::find(modes.begin(), modes.end(), mode) == modes.end()) {
    viewers_.send(client, error_text("unavailable", "this scenario has no such tool", "mode"));
    return;
  }
  if (mode == HandMode::blade) // there is one
    lay_second_away();
  tool_.put_down(*session_, mode);
  viewers_.send_all(mode_text(mode));
}

// The blade goes into the second hand; the first then has the tool, and keeps it where it is.
void Hub::set_second(int client, bool on) {
  if (!on)
    return lay_second_away();
  if (!session_->takes_two_hands() || session_->replays()) {
    viewers_.send(client, error_text("unavailable",
                                     session_->replays() ? "a replay moves both hands"
                                                         : "this scenario has not both a tool and a blade: one for "
                                                           "each hand",
                                     "second"));
    return;
  }
  if (second_on_) {
    viewers_.send(client, second_text(true));
    return;
  }
  if (tool_.mode() == HandMode::blade)
    set_mode(client, session_->places().modes().front());
  second_.put_down(*session_, HandMode::blade);
  second_on_ = true;
  viewers_.send_all(second_text(true));
}

void Hub::lay_second_away() {
  if (!std::exchange(second_on_, false))
    return;
  second_.lay_away(*session_);
  second_laid_ = std::chrono::steady_clock::now();
  viewers_.send_all(second_text(false));
}

void Hub::move(int client, const Request& request) {
  if (request.hand == WhichHand::second && !second_on_) {
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - second_laid_).count() < under_way)
      return; // it was sent before
    viewers_.send(client, error_text("unavailable", "the second hand holds nothing: ask for 'second' first", "pose"));
    return;
  }
  if (!(request.hand == WhichHand::first ? tool_ : second_).move(*session_, request))
    viewers_.send(client, error_text("refused",
                                     "the tool stays away, as it is led to a place inside the organ: lead it outside "
                                     "first, and in from there",
                                     "pose"));
}

void Hub::tick() {
  finish_building();
  viewers_.close_silent(options_.hello_patience);
  tell_log();
  tell_recording();
  const LiveTick& tick = session_->tick();
  meter_.measure(*session_, tick);
  send_frames(tick);
}

void Hub::tell_log() {
  if (const std::optional<std::string> line = log_.next()) {
    say_(*line);
    viewers_.send_all(log_text(shortened(*line)));
  }
  for (const std::string& reason : session_->failures()) {
    say_("solver: " + reason);
    viewers_.send_all(error_text("solver", shortened(reason), "session"));
  }
}

void Hub::tell_tear() {
  const TearStatus& now = session_->frame().tear;
  if (now.state == tear_.state && now.reason == tear_.reason && now.area == tear_.area)
    return;
  tear_ = now;
  viewers_.send_all(tear_text(tear_));
}

std::uint32_t Hub::state_bits(const LiveTick& tick) const {
  std::uint32_t bits = 0;
  const auto set = [&](std::uint32_t bit, bool on) { bits |= on ? bit : 0; };
  set(state_contact, tick.record.active > 0 || tick.record.tissue.squaredNorm() > 0);
  set(state_held, tool_.holder() != 0);
  set(state_recording, session_->recorder().recording());
  set(state_replay, session_->replays());
  set(state_cutting, meter_.cutting());
  set(state_failed, session_->failing());
  set(state_building, builder_.building() != nullptr);
  set(state_limited, tick.record.limited);
  set(state_fifo, fifo_);
  return bits;
}

void Hub::send_frames(const LiveTick& tick) {
  if (session_->fetch_frame()) {
    const std::uint64_t solved = session_->frame().pose_tick; // later that tick may be forgotten
    number_in_solve_ = session_->number_at(solved);
    second_number_in_solve_ = session_->number_at(solved, WhichHand::second);
    tell_tear();
  }
  if (session_->frame().number == 0)
    return;
  viewers_.send_frames(session_->frame(), tick, epoch_, [&] {
    FrameContext context;
    context.epoch = epoch_;
    context.state = state_bits(tick);
    context.number_in_solve = number_in_solve_;
    context.second_number_in_solve = second_number_in_solve_;
    context.rates = meter_.rates();
    return context;
  });
}

// A recording begins with a session, so that it can be run again from there.
void Hub::record(int client, bool on) {
  if (!on) {
    session_->stop_recording();
    return;
  }
  const bool recording = session_->recorder().recording();
  if (recording || session_->replays() || changed_) {
    viewers_.send(client, error_text("unavailable",
                                     recording  ? "this session is being recorded"
                                     : changed_ ? "a recording refers to the scenario as its file has it: choose the "
                                                  "scenario anew"
                                                : "a replay is going on",
                                     "record"));
    return;
  }
  build({"record", "from the start, recorded", client, session_->scenario(), {0, files_.new_recording(), {}}, {}});
}

void Hub::replay(int client, const std::optional<std::string>& name) {
  if (!name) {
    if (session_->replays())
      build({"replay", "from the start", client, session_->scenario(), {}, {}});
    return;
  }
  const auto recording = std::make_shared<const Recording>(files_.recording(*name));
  build({"replay", "replay of " + *name, client, recorded_scenario(*recording), {0, {}, recording}, *name});
}

void Hub::tell_recording() {
  const bool now = session_->recorder().recording();
  if (now == recording_)
    return;
  recording_ = now;
  const std::filesystem::path& file = session_->recorder().file();
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  viewers_.send_all(
      recording_text(now, {file.filename().string(), error ? 0 : bytes}, session_->tick().record.device.time));
}

void Hub::build(SessionOrder order) {
  order.options.speed = options_.speed;
  builder_.order(std::move(order));
  if (builder_.start())
    viewers_.send_all(building_text(builder_.building()->what));
}

void Hub::finish_building() {
  std::optional<SessionOrder> order = builder_.finished();
  if (!order)
    return;
  if (order->session != nullptr) {
    take_over(*order);
  } else {
    say_(fmt::format("the session goes on as it was: {}", order->failure));
    if (viewers_.find(order->client) != nullptr)
      viewers_.send(order->client, error_text(order->code, order->failure, order->about));
  }
  viewers_.send_all(session_text(*session_, epoch_, tool_.mode()));
  if (second_on_)
    viewers_.send_all(second_text(true));
  if (builder_.start())
    viewers_.send_all(building_text(builder_.building()->what));
}

void Hub::take_over(SessionOrder& order) {
  builder_.end(std::exchange(session_, std::move(order.session)));
  ++epoch_;
  changed_ = order.about == "set" || (changed_ && order.about != "scenario" && order.about != "replay");
  recording_ = false;
  if (!replaying_.empty() || session_->replays())
    viewers_.send_all(replay_text(session_->replays(), session_->replays() ? order.replayed : replaying_));
  replaying_ = session_->replays() ? order.replayed : "";
  tool_.change_session(*session_);
  second_.change_session(*session_);
  if (std::exchange(second_on_, false)) {
    second_laid_ = std::chrono::steady_clock::now();
    viewers_.send_all(second_text(false));
  }
  session_->request(viewers_.wanted());
  meter_.restart();
  tear_ = {};
  number_in_solve_ = second_number_in_solve_ = 0;
  session_->start();
}

} // namespace spherecut::app
