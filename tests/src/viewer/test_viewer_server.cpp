// A live session over the wire, with clients of its own: one viewer, two, two hands of one, and what lies beside the
// files.
#include "tests/src/viewer/live_server.hpp"

#include <catch2/catch.hpp>
#include <fmt/format.h>
#include <sys/stat.h>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

TEST_CASE("One viewer presses and cuts while another watches, over the wire") {
  const Served served;
  Viewer first(served.port());
  Viewer second(served.port(), 1); // as viewers were before there were torques
  REQUIRE(first.until([&] { return first.pictures > 0 && !first.welcome.is_null(); }));
  CHECK(first.welcome["version"] == 2);
  CHECK(first.session["modes"] == Json({"probe", "blade"}));
  CHECK(first.welcome["scenarios"].size() == 2);
  CHECK(first.topologies == 1);
  first.say({{"type", "take"}});
  REQUIRE(first.until([&] { return first.holder["id"] == first.welcome["id"]; }));
  REQUIRE(second.until([&] { return second.holder["id"] == first.welcome["id"]; }));

  SECTION("a press is felt, shown, and pushes the tool off the hand") {
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.027});
    REQUIRE(first.until([&] { return force_of(first) > 0.02 && first.value<std::uint32_t>(56) == 2; }));
    CHECK(first.vector(116).z() > 0);
    CHECK((first.value<std::uint32_t>(44) & 1U) == 1);
    REQUIRE(first.until([&] { return first.vector(76).z() - first.vector(64).z() > 1e-5; }));
    REQUIRE(second.until([&] { return force_of(second) > 0.02; })); // who watches sees the same
    CHECK(second.welcome["version"] == 1);
    CHECK(second.value<std::uint16_t>(2) == 248);
    CHECK(first.value<std::uint16_t>(2) == 272);
    const Vector3 arm = 0.01 * first.vector(104); // of the ball's centre, on whose line the force acts
    CHECK((first.vector(248) - arm.cross(first.vector(116))).norm() < 1e-3 * arm.norm() * force_of(first));
    second.say({{"type", "pose"}, {"n", 1}, {"position", {0, 0, 0.2}}});
    second.say({{"type", "take"}});
    REQUIRE(second.until([&] { return second.errors.size() == 2; }));
    CHECK(second.errors[0]["code"] == "no_tool");
    CHECK(second.errors[1]["code"] == "taken");
    first.say({{"type", "overlays"},
               {"colour", "von_mises"},
               {"nodes", true},
               {"stages", true},
               {"pick", {0, 0, 0.03}},
               {"slice", {{"point", {0, 0, 0.015}}, {"normal", {0, 1, 0}}, {"size", 0.08}, {"count", 16}}}});
    REQUIRE(first.until([&] { return !Viewer::section(first.picture, 20).empty(); }));
    std::uint32_t vertices = 0;
    std::memcpy(&vertices, first.picture.data() + 40, 4);
    CHECK(Viewer::section(first.picture, 16).size() == 12 * vertices);
    CHECK(Viewer::section(first.picture, 17).size() == 12 + 4 * vertices);
    CHECK(Viewer::section(first.picture, 20).size() == 40 + 8 * 256);
    CHECK(Viewer::section(first.picture, 22).size() == 32);
    const std::string nodes = Viewer::section(first.picture, 18);
    std::uint32_t count = 0;
    std::memcpy(&count, nodes.data(), 4);
    CHECK(count > 50);
    CHECK(nodes.size() == 4 + 17 * count);
    CHECK(Viewer::section(first.picture, 19).size() > 28);
    // The slice is 80 mm wide about the middle of a block of 60 x 30 mm: outside at its corner, 14 mm deep in its
    // middle.
    const std::string slice = Viewer::section(first.picture, 20);
    const auto distance = [&](std::size_t row, std::size_t column) {
      float value = 0;
      std::memcpy(&value, slice.data() + 40 + 4 * (16 * row + column), 4);
      return static_cast<double>(value);
    };
    CHECK(distance(0, 0) == Approx(std::hypot(0.01, 0.025)).margin(2e-3));
    CHECK(distance(7, 7) == Approx(-0.015 + 0.04 / 15).margin(2e-3));
    CHECK(Viewer::section(second.picture, 18).empty()); // only who asked
  }

  SECTION("a cut where the blade is drawn changes the surface, parts the lips, and a reset heals it") {
    first.say({{"type", "mode"}, {"mode", "blade"}});
    REQUIRE(first.until([&] { return first.mode["mode"] == "blade"; }));
    for (int step = 0; step <= 30; ++step) {
      first.pose({0.002, -0.045 + 0.002 * step, 0.018});
      const int seen = first.frames;
      REQUIRE(first.until([&] { return first.frames > seen; }));
    }
    REQUIRE(first.until([&] { return first.value<std::uint32_t>(56) == first.number && first.topologies > 1; }));
    CHECK(first.value<float>(216) > 1e-4); // m2
    CHECK(first.value<float>(224) > 2e-4); // m, it gapes
    const std::string pairs = Viewer::section(first.topology, 6);
    REQUIRE(pairs.size() > 80);
    const std::string places = Viewer::section(first.picture, 16);
    double apart = 0;
    for (std::size_t k = 0; k < pairs.size(); k += 8) {
      std::array<std::uint32_t, 2> pair{};
      std::memcpy(pair.data(), pairs.data() + k, 8);
      std::array<std::array<float, 3>, 2> ends{};
      for (std::size_t i = 0; i < 2; ++i)
        std::memcpy(ends[i].data(), places.data() + 12 * pair[i], 12);
      apart = std::max(apart, static_cast<double>(std::abs(ends[0][0] - ends[1][0])));
    }
    CHECK(apart > 2e-4);
    CHECK(second.until([&] { return second.topologies > 1; }));
    first.say({{"type", "reset"}});
    REQUIRE(first.until(
        [&] { return first.session["epoch"] == 2 && !first.frame.empty() && first.value<std::uint32_t>(12) == 2; }));
    CHECK(first.value<float>(216) == 0);
    // The blade rests in the organ, as it did when the new session took over: it does not come through the surface.
    for (int again = 0; again < 12; ++again) {
      first.pose({0.002, 0.015, 0.018});
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    REQUIRE(first.until([&] { return !first.errors.empty(); }));
    CHECK(first.errors[0]["about"] == "pose");
    CHECK(first.value<float>(216) == 0);
    CHECK(first.vector(64).norm() > 0.04);
    first.pose({0.002, -0.045, 0.018});
    REQUIRE(first.until([&] { return (first.vector(64) - Vector3(0.002, -0.045, 0.018)).norm() < 1e-4; }));
    first.pose({0.002, 0.015, 0.018});
    CHECK(first.until([&] { return first.value<float>(216) > 1e-4; }));
    CHECK(first.errors.size() == 1);
  }

  SECTION("what cannot be built is told, and the session stays") {
    first.say({{"type", "scenario"}, {"name", "bad.toml"}});
    REQUIRE(first.until([&] { return first.errors.size() == 1; }));
    CHECK(first.errors[0]["code"] == "refused");
    CHECK_THAT(first.errors[0]["text"].get<std::string>(), Catch::Contains("young_modulus"));
    first.say({{"type", "scenario"}, {"name", "../live.toml"}});
    first.say({{"type", "set"}, {"coarse_spacing", 1e-4}, {"fine_spacing", 1e-3}});
    REQUIRE(first.until([&] { return first.errors.size() == 3; }));
    CHECK(first.session["epoch"] == 1);
    first.say({{"type", "set"}, {"young_modulus", 2e4}});
    REQUIRE(first.until([&] { return first.session["epoch"] == 2; }));
    CHECK(first.session["settings"]["young_modulus"] == 2e4);
  }

  SECTION("a solve that fails is told in words, and the session goes on") {
    first.pose({0.045, 0, 0.028});
    first.pose({0.031, 0, 0.022}); // into the side that is held
    REQUIRE(first.until([&] { return !first.errors.empty(); }));
    CHECK(first.errors[0]["code"] == "solver");
    CHECK(first.errors[0]["about"] == "session");
    CHECK(first.errors[0]["text"].get<std::string>().size() > 20);
    first.say({{"type", "park"}});
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.027});
    CHECK(first.until([&] { return force_of(first) > 0.02 && (first.value<std::uint32_t>(44) & 32U) == 0; }));
  }

  SECTION("the tool comes free with its holder, and a recording replays") {
    // A link out of the folder that leads nowhere is no name to write to.
    const std::filesystem::path outside = served.folder().path() / "outside";
    std::filesystem::create_directories(served.folder().path() / "recordings");
    std::filesystem::create_symlink(outside, served.folder().path() / "recordings" / "session-1.recording");
    first.say({{"type", "record"}, {"on", true}});
    REQUIRE(first.until([&] { return first.recording["on"] == true; }));
    Viewer later(served.port());
    CHECK(later.until([&] { return !later.recording.is_null() && later.recording["on"] == true; }));
    first.pose({0, 0, 0.035});
    first.pose({0, 0, 0.028});
    REQUIRE(first.until([&] { return force_of(first) > 0.01; }));
    first.say({{"type", "record"}, {"on", false}});
    REQUIRE(first.until([&] { return first.recording["on"] == false; }));
    const std::string name = first.recording["name"];
    CHECK(name == "session-2.recording");
    CHECK_FALSE(std::filesystem::exists(outside));
    CHECK(std::filesystem::file_size(served.folder().path() / "recordings" / name) > 1000);
    // The same file runs again off line, bit by bit.
    const ProgramResult again =
        run_spherecut({"haptics", "--replay", (served.folder().path() / "recordings" / name).string(), "--out",
                       (served.folder().path() / "again").string()});
    INFO(again.out << again.err);
    CHECK(again.status == 0);
    first.say({{"type", "replay"}, {"name", name}});
    REQUIRE(first.until([&] { return first.replay["on"] == true; }));
    REQUIRE(first.until([&] { return force_of(first) > 0.01 && (first.value<std::uint32_t>(44) & 4U) != 0; }));
    Viewer last(served.port()); // who comes meanwhile is told
    CHECK(last.until([&] { return !last.replay.is_null() && last.replay["name"] == name; }));
    first.say({{"type", "release"}});
    REQUIRE(second.until([&] { return second.holder["id"].is_null(); }));
  }
  CHECK(first.sound);
  CHECK(second.sound);
}

TEST_CASE("Two hands of one viewer: the probe rests on the body while the blade cuts, and a recording has both") {
  const Served served(replaced(live_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 5"));
  Viewer viewer(served.port());
  Viewer watcher(served.port());
  const auto blade = [&](std::size_t offset) { // of section 23
    const std::string bytes = Viewer::section(viewer.frame, 23);
    std::array<float, 3> x{};
    if (bytes.size() == 104)
      std::memcpy(x.data(), bytes.data() + offset, sizeof x);
    return Vector3(x[0], x[1], x[2]);
  };
  const auto has_blade = [&] { return !Viewer::section(viewer.frame, 23).empty(); };
  REQUIRE(viewer.until([&] { return !viewer.session.is_null(); }));
  CHECK(viewer.session["two_hands"] == true);
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 1; }));
  CHECK(viewer.errors[0]["code"] == "no_tool");
  viewer.say({{"type", "take"}});
  viewer.pose_second({0, -0.04, 0.03});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 2; }));
  CHECK(viewer.errors[1]["code"] == "unavailable");
  viewer.say({{"type", "record"}, {"on", true}});
  REQUIRE(viewer.until([&] { return !viewer.recording.is_null() && viewer.recording["on"] == true; }));
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && has_blade(); }));
  CHECK(watcher.until([&] { return !watcher.second.is_null() && watcher.second["on"] == true; }));
  viewer.pose({-0.012, 0, 0.035});
  viewer.pose({-0.012, 0, 0.028}); // the probe presses
  REQUIRE(viewer.until([&] { return viewer.vector(116).norm() > 0.01; }));
  const Vector3 pressing = viewer.vector(116);
  viewer.pose_second({0.012, -0.045, 0.018});
  REQUIRE(viewer.until([&] { return (blade(8) - Vector3(0.012, -0.045, 0.018)).norm() < 1e-4; }));
  viewer.pose_second({0.012, 0.02, 0.018});
  double resisted = 0; // N
  REQUIRE(viewer.until([&] {
    resisted = std::max(resisted, blade(48).norm());
    return viewer.value<float>(216) > 1e-4;
  }));
  CHECK(resisted > 0.01);
  CHECK(viewer.vector(116).norm() > 0.5 * pressing.norm()); // it has not moved
  CHECK(viewer.value<std::uint32_t>(48) == 0);              // and is the probe
  // A session that cannot be replaced goes on with both hands, and whoever asks again is told.
  viewer.second = nullptr;
  viewer.say({{"type", "set"}, {"coarse_spacing", 1e-4}, {"fine_spacing", 1e-3}});
  REQUIRE(viewer.until([&] { return viewer.errors.size() == 3 && !viewer.second.is_null(); }));
  CHECK(viewer.second["on"] == true);
  CHECK(has_blade());
  viewer.second = nullptr;
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return !viewer.second.is_null(); }));
  CHECK(viewer.second["on"] == true);
  // The blade into the first hand: the second has nothing then.
  viewer.say({{"type", "mode"}, {"mode", "blade"}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == false && !has_blade(); }));
  // And into the second again: the first has the probe.
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && viewer.mode["mode"] == "probe" && has_blade(); }));
  viewer.say({{"type", "record"}, {"on", false}});
  REQUIRE(viewer.until([&] { return viewer.recording["on"] == false; }));
  const std::string name = viewer.recording["name"];
  const ProgramResult again =
      run_spherecut({"haptics", "--replay", (served.folder().path() / "recordings" / name).string(), "--out",
                     (served.folder().path() / "again").string()});
  INFO(again.out << again.err);
  CHECK(again.status == 0);
  CHECK_THAT(again.out, Catch::Contains("both hands"));
  viewer.say({{"type", "replay"}, {"name", name}});
  REQUIRE(viewer.until([&] { return viewer.replay["on"] == true; }));
  CHECK(viewer.until([&] { return (viewer.value<std::uint32_t>(44) & 4U) != 0 && blade(48).norm() > 0.01; }));
  // Whoever holds the tool lays both away with it.
  viewer.say({{"type", "replay"}, {"name", nullptr}});
  REQUIRE(viewer.until([&] { return viewer.replay["on"] == false; }));
  viewer.say({{"type", "second"}, {"on", true}});
  REQUIRE(viewer.until([&] { return viewer.second["on"] == true && has_blade(); }));
  viewer.say({{"type", "release"}});
  CHECK(viewer.until([&] { return viewer.second["on"] == false && !has_blade(); }));
  CHECK(viewer.sound);
}

TEST_CASE("What lies beside the scenarios and recordings, and how much of it, stops no viewer") {
  const Served served;
  const auto& folder = served.folder().path();
  REQUIRE(mkfifo((folder / "pipe.toml").c_str(), 0600) == 0);
  std::filesystem::create_symlink("/dev/zero", folder / "endless.toml");
  std::filesystem::create_directory(folder / "folder.toml");
  write_file(folder / "long.toml", "# " + std::string(5'000'000, 'x'));
  const auto recordings = folder / "recordings";
  std::filesystem::create_directory(recordings);
  REQUIRE(mkfifo((recordings / "pipe.recording").c_str(), 0600) == 0);
  for (int i = 0; i < 4000; ++i)
    write_file(recordings / fmt::format("{:04}-{}.recording", i, std::string(200, 'n')), "");
  Viewer viewer(served.port());
  REQUIRE(viewer.until([&] { return !viewer.welcome.is_null(); }));
  const Json& welcome = viewer.welcome;
  std::vector<std::string> names;
  for (const Json& entry : welcome["scenarios"])
    names.push_back(entry["name"]);
  CHECK(names == std::vector<std::string>{"bad.toml", "live.toml", "long.toml"});
  CHECK(welcome["recordings"].size() >= 100);
  CHECK(welcome["recordings"].size() + welcome["recordings_left_out"].get<std::size_t>() == 4000);
  viewer.say({{"type", "take"}});
  for (const std::string name : {"pipe.toml", "endless.toml", "folder.toml", "../live.toml", "long.toml"}) {
    const std::size_t before = viewer.errors.size();
    viewer.say({{"type", "scenario"}, {"name", name}});
    REQUIRE(viewer.until([&] { return viewer.errors.size() > before; }));
    CHECK(viewer.errors.back()["code"] == "refused");
  }
  const std::size_t before = viewer.errors.size();
  viewer.say({{"type", "replay"}, {"name", "pipe.recording"}});
  CHECK(viewer.until([&] { return viewer.errors.size() > before; }));
}

TEST_CASE("A second server is refused the folder that another records into") {
  const Served first;
  const Served second(live_block, first.folder().path() / "recordings");
  Viewer one(first.port()), two(second.port());
  one.say({{"type", "take"}});
  two.say({{"type", "take"}});
  one.say({{"type", "record"}, {"on", true}});
  REQUIRE(one.until([&] { return !one.recording.is_null(); }));
  two.say({{"type", "record"}, {"on", true}});
  REQUIRE(two.until([&] { return !two.errors.empty(); }));
  CHECK_THAT(two.errors.back()["text"].get<std::string>(), Catch::Contains("another run writes into it"));
}

TEST_CASE("Serving with --open shows the page in the user's browser") {
  const TemporaryFolder folder;
  const std::filesystem::path opener =
      write_file(folder.path() / "xdg-open", "#!/bin/sh\nprintf %s \"$1\" > \"$0.url\"\n");
  std::filesystem::permissions(opener, std::filesystem::perms::owner_all);
  const ProgramResult ended =
      run_shell("PATH=" + folder.path().string() + ":$PATH timeout --foreground --preserve-status -s INT 2 " +
                spherecut_command({"serve", write_file(folder.path() / "live.toml", live_block).string(), "--port", "0",
                                   "--open", "--out", (folder.path() / "recordings").string()}));
  CHECK(ended.status == 0);
  std::string url;
  for (int i = 0; i < 1000 && url.empty(); ++i, std::this_thread::sleep_for(std::chrono::milliseconds(20)))
    if (std::filesystem::exists(folder.path() / "xdg-open.url"))
      url = read_file(folder.path() / "xdg-open.url");
  CHECK_THAT(url, Catch::StartsWith("http://127.0.0.1:"));
  CHECK_THAT(ended.out, Catch::Contains("serving at " + url));
}

TEST_CASE("Serving what cannot be served is refused in words, and Ctrl-C ends it cleanly") {
  const TemporaryFolder folder;
  const std::string scenario = write_file(folder.path() / "live.toml", live_block).string();
  WebServerOptions options;
  options.port = 0;
  const WebServer taken(options, {});
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& word) {
    const ProgramResult result = run_spherecut(arguments);
    CAPTURE(result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, Catch::Contains(word));
  };
  refused({"serve", scenario, "--port", std::to_string(taken.port())}, "in use");
  refused({"serve", scenario, "--port", "0", "--address", "nowhere"}, "not an IP address");
  refused({"serve", (folder.path() / "missing.toml").string(), "--port", "0"}, "missing.toml");
  refused({"serve", scenario, "--port", "0", "--page", (folder.path() / "none").string()}, "no such folder");
  const ProgramResult ended = run_shell(
      "timeout --foreground --preserve-status -s INT 2 " +
      spherecut_command({"serve", scenario, "--port", "0", "--out", (folder.path() / "recordings").string()}));
  CHECK(ended.status == 0);
  CHECK_THAT(ended.out, Catch::Contains("serving at http://127.0.0.1:") && Catch::Contains("ended"));
}
