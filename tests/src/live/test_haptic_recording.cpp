// Recordings of haptic sessions: replay to the bit, files that are refused, sessions that were killed.
#include "src/live/realtime_loop.hpp"
#include "src/live/replay.hpp"
#include "src/live/run_haptics.hpp"

#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <limits>

using namespace spherecut;
using namespace spherecut::app;
using spherecut::tests::cut_block;
using spherecut::tests::read_file;
using spherecut::tests::run_spherecut;
using spherecut::tests::small_scenario;
using spherecut::tests::TemporaryFolder;
using spherecut::tests::write_file;

namespace {

/// The block with a blade that is drawn through its top in half a second.
const std::string blade_block = cut_block + R"([blade]
edge = [[0, -0.04, 0.022], [0, 0.04, 0.022]]
[[blade.path]]
time = 0
position = [-0.032, 0, 0]
[[blade.path]]
time = 0.5
position = [-0.012, 0, 0]
[output]
figures = false
)";

/// A short session in real time with its recording in `file`.
LoopRecords record(const Scenario& scenario, const std::filesystem::path& file, double seconds) {
  HapticSimulation simulation(scenario);
  const auto device = make_device(scenario.haptics, simulation);
  RecordingWriter writer(file, recording_header(scenario, simulation.session().organ().domain->surface()));
  RealtimeOptions options;
  options.fifo = false;
  options.on_tick = [&](const TickRecord& tick) { writer.add(tick); };
  options.on_solve = [&](const SolveRecord& solve) { writer.add(solve); };
  RealtimeReport report;
  LoopRecords records = run_realtime(scenario.haptics, simulation, *device, seconds, options, report);
  CHECK(report.lost == 0);
  CHECK(report.ticks == records.ticks.size());
  writer.finish(report.lost);
  return records;
}

/// A recording that was not computed: `ticks` ticks, a solve every ten that is taken over three later.
void write_made_up(const std::filesystem::path& file, std::uint64_t ticks, bool finish) {
  std::filesystem::remove(file); // a recording never replaces a file
  RecordingWriter writer(file, {"build", "processor", "/s.toml", "text", 3, 5, 1000});
  for (std::uint64_t t = 0; t < ticks; ++t) {
    if (t % 10 == 0) {
      SolveRecord solve;
      solve.event = {t / 10 + 1, t, SolveEvent::never, static_cast<int>(t / 10 % 3), t / 10 % 2 == 1, t / 10 % 5 == 1};
      solve.topology = 7 * t;
      solve.force = {0, 0.1, static_cast<double>(t)};
      solve.torque = {-0.5, static_cast<double>(t), 3};
      writer.add(solve);
    }
    TickRecord tick;
    tick.device = {t,
                   1e-3 * static_cast<double>(t),
                   {1e-3, 2e-3, 1e-5 * static_cast<double>(t)},
                   Eigen::Quaterniond::Identity(),
                   t != 5,
                   2,
                   9};
    tick.force = {1, 2, static_cast<double>(t)};
    tick.torque = {4, static_cast<double>(t), 5};
    tick.sequence = t < 3 ? 0 : (t - 3) / 10 + 1;
    tick.two_hands = true;
    if (t >= 20 && t % 3 != 0) {
      SecondHandRecord second;
      second.device = tick.device;
      second.device.mode = static_cast<std::uint16_t>(HandMode::blade);
      second.device.client.period = t % 2 == 0 ? 1 : 4;
      second.force = {7, static_cast<double>(t), 8};
      second.torque = {9, 1, static_cast<double>(t)};
      tick.second = second;
    }
    writer.add(tick);
  }
  writer.flush();
  if (finish)
    writer.finish();
}

/// A recording as version 1 had it: one hand, without the last 24 bytes of every tick (136) and solve (88).
std::string in_version_1(const std::string& bytes) {
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  const auto append = [](std::string& to, const auto& value) {
    to.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  std::string old = bytes.substr(0, 8);
  append(old, std::uint32_t{1});
  append(old, std::uint32_t{0});
  for (std::size_t at = 16; at < bytes.size();) {
    const std::uint32_t kind = word(at), size = word(at + 4);
    const std::string payload = bytes.substr(at + 16, size);
    if (kind > 5) {
      at += 16 + size;
      continue;
    }
    const std::size_t entry = kind == 2 ? 136 : kind == 3 ? 88 : size;
    std::string kept;
    for (std::size_t k = 0; k < size; k += entry)
      kept += payload.substr(k, entry == size && kind != 2 && kind != 3 ? entry : entry - 24);
    std::uint64_t sum = 0xcbf29ce484222325U; // FNV-1a
    for (const char byte : kept)
      sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
    append(old, kind);
    append(old, static_cast<std::uint32_t>(kept.size()));
    append(old, sum);
    old += kept;
    at += 16 + size;
  }
  return old;
}

} // namespace

TEST_CASE("A session in real time is replayed with the same forces and topology to the bit") {
  const auto& [text, cuts] = GENERATE(table<std::string, bool>({{small_scenario, false}, {blade_block, true}}));
  const TemporaryFolder folder;
  const auto file = folder.path() / "a.recording";
  const Scenario scenario = read_scenario(write_file(folder.path() / "s.toml", text));
  const LoopRecords records = record(scenario, file, 0.5);
  Recording recording = read_recording(file);
  REQUIRE(recording.finished);
  REQUIRE(recording.ticks.size() == records.ticks.size());
  REQUIRE(recording.solves.size() == records.solves.size());
  int increments = 0;
  for (std::size_t i = 0; i < records.solves.size(); ++i) {
    CHECK(recording.solves[i].event.arrival_tick == records.solves[i].event.arrival_tick);
    increments += records.solves[i].cut_triangles > 0 ? 1 : 0;
  }
  CHECK((increments > 0) == cuts);
  HapticSimulation simulation(recorded_scenario(recording));
  LoopRecords again;
  const ReplayReport report = replay(recording, simulation, again);
  CHECK(report.same());
  CHECK(report.same_build);
  CHECK(report.ticks == recording.ticks.size());
  CHECK(report.solves > 5);
  if (cuts)
    return;
  // The comparison can tell: one pose in contact a micrometre off.
  recording.ticks[450].device.position.z() -= 1e-6;
  HapticSimulation other(recorded_scenario(recording));
  const ReplayReport off = replay(recording, other, again);
  REQUIRE(off.differing_tick);
  CHECK(*off.differing_tick == 450);
  CHECK(off.largest > 0);
  recording.header.organ ^= 1;
  HapticSimulation unused(recorded_scenario(recording));
  CHECK_THROWS_WITH(replay(recording, unused, again), Catch::Contains("organ"));
}

TEST_CASE("A recording keeps every value, and a session that was killed all that was flushed") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "a.recording";
  const bool finish = GENERATE(true, false);
  write_made_up(file, 700, finish);
  const Recording recording = read_recording(file);
  CHECK(recording.finished == finish);
  CHECK(recording.header.scenario_text == "text");
  CHECK(recording.header.seed == 3);
  REQUIRE(recording.ticks.size() == 700);
  REQUIRE(recording.solves.size() == 70);
  const RecordedTick& tick = recording.ticks[345];
  CHECK(tick.device.position == Vector3(1e-3, 2e-3, 1e-5 * 345));
  CHECK(tick.force == Vector3(1, 2, 345));
  CHECK(tick.torque == Vector3(4, 345, 5));
  CHECK(recording.solves[34].torque == Vector3(-0.5, 340, 3));
  CHECK(recording.version == recording_version);
  CHECK(tick.device.connected);
  CHECK_FALSE(recording.ticks[5].device.connected);
  CHECK(tick.device.mode == 2);
  CHECK(tick.device.buttons == 9);
  CHECK(recording.solves[34].event.arrival_tick == 343);
  CHECK(recording.solves[34].event.degradation == 1);
  CHECK(recording.solves[34].topology == 7 * 340);
  CHECK_FALSE(recording.solves[34].event.swaps);
  CHECK(recording.solves[35].event.swaps);
  CHECK_FALSE(recording.solves[35].event.in_background);
  CHECK(recording.solves[36].event.in_background);
}

TEST_CASE("A recording of the first version is read without its torques, and replayed by its forces") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "a.recording", old = folder.path() / "old.recording";
  write_made_up(file, 700, true);
  write_file(old, in_version_1(read_file(file)));
  const Recording now = read_recording(file), then = read_recording(old);
  CHECK(then.version == 1);
  CHECK(then.finished);
  CHECK(then.header.scenario_text == "text");
  REQUIRE(then.ticks.size() == now.ticks.size());
  REQUIRE(then.solves.size() == now.solves.size());
  for (std::size_t i = 0; i < now.ticks.size(); ++i) {
    CHECK(then.ticks[i].force == now.ticks[i].force);
    CHECK(then.ticks[i].device.position == now.ticks[i].device.position);
    CHECK(then.ticks[i].sequence == now.ticks[i].sequence);
    CHECK(then.ticks[i].torque.isZero(0));
  }
  CHECK(then.solves[34].force == now.solves[34].force);
  CHECK(then.solves[34].torque.isZero(0));

  const Scenario scenario = read_scenario(write_file(folder.path() / "s.toml", small_scenario));
  const auto real = folder.path() / "b.recording";
  const LoopRecords records = record(scenario, real, 0.5);
  double turning = 0;
  for (const TickRecord& tick : records.ticks)
    turning = std::max(turning, tick.torque.norm());
  CHECK(turning > 0);
  for (const bool first_version : {true, false}) {
    if (first_version)
      write_file(old, in_version_1(read_file(real)));
    Recording recording = read_recording(first_version ? old : real);
    HapticSimulation simulation(recorded_scenario(recording));
    LoopRecords again;
    const ReplayReport report = replay(recording, simulation, again);
    CHECK(report.same());
    CHECK(report.torques == !first_version);
    CHECK((text_of(report).find("no torques") != std::string::npos) == first_version);
    if (first_version)
      continue;
    recording.ticks[450].torque.z() += 1e-12; // the comparison can tell
    HapticSimulation other(recorded_scenario(recording));
    const ReplayReport off = replay(recording, other, again);
    REQUIRE(off.differing_tick);
    CHECK(*off.differing_tick == 450);
    CHECK(off.largest == 0);
    CHECK(off.largest_torque == Approx(1e-12));
  }
}

TEST_CASE("A recording moves a device and stays where it ends") {
  const TemporaryFolder folder;
  write_made_up(folder.path() / "a.recording", 300, true);
  const Recording recording = read_recording(folder.path() / "a.recording");
  RecordedMotion device(recording, 1000);
  CHECK(device.read(200).position.z() == 1e-5 * 200);
  CHECK(device.read(5000).position.z() == 1e-5 * 299);
  CHECK(device.read(5000).time == Approx(5));
  CHECK_THROWS_AS(RecordedMotion(recording, 500), InputError);
}

TEST_CASE("Files that are no whole recording are refused wherever they are cut off or damaged") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "a.recording";
  write_made_up(file, 40, true);
  const std::string whole = read_file(file);
  const auto refused = [&](const std::string& bytes, const std::string& what) {
    write_file(file, bytes);
    CHECK_THROWS_WITH(read_recording(file), Catch::Contains(what));
  };
  refused("", "not a recording");
  refused("some text of no meaning at all", "not a recording");
  std::string foreign = whole;
  foreign[8] = 9;
  refused(foreign, "format 9");
  CHECK_THROWS_AS(read_recording(folder.path() / "none"), InputError);
  int ends = 0; // between two lots: a session that was killed there
  for (std::size_t size = 1; size < whole.size(); size += size < 400 ? 1 : 7) {
    write_file(file, whole.substr(0, size));
    try {
      const Recording part = read_recording(file);
      CHECK_FALSE(part.finished);
      ++ends;
    } catch (const InputError& error) {
      CHECK(std::strstr(error.what(), "a.recording") != nullptr);
    }
  }
  CHECK(ends <= 3);
  for (std::size_t at = 16; at < whole.size(); at += 5) { // no damaged byte goes unseen
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x40);
    write_file(file, damaged);
    CHECK_THROWS_AS(read_recording(file), InputError);
  }
  refused(whole + "more", "cut off");
  std::filesystem::remove(file);
  RecordingWriter lossy(file, {"build", "processor", "/s.toml", "text", 3, 5, 1000});
  lossy.finish(4);
  CHECK_THROWS_WITH(read_recording(file), Catch::Contains("4 ticks were lost"));
}

TEST_CASE("A session without end keeps nothing in memory and ends when it is told") {
  const TemporaryFolder folder;
  const Scenario scenario = read_scenario(write_file(folder.path() / "s.toml", small_scenario));
  HapticSimulation simulation(scenario);
  const auto device = make_device(scenario.haptics, simulation);
  RealtimeOptions options;
  options.fifo = false;
  options.keep = false;
  std::uint64_t seen = 0;
  bool in_order = true;
  options.on_tick = [&](const TickRecord& tick) { in_order = in_order && tick.device.tick == seen++; };
  options.stop = [&] { return seen >= 100; };
  RealtimeReport report;
  const LoopRecords records =
      run_realtime(scenario.haptics, simulation, *device, std::numeric_limits<double>::infinity(), options, report);
  CHECK(records.ticks.empty());
  CHECK(records.solves.empty());
  CHECK(in_order);
  CHECK(seen == report.ticks);
  CHECK(report.stopped);
  options.stop = [] { return false; };
  options.on_tick = [](const TickRecord&) { throw InputError("the disk is full"); };
  CHECK_THROWS_WITH(run_realtime(scenario.haptics, simulation, *device, 5, options, report), "the disk is full");
}

TEST_CASE("The command line records a session, replays it, moves a device by it and refuses garbage") {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  write_file(folder.path() / "s.toml", small_scenario);
  const auto recorded = run_spherecut(
      {"haptics", path("s.toml"), "--out", path("a"), "--duration", "0.3", "--virtual", "--solved-every", "0"});
  REQUIRE(recorded.status == 0);
  CHECK(recorded.out.find("haptic loop in virtual time: 1000 ticks and ") == 0);
  for (const char* clocked : {"latency", "compute time", "overruns", "\ntime:", "\n\n"})
    CHECK(recorded.out.find(clocked) == std::string::npos);
  const auto replayed = run_spherecut({"haptics", "--replay", path("a/haptic.recording"), "--out", path("b")});
  CHECK(replayed.status == 0);
  CHECK(replayed.out.find("the same, bit by bit") != std::string::npos);
  const std::string ticks = read_file(folder.path() / "a/haptic_ticks.csv");
  CHECK(ticks == read_file(folder.path() / "b/haptic_ticks.csv"));
  const std::string held = small_scenario + "[haptics]\ndevice = \"recording\"\n";
  write_file(folder.path() / "r.toml", held + "recording = \"a/haptic.recording\"\n");
  REQUIRE(run_spherecut(
              {"haptics", path("r.toml"), "--out", path("c"), "--duration", "0.3", "--virtual", "--solved-every", "0"})
              .status == 0);
  CHECK(ticks == read_file(folder.path() / "c/haptic_ticks.csv"));
  write_file(folder.path() / "n.toml", held);
  CHECK(run_spherecut({"check", path("n.toml")}).status == 2);
  write_file(folder.path() / "g", "SPHCREC\n\1");
  CHECK(run_spherecut({"haptics", "--replay", path("g"), "--out", path("d")}).status == 2);
  CHECK(run_spherecut({"haptics", "--out", path("d")}).status == 2);
}
