#include "src/base/output_file.hpp"
#include "src/output/vtp.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <nlohmann/json.hpp>
#include <regex>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

// Values of one appended array, found as a reader of the format would: by its offset behind the underscore.
template <class T>
std::vector<T> appended_array(const std::string& file, const std::string& name) {
  std::smatch match;
  const std::regex line("Name=\"" + name + "\"[^>]*offset=\"([0-9]+)\"");
  if (!std::regex_search(file, match, line))
    return {};
  const std::string marker = "encoding=\"raw\">\n_";
  const std::size_t start = file.find(marker) + marker.size() + std::stoul(match[1]);
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, file.data() + start, sizeof(bytes));
  std::vector<T> values(bytes / sizeof(T));
  std::memcpy(values.data(), file.data() + start + sizeof(bytes), bytes);
  return values;
}

} // namespace

TEST_CASE("A VTP file gives back points, triangles and data, bit for bit") {
  const TemporaryFolder folder;
  const topology::SurfaceMesh mesh = topology::make_block(Vector3(0.1, 0.2, 0.3), 0.1);
  std::vector<Vector3> displacement;
  std::vector<double> stress;
  for (const Vector3& x : mesh.vertices) {
    displacement.emplace_back(std::sin(x.x()), 1 / 3.0, x.z() * 1e-7);
    stress.push_back(x.norm());
  }
  const auto file = folder.path() / "a.vtp";
  write_vtp(file, mesh.vertices, mesh.triangles, {vector_data("u", displacement), scalar_data("s", stress)});
  const std::string text = read_file(file);
  CHECK_THAT(text, Contains("NumberOfPoints=\"" + std::to_string(mesh.vertices.size()) + "\""));
  CHECK_THAT(text, Contains("NumberOfPolys=\"" + std::to_string(mesh.triangles.size()) + "\""));
  CHECK(appended_array<double>(text, "s") == stress);
  const auto u = appended_array<double>(text, "u");
  const auto points = appended_array<double>(text, "Points");
  REQUIRE(u.size() == 3 * displacement.size());
  REQUIRE(points.size() == u.size());
  for (std::size_t i = 0; i < displacement.size(); ++i) {
    CHECK(Vector3(u[3 * i], u[3 * i + 1], u[3 * i + 2]) == displacement[i]);
    CHECK(Vector3(points[3 * i], points[3 * i + 1], points[3 * i + 2]) == mesh.vertices[i]);
  }
  const auto corners = appended_array<std::int64_t>(text, "connectivity");
  const auto ends = appended_array<std::int64_t>(text, "offsets");
  REQUIRE(corners.size() == 3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    CHECK(ends[t] == static_cast<std::int64_t>(3 * t + 3));
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(corners[3 * t + k] == mesh.triangles[t][k]);
  }
  CHECK_THAT(text, Catch::EndsWith("\n</AppendedData>\n</VTKFile>\n"));
}

TEST_CASE("Points without triangles become vertex cells") {
  const TemporaryFolder folder;
  write_vtp(folder.path() / "p.vtp", {{1, 2, 3}, {4, 5, 6}}, {}, {});
  const std::string text = read_file(folder.path() / "p.vtp");
  CHECK_THAT(text, Contains("NumberOfVerts=\"2\"") && Contains("NumberOfPolys=\"0\""));
  CHECK(appended_array<std::int64_t>(text, "connectivity") == std::vector<std::int64_t>{0, 1});
}

TEST_CASE("Point data of a wrong length is refused") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(write_vtp(folder.path() / "p.vtp", {{1, 2, 3}}, {}, {scalar_data("s", {1, 2})}), std::logic_error);
}

TEST_CASE("A full disk is an InputError that names the file and the reason") {
  if (!std::filesystem::exists("/dev/full"))
    return;
  OutputFile file("/dev/full");
  CHECK_THROWS_WITH(file.write("something"), Contains("/dev/full") && Contains("No space left"));
}

TEST_CASE("A file that cannot be replaced keeps its old contents") {
  const TemporaryFolder folder;
  const auto file = write_file(folder.path() / "kept", "old");
  replace_file(file, "new");
  CHECK(read_file(file) == "new");
  std::filesystem::create_directory(file.string() + ".part"); // the place to write beside it is taken
  CHECK_THROWS_AS(replace_file(file, "newer"), InputError);
  CHECK(read_file(file) == "new");
}

namespace {

void claimed(const std::filesystem::path& folder) {
  static_cast<void>(claim_results_folder(folder));
}

} // namespace

TEST_CASE("A results folder is made, and refused when it holds results or is none") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "a" / "b";
  CHECK(claim_results_folder(out).holds());
  CHECK(std::filesystem::is_directory(out));
  CHECK(std::filesystem::is_empty(out));
  write_file(out / "notes.txt", "mine");
  CHECK(claim_results_folder(out).holds());
  for (const std::string name : {"forces.csv", "summary.json", "series.pvd", "frames"}) {
    write_file(out / name, "old");
    CHECK_THROWS_WITH(claimed(out), Contains("holds results already") && Contains(name));
    CHECK(read_file(out / name) == "old");
    std::filesystem::remove(out / name);
  }
  const auto file = write_file(folder.path() / "file", "");
  CHECK_THROWS_WITH(claimed(file), Contains("file"));
  CHECK_THROWS_WITH(claimed(file / "inside"), Contains("cannot be created"));
}

TEST_CASE("A results folder that somebody writes into is refused, and one that a killed program left locked is not") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  ResultsClaim claim = claim_results_folder(out);
  CHECK_THROWS_WITH(claimed(out), Contains("another run writes into it") && Contains(out.string()));
  ResultsClaim taken = std::move(claim);
  CHECK(taken.holds());
  CHECK_THROWS_AS(claimed(out), InputError);
  taken = ResultsClaim();
  CHECK(std::filesystem::is_empty(out));
  write_file(out / ".spherecut.lock", ""); // of a program that was killed: nobody has it locked
  CHECK(claim_results_folder(out).holds());
}

TEST_CASE("A file that must be new never replaces one, nor goes through a link") {
  const TemporaryFolder folder;
  const auto file = write_file(folder.path() / "kept", "old");
  CHECK_THROWS_AS(OutputFile(file, OutputFile::Made::anew), OutputError);
  std::filesystem::create_symlink(folder.path() / "elsewhere", folder.path() / "link");
  CHECK_THROWS_AS(OutputFile(folder.path() / "link", OutputFile::Made::anew), OutputError);
  CHECK(read_file(file) == "old");
  CHECK(!std::filesystem::exists(folder.path() / "elsewhere"));
}

TEST_CASE("Two runs into one folder at once: the second is refused and the results are the first's") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "s.toml", small_scenario);
  const std::string out = (folder.path() / "out").string();
  const std::string command = spherecut_command({"run", scenario.string(), "--out", out});
  const ProgramResult both =
      run_shell(command + " & first=$!; " + command + "; echo second $?; wait $first; echo first $?");
  INFO(both.out << both.err);
  const bool second_refused =
      both.out.find("second 2") != std::string::npos && both.out.find("first 0") != std::string::npos;
  const bool first_refused =
      both.out.find("second 0") != std::string::npos && both.out.find("first 2") != std::string::npos;
  CHECK(second_refused != first_refused);
  CHECK(!std::filesystem::exists(folder.path() / "out" / ".spherecut.lock"));
}

TEST_CASE("Both summaries give the whole account of a resisted blade's work") {
  const TemporaryFolder folder;
  const std::string scenario =
      write_file(folder.path() / "s.toml",
                 replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10") +
                     "[cut]\nfront_spacing = 0.004\n" +
                     replaced(blade({"[0.004, 0, 0.031]", "[0.003, 0, 0.02]"}, 0.04, "0.1"),
                              "step =", "friction = 50.0\nflank = 0.01\nstep ="))
          .string();
  const auto check = [&](const std::string& command, const std::vector<std::string>& more, const std::string& file,
                         const std::vector<std::string>& place) {
    CAPTURE(command);
    std::vector<std::string> arguments{command, scenario, "--out", (folder.path() / command).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = run_spherecut(arguments);
    INFO(result.out << result.err);
    REQUIRE(result.status == 0);
    CHECK_THAT(result.out, Contains("on new surface") && Contains("friction of the flanks"));
    nlohmann::json account = nlohmann::json::parse(read_file(folder.path() / command / file));
    for (const std::string& key : place)
      account = account.at(key);
    const double work = account.at("work_J");
    REQUIRE(work > 0);
    CHECK(account.at("surface_J").get<double>() > 0.1 * work);
    CHECK(account.at("friction_J").get<double>() > 0.002 * work);
    double others = 0;
    for (const char* key : {"surface_J", "crushing_J", "friction_J", "excess_J", "stored_J"})
      others += account.at(key).get<double>();
    CHECK(others == Approx(work).epsilon(0.02));
  };
  check("run", {}, "summary.json", {"cut", "blade"});
  check("haptics", {"--virtual", "--duration", "1"}, "haptic.json", {"blade"});
}

TEST_CASE("docs/output.md names every column that is written") {
  const TemporaryFolder folder;
  const std::string page = read_file(std::filesystem::path(SPHERECUT_SOURCE_DIR) / "docs/output.md");
  const std::string body = replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 10");
  const auto scenario = [&](const std::string& name, const std::string& rest) {
    return write_file(folder.path() / (name + ".toml"), body + rest).string();
  };
  const auto check = [&](const std::vector<std::string>& arguments, const std::vector<std::string>& files) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--out", (folder.path() / ("out-" + files.front())).string()});
    const ProgramResult result = run_spherecut(all);
    INFO(result.out << result.err);
    REQUIRE(result.status == 0);
    for (const std::string& file : files) {
      const std::string text = read_file(folder.path() / ("out-" + files.front()) / file);
      std::istringstream columns(text.substr(0, text.find('\n')));
      const std::size_t start = page.find("### `" + file + "`");
      CAPTURE(file);
      const bool in_list = file == "haptic_deadlines.csv"; // three columns, named where the file is
      REQUIRE((in_list || start != std::string::npos));
      const std::string section = in_list ? page : page.substr(start, page.find("\n#", start + 5) - start);
      for (std::string column; std::getline(columns, column, ',');) {
        const std::string vector = std::regex_replace(column, std::regex("_[xyz](_|$)"), "_{x,y,z}$1");
        CAPTURE(column);
        CHECK((section.find('`' + column + '`') != std::string::npos ||
               section.find('`' + vector + '`') != std::string::npos));
      }
    }
  };
  const std::string down = blade({"[0.004, 0, 0.031]", "[0.003, 0, 0.029]"}, 0.04, "0.5");
  check({"run", scenario("blade", down + replaced(ball_tool, "0.001", "0.002"))}, {"cuts.csv", "forces.csv"});
  check({"run", scenario("tear", disc_precut + "[tearing]\n" + replaced(ball_tool, "0.001", "0.002"))}, {"tears.csv"});
  check({"haptics", scenario("hand", down), "--virtual", "--duration", "0.1"},
        {"haptic_ticks.csv", "haptic_solves.csv", "haptic_deadlines.csv"});
}
