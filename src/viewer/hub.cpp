#include "src/viewer/hub.hpp"

#include "src/scenario/document.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/regular_file.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <sched.h>
#include <sstream>
#include <system_error>
#include <utility>

namespace spherecut::app {
namespace {

constexpr std::size_t log_lines = 200;                        // kept for telling
constexpr auto log_interval = std::chrono::milliseconds(100); // between two lines
constexpr auto cutting_shown = std::chrono::milliseconds(300);
constexpr double inside_told = 1; // s, that a tool in its place may be wanted inside the organ for before that is told
constexpr std::size_t title_within = 16384, longest_title = 200; // bytes of a scenario file, of what is told of it
constexpr double reach = 2; // of the organ's diagonal, from its middle: so far away a hand may be

double seconds_since(std::chrono::steady_clock::time_point then) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - then).count();
}

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

/// The title that a scenario file gives itself, without reading the rest; empty: none.
std::string title_of(const std::filesystem::path& file) {
  std::istringstream text(topology::start_of_regular_file(file, title_within));
  for (std::string line; std::getline(text, line) && (line.empty() || line.front() != '[');) {
    if (line.rfind("title", 0) != 0)
      continue;
    const auto from = line.find('"');
    const auto to = line.rfind('"');
    if (from != std::string::npos && to > from)
      return line.substr(from + 1, std::min(to - from - 1, longest_title));
  }
  return {};
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
    : options_(std::move(options)), say_(std::move(say)), fifo_(fifo_granted()) {
  session_ = std::make_unique<LiveSession>(read_scenario(options_.scenario), LiveOptions{options_.speed, {}, {}},
                                           [this](const std::string& line) { say_here(line); });
  target_ = session_->parked(session_->modes().front());
  session_->start();
}

Hub::~Hub() {
  for (const auto& building : {building_.get(), next_.get()})
    if (building != nullptr && building->thread.joinable())
      building->thread.join();
  session_.reset();
  if (ending_.joinable())
    ending_.join();
}

void Hub::say_here(const std::string& line) {
  const std::lock_guard lock(log_mutex_);
  if (log_.size() >= log_lines)
    log_.pop_front();
  log_.push_back(line);
}

void Hub::send_all(const std::string& text) {
  std::vector<int> ids; // sending may end a client
  for (const auto& [id, client] : clients_)
    if (client.greeted)
      ids.push_back(id);
  for (const int id : ids)
    send(id, text);
}

void Hub::opened(int client) {
  clients_.emplace(client, Client{});
}

void Hub::closed(int client) {
  clients_.erase(client);
  request_overlays();
  if (holder_ == client)
    let_go();
}

std::optional<CloseReason> Hub::message(int client, std::string_view text) {
  const auto found = clients_.find(client);
  if (found == clients_.end())
    return CloseReason{CloseCode::policy, "not known here"};
  Client& from = found->second;
  Request request;
  try {
    request = parse_request(text);
  } catch (const InputError& error) {
    return CloseReason{CloseCode::invalid, error.what()};
  }
  server_->charge(client, cost_of(request));
  if (request.type == RequestType::hello) {
    if (request.number < 1 || request.number > protocol_version)
      return CloseReason{CloseCode::policy, fmt::format("versions 1 to {} are spoken here", protocol_version)};
    from.version = request.number;
    greet(client, from);
  } else if (!from.greeted) {
    return CloseReason{CloseCode::policy, "hello comes first"};
  } else if (needs_tool(request.type) && holder_ != client) {
    send(client, error_text("no_tool", "take the tool first", to_string(request.type)));
  } else {
    try {
      act(client, from, request);
    } catch (const InputError& error) {
      send(client, error_text("refused", shortened(error.what()), to_string(request.type)));
    }
  }
  return std::nullopt;
}

void Hub::greet(int client, Client& from) {
  from.greeted = true;
  WelcomeLists list;
  list.scenarios = scenarios(list.scenarios_left_out);
  list.recordings = recordings(list.recordings_left_out);
  send(client, welcome_text(client, from.version, list, options_.viewers, options_.speed));
  send(client, session_text(*session_, epoch_, target_.mode));
  send(client, holder_text(holder_));
  if (tear_.state != TearState::none)
    send(client, tear_text(tear_));
  if (session_->replays())
    send(client, replay_text(true, replaying_));
  if (recording_)
    send(client,
         recording_text(true, {session_->recorded_to().filename().string(), 0}, session_->tick().record.device.time));
  if (building_ != nullptr)
    send(client, building_text(building_->what));
}

void Hub::act(int client, Client& from, const Request& request) {
  switch (request.type) {
  case RequestType::hello:
    break;
  case RequestType::credit:
    from.credit = std::min(most_credit, from.credit + request.number);
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
    put_down(target_.mode);
    break;
  case RequestType::grip:
    target_.buttons = request.on ? 1 : 0;
    session_->aim(target_);
    break;
  case RequestType::reset:
    build(client, session_->scenario(), "reset", "from the start");
    break;
  case RequestType::scenario:
    choose(client, *request.name);
    break;
  case RequestType::set: {
    Scenario scenario = next_ != nullptr                              ? *next_->scenario
                        : building_ != nullptr && building_->scenario ? *building_->scenario
                                                                      : session_->scenario();
    apply(request.settings, scenario);
    build(client, std::move(scenario), "set", "with other settings");
    break;
  }
  case RequestType::overlays:
    change(from, client, request.overlays);
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
  if (holder_ != 0 && holder_ != client) {
    send(client, error_text("taken", "another viewer holds the tool", "take"));
    return;
  }
  holder_ = client;
  send_all(holder_text(holder_));
}

void Hub::let_go() {
  holder_ = 0;
  put_down(target_.mode);
  send_all(holder_text(holder_));
}

void Hub::put_down(HandMode mode) {
  const std::uint32_t number = target_.number;
  const std::uint32_t jumps = target_.jumps;
  target_ = session_->parked(mode);
  target_.number = number;
  target_.jumps = jumps + 1;
  parked_ = true;
  inside_since_.reset();
  inside_told_ = false;
  session_->aim(target_);
}

void Hub::set_mode(int client, HandMode mode) {
  const std::vector<HandMode> modes = session_->modes();
  if (std::find(modes.begin(), modes.end(), mode) == modes.end()) {
    send(client, error_text("unavailable", "this scenario has no such tool", "mode"));
    return;
  }
  put_down(mode);
  send_all(mode_text(mode));
}

// A tool that comes from its parking place is put down where it is led. Inside the organ it cannot be: on its way there
// it would press or cut what nobody has asked for, as when a new session takes over from one that was worked in.
void Hub::move(int client, const Request& request) {
  PointerTarget target = target_;
  target.number = request.pose;
  const BoundingBox box = session_->domain().bounds();
  const double most = reach * box.extent().norm();
  const Vector3 away = request.position - box.centre();
  target.position = box.centre() + (away.norm() > most ? Vector3(most / away.norm() * away) : away);
  if (request.orientation)
    target.orientation = *request.orientation;
  if (parked_ && !session_->clear_of_organ(target)) {
    tell_inside(client);
    return;
  }
  target_ = target;
  if (std::exchange(parked_, false))
    ++target_.jumps;
  session_->aim(target_);
}

// Once each time that the tool is away, and not for the poses that were under way when a session was replaced.
void Hub::tell_inside(int client) {
  if (!inside_since_)
    inside_since_ = Clock::now();
  if (inside_told_ || seconds_since(*inside_since_) < inside_told)
    return;
  inside_told_ = true;
  send(client,
       error_text("refused",
                  "the tool stays away, as it is led to a place inside the organ: lead it outside first, and in "
                  "from there",
                  "pose"));
}

void Hub::change(Client& from, int client, const OverlaysChange& overlays) {
  if (overlays.colour)
    from.overlays.colour = *overlays.colour;
  if (overlays.nodes)
    from.overlays.nodes = *overlays.nodes;
  if (overlays.stages)
    from.overlays.stages = *overlays.stages;
  if (overlays.pick)
    from.overlays.pick = *overlays.pick;
  if (overlays.slice)
    from.overlays.slice = *overlays.slice;
  if (from.overlays.pick)
    from.overlays.pick->key = client;
  if (from.overlays.slice)
    from.overlays.slice->key = client;
  request_overlays();
}

void Hub::request_overlays() {
  ViewerRequest request;
  for (const auto& [id, client] : clients_) {
    request.displacement = request.displacement || client.overlays.colour == Overlays::Colour::displacement;
    request.von_mises = request.von_mises || client.overlays.colour == Overlays::Colour::von_mises;
    request.nodes = request.nodes || client.overlays.nodes;
    if (client.overlays.pick)
      request.picks.push_back(*client.overlays.pick);
    if (client.overlays.slice)
      request.slices.push_back(*client.overlays.slice);
  }
  session_->request(std::move(request));
}

std::filesystem::path Hub::scenario_folder() const {
  const std::filesystem::path folder = options_.scenario.parent_path();
  return folder.empty() ? std::filesystem::path(".") : folder;
}

std::vector<ScenarioEntry> Hub::scenarios(std::size_t& left_out) const {
  std::vector<std::string> names = names_in(scenario_folder(), scenario_extension);
  std::sort(names.begin(), names.end());
  left_out = names.size() - std::min(names.size(), most_listed);
  names.resize(names.size() - left_out);
  std::vector<ScenarioEntry> list;
  list.reserve(names.size());
  for (const std::string& name : names)
    list.push_back({name, title_of(scenario_folder() / name)});
  return list;
}

void Hub::choose(int client, const std::string& name) {
  const std::filesystem::path file = scenario_folder() / name;
  if (!is_entry(file, name, scenario_extension))
    throw InputError(fmt::format("there is no scenario '{}' in the list", name));
  build(client, read_scenario_text(file, topology::read_regular_file(file, largest_scenario)), "scenario", name);
}

void Hub::tick() {
  finish_building();
  std::vector<int> silent;
  for (const auto& [id, client] : clients_)
    if (!client.greeted && seconds_since(client.since) > options_.hello_patience)
      silent.push_back(id);
  for (const int id : silent)
    server_->close(id, {CloseCode::policy, "hello did not come"});
  tell_log();
  tell_failures();
  tell_recording();
  const LiveTick& tick = session_->tick();
  measure(tick);
  send_frames(tick);
}

void Hub::tell_log() {
  if (seconds_since(log_told_) < std::chrono::duration<double>(log_interval).count())
    return;
  std::string line;
  {
    const std::lock_guard lock(log_mutex_);
    if (log_.empty())
      return;
    line = std::move(log_.front());
    log_.pop_front();
  }
  log_told_ = Clock::now();
  say_(line);
  send_all(log_text(shortened(line)));
}

void Hub::tell_failures() {
  for (const std::string& reason : session_->failures()) {
    say_("solver: " + reason);
    send_all(error_text("solver", shortened(reason), "session"));
  }
}

void Hub::tell_tear() {
  const TearStatus& now = session_->frame().tear;
  if (now.state == tear_.state && now.reason == tear_.reason && now.area == tear_.area)
    return;
  tear_ = now;
  send_all(tear_text(tear_));
}

void Hub::measure(const LiveTick& tick) {
  if (const std::uint64_t cuts = session_->cuts(); cuts != cuts_seen_) {
    cuts_seen_ = cuts;
    cut_at_ = Clock::now();
  }
  const double passed = seconds_since(measured_);
  if (passed < 1)
    return;
  const std::uint64_t ticks = tick.record.device.tick;
  const std::uint64_t solves = session_->solves();
  const std::uint64_t pictures = session_->frame().number;
  const auto done = static_cast<double>(ticks - ticks_before_);
  rates_.ticks = done / passed;
  rates_.solves = static_cast<double>(solves - solves_before_) / passed;
  rates_.pictures = static_cast<double>(pictures - pictures_before_) / passed;
  rates_.tick_seconds = done > 0 ? (tick.compute - compute_before_) / done : 0;
  measured_ = Clock::now();
  ticks_before_ = ticks;
  solves_before_ = solves;
  pictures_before_ = pictures;
  compute_before_ = tick.compute;
}

std::uint32_t Hub::state_bits(const LiveTick& tick) const {
  std::uint32_t bits = 0;
  const auto set = [&](std::uint32_t bit, bool on) { bits |= on ? bit : 0; };
  set(state_contact, tick.record.active > 0 || tick.record.tissue.squaredNorm() > 0);
  set(state_held, holder_ != 0);
  set(state_recording, session_->recording());
  set(state_replay, session_->replays());
  set(state_cutting, cuts_seen_ > 0 && Clock::now() - cut_at_ < cutting_shown);
  set(state_failed, session_->failing());
  set(state_building, building_ != nullptr);
  set(state_limited, tick.record.limited);
  set(state_fifo, fifo_);
  return bits;
}

void Hub::send_frames(const LiveTick& tick) {
  if (session_->fetch_frame()) {
    number_in_solve_ = session_->number_at(session_->frame().pose_tick); // later that tick may be forgotten
    tell_tear();
  }
  const ViewerFrame& frame = session_->frame();
  if (frame.number == 0)
    return;
  std::vector<int> ids;
  ids.reserve(clients_.size());
  for (const auto& [id, client] : clients_)
    ids.push_back(id);
  for (const int id : ids) {
    const auto found = clients_.find(id);
    if (found == clients_.end() || !found->second.greeted)
      continue;
    Client& client = found->second;
    const bool picture = client.picture != frame.number || client.epoch != epoch_;
    const bool due = seconds_since(client.last_frame) >= 1 / options_.frame_rate;
    if (server_->waiting(id) > 0 || client.credit == 0) {
      if (picture && client.picture != 0 && std::exchange(client.missed, frame.number) != frame.number)
        ++client.left_out;
    } else if (due && (picture || client.tick != tick.record.device.tick)) {
      send_frame(id, client, tick, picture);
    }
  }
}

void Hub::send_frame(int id, Client& client, const LiveTick& tick, bool picture) {
  const ViewerFrame& frame = session_->frame();
  if (client.topology != frame.topology->number || client.epoch != epoch_) {
    client.topology = frame.topology->number;
    server_->send_binary(id, encode_topology(*frame.topology, client.version, ++client.messages, epoch_));
  }
  client.epoch = epoch_;
  client.picture = frame.number;
  client.tick = tick.record.device.tick;
  client.last_frame = Clock::now();
  --client.credit;
  FrameContext context;
  context.version = client.version;
  context.message = ++client.messages;
  context.epoch = epoch_;
  context.state = state_bits(tick);
  context.number_in_solve = number_in_solve_;
  context.left_out = client.left_out;
  context.rates = rates_;
  const Overlays overlays = client.overlays;
  server_->send_binary(id, encode_frame(frame, tick, context, overlays, id, picture));
}

} // namespace spherecut::app
