#include "src/live/recording.hpp"

#include "src/base/build_identity.hpp"
#include "src/live/simulation.hpp"
#include "src/scenario/keys.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/regular_file.hpp"
#include "topology/wound/wound.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

static_assert(std::endian::native == std::endian::little, "recordings are written as they lie in memory");

constexpr std::string_view signature = "SPHCREC\n";
constexpr std::uint32_t header_lot = 1, tick_lot = 2, solve_lot = 3, end_lot = 4, client_lot = 5, second_lot = 6,
                        second_client_lot = 7;
constexpr std::size_t lot_head = 16; // kind, size of the payload, its checksum
constexpr std::size_t tick_size = 136, solve_size = 88, client_size = 56, second_size = 128;
constexpr std::size_t torque_size = 24; // of a tick and of a solve, from version 2 on
constexpr std::size_t lot_of_ticks = 256;
constexpr std::uint32_t longest_lot = 64U << 20U;
constexpr std::uintmax_t largest_recording = 2'000'000'000; // bytes; an hour has 400 million
constexpr double longest_period = 1e6;                      // ticks
constexpr double farthest = 1e6;                            // m, of a coordinate
constexpr std::uint32_t connected = 1;
constexpr std::uint32_t failed = 1, resprinkled = 2, swapped = 4, in_background = 8;

std::uint64_t checksum(std::string_view bytes) { // FNV-1a
  std::uint64_t value = 0xcbf29ce484222325U;
  for (const char byte : bytes)
    value = (value ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return value;
}

template <typename T>
void put(std::string& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  bytes.append(raw.data(), raw.size());
}

void put(std::string& bytes, const Vector3& v) {
  for (int axis = 0; axis < 3; ++axis)
    put(bytes, v[axis]);
}

void put_text(std::string& bytes, std::string_view text) {
  put(bytes, static_cast<std::uint32_t>(text.size()));
  bytes.append(text);
}

void put_hand(std::string& bytes, const DeviceState& device, const Vector3& force) {
  put(bytes, device.tick);
  put(bytes, device.time);
  put(bytes, device.position);
  for (int i = 0; i < 4; ++i)
    put(bytes, device.orientation.coeffs()[i]);
  put(bytes, force);
  put(bytes, device.connected ? connected : 0U);
  put(bytes, device.mode);
  put(bytes, device.buttons);
}

/// Where there is more to tell than the pose.
void put_client(std::string& bytes, const DeviceState& device) {
  const ClientReading& client = device.client;
  if (!(client.period > 1) && !(client.share < 1))
    return;
  put(bytes, device.tick);
  put(bytes, client.position);
  put(bytes, client.period);
  put(bytes, client.share);
  put(bytes, static_cast<std::uint64_t>(client.fresh ? 1 : 0));
}

/// Reads values from a lot, and throws rather than past its end.
class Reader {
 public:
  Reader(std::string_view bytes, const std::filesystem::path& file, std::size_t at)
      : bytes_(bytes), file_(file), at_(at) {}
  template <typename T>
  T get() {
    std::array<char, sizeof(T)> raw{};
    std::memcpy(raw.data(), take(sizeof(T)).data(), sizeof(T));
    return std::bit_cast<T>(raw);
  }
  double number() {
    const auto value = get<double>();
    if (!std::isfinite(value))
      fail("a number that is not finite");
    return value;
  }
  Vector3 vector() {
    const double x = number();
    const double y = number();
    return {x, y, number()};
  }
  std::string text() { return std::string(take(get<std::uint32_t>())); }
  [[nodiscard]] std::size_t left() const { return bytes_.size(); }
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: byte {}: {}; this recording cannot be read", file_.string(), at_, what));
  }

 private:
  std::string_view take(std::size_t size) {
    if (size > bytes_.size())
      fail(fmt::format("{} bytes are wanted where {} are left", size, bytes_.size()));
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    at_ += size;
    return taken;
  }
  std::string_view bytes_;
  const std::filesystem::path& file_;
  std::size_t at_;
};

RecordingHeader header_of(Reader& in) {
  RecordingHeader header;
  header.build = in.text();
  header.processor = in.text();
  header.scenario = in.text();
  header.scenario_text = in.text();
  header.seed = in.get<std::uint64_t>();
  header.organ = in.get<std::uint64_t>();
  header.rate = in.number();
  if (const ScenarioKey* key = find_scenario_key("haptics.rate"); !key->range.holds(header.rate))
    in.fail(fmt::format("a rate of {:g} ticks per second; allowed: {}", header.rate, allowed_values(*key)));
  return header;
}

// Pose, force, and what the hand does.
void read_hand(Reader& in, RecordedHand& hand) {
  DeviceState& device = hand.device;
  device.time = in.number();
  device.position = in.vector();
  if (!(device.position.cwiseAbs().maxCoeff() <= farthest))
    in.fail(fmt::format("a position {:g} m from the origin; allowed: {:g} m", device.position.norm(), farthest));
  for (int i = 0; i < 4; ++i)
    device.orientation.coeffs()[i] = in.number();
  if (std::abs(device.orientation.norm() - 1) > 1e-6)
    in.fail(fmt::format("an orientation of length {:g}; allowed: 1", device.orientation.norm()));
  hand.force = in.vector();
  device.connected = (in.get<std::uint32_t>() & connected) != 0;
  device.mode = in.get<std::uint16_t>();
  device.buttons = in.get<std::uint16_t>();
}

RecordedTick tick_of(Reader& in, std::uint32_t version, std::size_t expected) {
  RecordedTick tick;
  tick.device.tick = in.get<std::uint64_t>();
  if (tick.device.tick != expected)
    in.fail(fmt::format("tick {} where tick {} should be", tick.device.tick, expected));
  read_hand(in, tick);
  tick.sequence = in.get<std::uint64_t>();
  if (version > 1)
    tick.torque = in.vector();
  return tick;
}

/// One that holds nothing stands for there being a second hand. `last`: tick of the one before.
RecordedHand second_of(Reader& in, const std::optional<std::uint64_t>& last) {
  RecordedHand hand;
  hand.device.tick = in.get<std::uint64_t>();
  if (last && hand.device.tick <= *last)
    in.fail(fmt::format("tick {} of the second hand after its tick {}", hand.device.tick, *last));
  read_hand(in, hand);
  hand.torque = in.vector();
  const auto mode = static_cast<HandMode>(hand.device.mode);
  if (mode != HandMode::usual && mode != HandMode::blade && mode != HandMode::probe)
    in.fail(fmt::format("a second hand in mode {}; allowed: {} and {} with the blade, {} with nothing",
                        hand.device.mode, static_cast<int>(HandMode::usual), static_cast<int>(HandMode::blade),
                        static_cast<int>(HandMode::probe)));
  return hand;
}

/// What is known of a client at a tick that has more to tell than its pose.
struct RecordedClient {
  std::uint64_t tick = 0;
  ClientReading reading;
};

RecordedClient client_of(Reader& in) {
  RecordedClient client;
  client.tick = in.get<std::uint64_t>();
  client.reading.position = in.vector();
  client.reading.period = in.number();
  client.reading.share = in.number();
  client.reading.fresh = in.get<std::uint64_t>() != 0;
  if (!(client.reading.position.cwiseAbs().maxCoeff() <= farthest) || !(client.reading.period >= 1) ||
      !(client.reading.period <= longest_period) || !(client.reading.share >= 0) || !(client.reading.share <= 1))
    in.fail("a client's reading that is out of range");
  return client;
}

/// Ticks of a session that was killed may be missing for the last of them.
void set_clients(Recording& recording, const std::vector<RecordedClient>& clients) {
  for (const RecordedClient& client : clients)
    if (client.tick < recording.ticks.size())
      recording.ticks[client.tick].device.client = client.reading;
}

/// Likewise; both are in the order of their ticks.
void set_second_clients(std::vector<RecordedHand>& hands, const std::vector<RecordedClient>& clients) {
  auto client = clients.begin();
  for (RecordedHand& hand : hands) {
    while (client != clients.end() && client->tick < hand.device.tick)
      ++client;
    if (client != clients.end() && client->tick == hand.device.tick)
      hand.device.client = client->reading;
  }
}

SolveRecord solve_of(Reader& in, std::uint32_t version, const std::vector<SolveRecord>& before) {
  SolveRecord solve;
  solve.event.sequence = in.get<std::uint64_t>();
  solve.event.pose_tick = in.get<std::uint64_t>();
  if (solve.event.sequence != before.size() + 1 ||
      (!before.empty() && solve.event.pose_tick <= before.back().event.pose_tick))
    in.fail(fmt::format("solve {} of tick {} after {} solves, the last of tick {}", solve.event.sequence,
                        solve.event.pose_tick, before.size(), before.empty() ? 0 : before.back().event.pose_tick));
  solve.event.degradation = in.get<std::int32_t>();
  if (solve.event.degradation < 0 || solve.event.degradation > most_degradation)
    in.fail(fmt::format("a solve coarsened by {} levels; allowed: 0 to {}", solve.event.degradation, most_degradation));
  const auto flags = in.get<std::uint32_t>();
  solve.failed = (flags & failed) != 0;
  solve.resprinkled = (flags & resprinkled) != 0;
  solve.event.swaps = (flags & swapped) != 0;
  solve.event.in_background = (flags & in_background) != 0;
  solve.cut_triangles = in.get<std::int32_t>();
  solve.nodes = in.get<std::int32_t>();
  solve.topology = in.get<std::uint64_t>();
  solve.force = in.vector();
  if (version > 1)
    solve.torque = in.vector();
  return solve;
}

// Which tick took which solve over.
void set_arrivals(Recording& recording, const std::filesystem::path& file) {
  std::uint64_t used = 0;
  for (const RecordedTick& tick : recording.ticks) {
    if (tick.sequence == used)
      continue;
    if (tick.sequence < used || tick.sequence > recording.solves.size())
      throw InputError(fmt::format("{}: tick {} uses solve {} of {}, after solve {}; this recording cannot be read",
                                   file.string(), tick.device.tick, tick.sequence, recording.solves.size(), used));
    used = tick.sequence;
    SolveEvent& event = recording.solves[used - 1].event;
    if (event.pose_tick > tick.device.tick)
      throw InputError(fmt::format("{}: tick {} uses solve {} of the later tick {}; this recording cannot be read",
                                   file.string(), tick.device.tick, used, event.pose_tick));
    event.arrival_tick = tick.device.tick;
  }
}

void check_end(Reader& in, const Recording& recording) {
  const auto ticks = in.get<std::uint64_t>();
  const auto solves = in.get<std::uint64_t>();
  const auto lost = in.get<std::uint64_t>();
  if (lost > 0)
    in.fail(fmt::format("{} ticks were lost while it was recorded", lost));
  if (ticks != recording.ticks.size() || solves != recording.solves.size())
    in.fail(fmt::format("{} ticks and {} solves are here of {} and {}", recording.ticks.size(), recording.solves.size(),
                        ticks, solves));
}

} // namespace

RecordingHeader recording_header(const Scenario& scenario, const topology::SurfaceMesh& organ) {
  return {build_identity(),     processor_name(),           std::filesystem::absolute(scenario.file),
          scenario.text,        scenario.nodes.random_seed, topology::surface_hash(organ),
          scenario.haptics.rate};
}

RecordingWriter::RecordingWriter(std::filesystem::path file, const RecordingHeader& header)
    : file_(std::move(file), OutputFile::Made::anew) {
  std::string start(signature);
  put(start, recording_version);
  put(start, std::uint32_t{0});
  file_.write(start);
  std::string payload;
  put_text(payload, header.build);
  put_text(payload, header.processor);
  put_text(payload, header.scenario.string());
  put_text(payload, header.scenario_text);
  put(payload, header.seed);
  put(payload, header.organ);
  put(payload, header.rate);
  write(header_lot, payload);
}

void RecordingWriter::write(std::uint32_t kind, std::string& payload) {
  if (payload.empty())
    return;
  std::string lot;
  put(lot, kind);
  put(lot, static_cast<std::uint32_t>(payload.size()));
  put(lot, checksum(payload));
  lot += payload;
  file_.write(lot);
  payload.clear();
}

void RecordingWriter::add(const TickRecord& tick) {
  const DeviceState& device = tick.device;
  put_hand(ticks_, device, tick.force);
  put(ticks_, tick.sequence);
  put(ticks_, tick.torque);
  put_client(clients_, device);
  if (tick.second) {
    put_hand(seconds_, tick.second->device, tick.second->force);
    put(seconds_, tick.second->torque);
    put_client(second_clients_, tick.second->device);
  } else if (tick.two_hands && !two_hands_told_) {
    put_hand(seconds_, idle_hand(device), Vector3::Zero());
    put(seconds_, Vector3(Vector3::Zero()));
  }
  two_hands_told_ = two_hands_told_ || tick.two_hands;
  ++tick_count_;
  if (ticks_.size() >= lot_of_ticks * tick_size)
    flush();
}

void RecordingWriter::add(const SolveRecord& solve) {
  put(solves_, solve.event.sequence);
  put(solves_, solve.event.pose_tick);
  put(solves_, static_cast<std::int32_t>(solve.event.degradation));
  put(solves_, (solve.failed ? failed : 0U) | (solve.resprinkled ? resprinkled : 0U) |
                   (solve.event.swaps ? swapped : 0U) | (solve.event.in_background ? in_background : 0U));
  put(solves_, static_cast<std::int32_t>(solve.cut_triangles));
  put(solves_, static_cast<std::int32_t>(solve.nodes));
  put(solves_, solve.topology);
  put(solves_, solve.force);
  put(solves_, solve.torque);
  ++solve_count_;
}

// Solves first: no tick on disk uses one that is not. What a tick knows of a client goes before it, too.
void RecordingWriter::flush() {
  write(solve_lot, solves_);
  write(client_lot, clients_);
  write(second_lot, seconds_);
  write(second_client_lot, second_clients_);
  write(tick_lot, ticks_);
}

void RecordingWriter::finish(std::uint64_t lost) {
  flush();
  std::string end;
  put(end, tick_count_);
  put(end, solve_count_);
  put(end, lost);
  write(end_lot, end);
  file_.close();
}

Recording read_recording(const std::filesystem::path& file) {
  const std::string bytes = topology::read_regular_file(file, largest_recording);
  const auto refuse = [&](std::size_t at, const std::string& what) {
    throw InputError(fmt::format("{}: byte {}: {}", file.string(), at, what));
  };
  if (!bytes.starts_with(signature))
    refuse(0, "not a recording of a haptic session");
  Reader start(std::string_view(bytes).substr(signature.size()), file, signature.size());
  Recording recording;
  recording.version = start.get<std::uint32_t>();
  if (recording.version < 1 || recording.version > recording_version)
    refuse(signature.size(),
           fmt::format("a recording of format {}; this program reads 1 to {}", recording.version, recording_version));
  static_cast<void>(start.get<std::uint32_t>());
  const std::size_t torque = recording.version > 1 ? 0 : torque_size; // that is not there
  std::vector<RecordedClient> clients, second_clients;
  std::optional<std::uint64_t> last_second; // tick of the second hand
  bool named = false;
  for (std::size_t at = signature.size() + 8; at < bytes.size();) {
    Reader head(std::string_view(bytes).substr(at), file, at);
    const auto cut_off = [&] {
      refuse(at, fmt::format("the file is cut off here, after {} whole ticks", recording.ticks.size()));
    };
    if (head.left() < lot_head)
      cut_off();
    const auto kind = head.get<std::uint32_t>();
    const auto size = head.get<std::uint32_t>();
    const auto sum = head.get<std::uint64_t>();
    if (kind < header_lot || kind > (recording.version > 2 ? second_client_lot : client_lot) || size > longest_lot ||
        recording.finished || named == (kind == header_lot))
      refuse(at, fmt::format("a lot of kind {} with {} bytes does not belong here", kind, size));
    if (head.left() < size)
      cut_off();
    const std::string_view payload = std::string_view(bytes).substr(at + lot_head, size);
    if (checksum(payload) != sum)
      refuse(at, "the checksum of this lot is wrong: the file is damaged");
    Reader in(payload, file, at + lot_head);
    if (kind == header_lot)
      recording.header = header_of(in);
    else if (kind == end_lot)
      check_end(in, recording);
    while (kind == tick_lot && in.left() >= tick_size - torque)
      recording.ticks.push_back(tick_of(in, recording.version, recording.ticks.size()));
    while (kind == solve_lot && in.left() >= solve_size - torque)
      recording.solves.push_back(solve_of(in, recording.version, recording.solves));
    while (kind == client_lot && in.left() >= client_size)
      clients.push_back(client_of(in));
    while (kind == second_client_lot && in.left() >= client_size)
      second_clients.push_back(client_of(in));
    while (kind == second_lot && in.left() >= second_size) {
      const RecordedHand hand = second_of(in, last_second);
      last_second = hand.device.tick;
      recording.two_hands = true;
      if (hand.device.mode != static_cast<std::uint16_t>(HandMode::probe))
        recording.seconds.push_back(hand);
    }
    if (in.left() != 0)
      in.fail(fmt::format("{} bytes too many in a lot of kind {}", in.left(), kind));
    named = true;
    recording.finished = kind == end_lot;
    at += lot_head + size;
  }
  if (!named)
    refuse(bytes.size(), "the file is cut off here, before anything was recorded");
  set_arrivals(recording, file);
  set_clients(recording, clients);
  set_second_clients(recording.seconds, second_clients);
  return recording;
}

const RecordedHand* Recording::second_at(std::uint64_t tick) const {
  const auto found = std::lower_bound(seconds.begin(), seconds.end(), tick,
                                      [](const RecordedHand& hand, std::uint64_t t) { return hand.device.tick < t; });
  return found != seconds.end() && found->device.tick == tick ? &*found : nullptr;
}

RecordedMotion::RecordedMotion(const Recording& recording, double rate, WhichHand hand) : rate_(rate) {
  if (recording.ticks.empty())
    throw InputError("a recording without ticks is no motion; allowed: one tick or more");
  if (recording.header.rate != rate)
    throw InputError(fmt::format("a recording of {:g} ticks per second in a loop of {:g}; allowed: haptics.rate = {:g}",
                                 recording.header.rate, rate, recording.header.rate));
  for (const RecordedTick& tick : recording.ticks)
    states_.push_back(hand == WhichHand::first ? tick.device : idle_hand(tick.device));
  if (hand == WhichHand::second)
    for (const RecordedHand& second : recording.seconds) // those of a session that was killed may have no tick
      if (second.device.tick < states_.size())
        states_[second.device.tick] = second.device;
}

DeviceState RecordedMotion::read(std::uint64_t tick) noexcept {
  DeviceState state = states_[std::min<std::size_t>(tick, states_.size() - 1)];
  state.tick = tick;
  if (tick >= states_.size()) { // it rests where it was
    state.client = {};
    state.time = static_cast<double>(tick) / rate_;
  }
  return state;
}

} // namespace spherecut::app
