// The binary as a user meets it: exit status, messages, and what is left on disk.
#include "src/base/version.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/files/surface_io.hpp"
#include "topology/organ/organs.hpp"

#include <catch2/catch.hpp>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

using namespace spherecut;
using namespace spherecut::tests;
using Catch::Contains;
using Catch::StartsWith;

namespace {

const std::filesystem::path source(SPHERECUT_SOURCE_DIR);

std::size_t lines_in(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

// A scenario whose organ is a surface file beside it.
std::string with_file(const std::string& name) {
  return replaced(small_scenario, "shape = \"block\"\nsize = [0.06, 0.06, 0.03]\nedge = 0.006\n",
                  "shape = \"file\"\nfile = \"" + name + "\"\n");
}

topology::SurfaceMesh small_block() {
  return topology::make_block(Vector3(0.06, 0.06, 0.03), 0.01);
}

std::string obj_text(const topology::SurfaceMesh& mesh) {
  std::ostringstream out;
  out.precision(17);
  for (const Vector3& x : mesh.vertices)
    out << "v " << x.x() << ' ' << x.y() << ' ' << x.z() << '\n';
  for (const Triangle& t : mesh.triangles)
    out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  return out.str();
}

topology::SurfaceMesh joined(topology::SurfaceMesh a, const topology::SurfaceMesh& b, const Vector3& shift) {
  const int first = static_cast<int>(a.vertices.size());
  for (const Vector3& x : b.vertices)
    a.vertices.push_back(x + shift);
  for (const Triangle& t : b.triangles)
    a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return a;
}

} // namespace

TEST_CASE("An unknown command is named") {
  const ProgramResult unknown = run_spherecut({"bogus"});
  CHECK(unknown.status == 2);
  CHECK_THAT(unknown.err, Catch::Contains("unknown command 'bogus'"));
  CHECK_THAT(run_spherecut({"experiment", "hertz"}).err, Catch::Contains("unknown command 'hertz'"));
  CHECK_THAT(run_spherecut({"run", "a.toml"}).err, Catch::Contains("--out is required"));
}

TEST_CASE("Of a command line that lacks something too, what is unknown is named") {
  struct Case {
    std::vector<std::string> arguments;
    std::string said;
  };
  const std::vector<Case> cases = {
      {{"run", "s.toml", "--otu", "x"}, "unknown option '--otu' (spherecut run --help)"},
      {{"run", "s.toml", "--otu=x"}, "unknown option '--otu=x' (spherecut run --help)"},
      {{"run", "s.toml", "x"}, "unexpected argument 'x' (spherecut run --help)"},
      {{"run", "s.toml", "--otu", "--out"}, "unknown option '--otu' (spherecut run --help)"},
      {{"check", "-q"}, "unknown option '-q' (spherecut check --help)"},
      {{"check", "a.toml", "b.toml", "c.toml"}, "unexpected argument 'b.toml', 'c.toml' (spherecut check --help)"},
      {{"haptics", "--virtua"}, "unknown option '--virtua' (spherecut haptics --help)"},
      {{"serve", "--prot", "80"}, "unknown option '--prot' (spherecut serve --help)"},
      {{"experiment", "run", "--otu", "x"}, "unknown option '--otu' (spherecut experiment run --help)"},
      {{"experiment", "list", "hertz"}, "unexpected argument 'hertz' (spherecut experiment list --help)"},
      {{"scenario-help", "--mark"}, "unknown option '--mark' (spherecut scenario-help --help)"},
      {{"--loud"}, "unknown option '--loud' (spherecut --help)"},
  };
  for (const Case& c : cases) {
    const ProgramResult result = run_spherecut(c.arguments);
    CHECK(result.status == 2);
    CHECK(result.err == "spherecut: error: " + c.said + "\n");
  }
}

TEST_CASE("A file or folder without a name is refused by every command") {
  const std::vector<std::vector<std::string>> commands = {{"run", "s.toml", "--out", ""},
                                                          {"haptics", "s.toml", "--out", ""},
                                                          {"haptics", "--replay", "r", "--out", ""},
                                                          {"serve", "--port", "0", "--out", ""},
                                                          {"experiment", "run", "kink", "--out", ""}};
  for (const auto& arguments : commands) {
    const ProgramResult result = run_spherecut(arguments);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, StartsWith("spherecut: error: --out: the name is empty;") && Contains("--help"));
    CHECK(lines_in(result.err) == 1);
  }
  CHECK_THAT(run_spherecut({"check", ""}).err, StartsWith("spherecut: error: scenario: the name is empty;"));
  CHECK_THAT(run_spherecut({"serve", "--page", ""}).err, StartsWith("spherecut: error: --page: the name is empty;"));
}

TEST_CASE("Help, version and scenario-help succeed") {
  CHECK(run_spherecut({"--help"}).status == 0);
  const ProgramResult version = run_spherecut({"--version"});
  CHECK(version.status == 0);
  CHECK_THAT(version.out, StartsWith("spherecut " + std::string(app::version())));
  const ProgramResult help = run_spherecut({"scenario-help"});
  CHECK(help.status == 0);
  CHECK_THAT(help.out, Contains("poisson_ratio") && Contains("[[fixed]]"));
  CHECK(run_spherecut({"experiment", "list"}).status == 0);
}

TEST_CASE("A bad command line exits with 2 and one line that says why") {
  const std::vector<std::vector<std::string>> commands = {{},
                                                          {"fly"},
                                                          {"run"},
                                                          {"run", "x.toml"},
                                                          {"check", "x.toml", "--loud"},
                                                          {"experiment", "run", "none", "--out", "/x"}};
  for (const auto& arguments : commands) {
    const ProgramResult result = run_spherecut(arguments);
    INFO(result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, StartsWith("spherecut: error: "));
    CHECK(lines_in(result.err) == 1);
  }
}

TEST_CASE("A run leaves rows, frames, series, figures and a summary that agree") {
  const TemporaryFolder folder;
  const auto scenario =
      write_file(folder.path() / "case.toml", replaced(small_scenario, "figures = false", "figures = true"));
  const auto out = folder.path() / "out";
  const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.out, Contains("peak force"));

  std::istringstream rows(read_file(out / "forces.csv"));
  std::string header;
  std::getline(rows, header);
  const auto columns = std::count(header.begin(), header.end(), ',');
  CHECK_THAT(header, StartsWith("time_s,tool_x_m"));
  double peak = 0;
  int count = 0;
  for (std::string row; std::getline(rows, row); ++count) {
    CHECK(std::count(row.begin(), row.end(), ',') == columns);
    std::istringstream cells(row);
    std::string cell;
    std::vector<double> values;
    while (std::getline(cells, cell, ','))
      values.push_back(std::stod(cell));
    peak = std::max(peak, values.at(10));
    const auto vector = [&](std::size_t at) { return Vector3(values.at(at), values.at(at + 1), values.at(at + 2)); };
    CHECK((vector(27) + vector(31) - vector(7)).norm() <= 1e-8 * values[10]); // normal, tangential, force
    CHECK(values.at(30) == Approx(vector(27).norm()).epsilon(1e-8));
    CHECK(values.at(34) == 0); // without friction
  }
  CHECK(count == 5);

  const auto summary = nlohmann::json::parse(read_file(out / "summary.json"));
  CHECK(summary["status"] == "complete");
  CHECK(summary["interrupted"] == false);
  CHECK(summary["touched"] == true);
  CHECK(summary["steps"]["done"] == 5);
  CHECK(summary["peak_force"]["newtons"].get<double>() == Approx(peak).epsilon(1e-6));
  CHECK(summary["peak_force"]["normal_N"] == summary["peak_force"]["vector_N"]);
  CHECK(summary["peak_force"]["tangential_N"] == nlohmann::json({0.0, 0.0, 0.0}));
  CHECK(summary["solver"]["condition_estimate"].get<double>() > 1);
  CHECK(summary["inputs"]["scenario_text"].get<std::string>() == read_file(scenario));

  const std::string series = read_file(out / "series.pvd");
  int frames = 0;
  for (const auto& entry : std::filesystem::directory_iterator(out / "frames")) {
    CHECK_THAT(series, Contains("file=\"frames/" + entry.path().filename().string() + "\""));
    ++frames;
  }
  CHECK(frames == 15); // surface, nodes and tool in each of five
  for (const std::string name : {"force.png", "profile.png"})
    CHECK_THAT(read_file(out / name), StartsWith("\x89PNG"));

  SECTION("a second run into the same folder is refused and changes nothing") {
    const std::string before = read_file(out / "forces.csv");
    const ProgramResult again = run_spherecut({"run", scenario, "--out", out});
    CHECK(again.status == 2);
    CHECK_THAT(again.err, Contains("holds results already"));
    CHECK(read_file(out / "forces.csv") == before);
  }
}

TEST_CASE(
    "A run that cuts leaves rows, wound, sheets, figures and a summary that agree, the same on one thread and two") {
  const TemporaryFolder folder;
  const auto scenario = write_file(
      folder.path() / "case.toml",
      replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\npretension = [0.05, 0, 0]") +
          replaced(small_scenario.substr(small_scenario.find("[tool]")), "figures = false", "figures = true") +
          "[blade]\nedge = [[0, -0.04, 0], [0, 0.04, 0]]\nstep = 0.5\n"
          "[[blade.path]]\ntime = 1\nposition = [0.022, 0, 0.036]\n"
          "[[blade.path]]\ntime = 2\nposition = [0.020, 0, 0.018]\n");
  const auto without_times = [](const std::filesystem::path& file) {
    std::istringstream rows(read_file(file));
    std::string kept;
    std::string header;
    std::getline(rows, header);
    std::vector<bool> is_time;
    std::istringstream names(header);
    for (std::string name; std::getline(names, name, ',');)
      is_time.push_back(name == "seconds" || (name != "time_s" && name.size() > 2 && name.ends_with("_s")));
    for (std::string row; std::getline(rows, row);) {
      std::istringstream cells(row);
      std::size_t column = 0;
      for (std::string cell; std::getline(cells, cell, ','); ++column)
        kept += column < is_time.size() && is_time[column] ? "," : cell + ",";
      kept += '\n';
    }
    return kept;
  };
  std::string forces;
  std::string cuts;
  nlohmann::json cut;
  for (const std::string threads : {"1", "2"}) {
    const auto out = folder.path() / ("out" + threads);
    const ProgramResult result = run_shell("OPENBLAS_NUM_THREADS=" + threads + " OMP_NUM_THREADS=" + threads + " " +
                                           spherecut_command({"run", scenario, "--out", out, "--threads", threads}));
    INFO(result.err);
    REQUIRE(result.status == 0);
    CHECK_THAT(result.out, Contains("peak force") && Contains("cut of") && Contains("1 piece"));
    const auto summary = nlohmann::json::parse(read_file(out / "summary.json"));
    CHECK(summary["cut"]["pieces"] == 1);
    REQUIRE(summary["cut"]["piece_checks"].size() >= 1);
    const auto& check = summary["cut"]["piece_checks"].back();
    CHECK(check["components_agree"] == true);
    REQUIRE(check["voxel_volumes_m3"].size() == 1);
    CHECK(check["voxel_volumes_m3"][0].get<double>() == Approx(0.06 * 0.06 * 0.03).epsilon(0.05));
    CHECK(check["hausdorff_m"].get<double>() <= check["voxel_size_m"].get<double>());
    CHECK(summary["cut"]["opening_m"].get<double>() > 1e-5);
    CHECK(summary["cut"]["area_m2"].get<double>() == Approx(0.06 * 0.012).epsilon(0.05));
    const std::string rows = read_file(out / "cuts.csv");
    CHECK_THAT(rows, Contains(summary["cut"]["surface_hash"].get<std::string>()));
    if (threads == "1") {
      forces = without_times(out / "forces.csv");
      cuts = without_times(out / "cuts.csv");
      cut = summary["cut"];
    }
    CHECK(without_times(out / "forces.csv") == forces);
    CHECK(without_times(out / "cuts.csv") == cuts);
    CHECK(summary["cut"] == cut);
    for (const std::string name : {"force.png", "profile.png", "opening.png", "cut.png"})
      CHECK_THAT(read_file(out / name), StartsWith("\x89PNG"));
    const std::string series = read_file(out / "series.pvd");
    for (const auto& entry : std::filesystem::directory_iterator(out / "frames"))
      CHECK_THAT(series, Contains("file=\"frames/" + entry.path().filename().string() + "\""));
    const std::string wound = read_file(out / "frames/surface_00006.vtp");
    CHECK_THAT(wound, Contains("Name=\"part\"") && Contains("Name=\"piece\"") && Contains("displacement [m]"));
    CHECK_THAT(read_file(out / "frames/incision_00006.vtp"), Contains("NumberOfLines=") && Contains("Name=\"sheet\""));
  }
}

TEST_CASE("Motions that no tissue makes end a run as a numerical failure, with the rows before them") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  const auto run = [&](const std::string& text) {
    return run_spherecut({"run", write_file(folder.path() / "case.toml", text), "--out", out});
  };
  const std::string allowed = "allowed: up to 0.6 m, 10 times the organ's largest extent";
  SECTION("a cut blown up") {
    const ProgramResult result = run(cut_block + disc_precut + "pressure = 1e9\n[output]\nfigures = false\n");
    CHECK(result.status == 3);
    CHECK_THAT(result.err, StartsWith("spherecut: error: t = 0 s: ") && Contains(allowed) && Contains("fine_spacing"));
    CHECK(lines_in(result.err) == 1);
    CHECK(lines_in(read_file(out / "cuts.csv")) == 1);
  }
  SECTION("a patch pulled away") {
    const ProgramResult result =
        run(cut_block + "[tool]\nshape = \"grasper\"\nradius = 0.01\nstep = 0.25\n"
                        "[[tool.path]]\ntime = 0\nposition = [0, 0, 0.03]\n"
                        "[[tool.path]]\ntime = 1\nposition = [0, 0, 1.03]\n[output]\nfigures = false\n");
    CHECK(result.status == 3);
    CHECK_THAT(result.err, StartsWith("spherecut: error: t = 0.75 s: the node at") && Contains(allowed));
    CHECK(lines_in(read_file(out / "forces.csv")) == 4); // the columns' names, 0, 0.25 and 0.5 s
    const auto summary = nlohmann::json::parse(read_file(out / "summary.json"));
    CHECK(summary["status"] == "failed");
    CHECK(summary["steps"]["done"] == 3);
  }
}

TEST_CASE("Bad scenarios and surface files exit with 2, a clear line, and leave nothing behind") {
  const TemporaryFolder folder;
  const topology::SurfaceMesh block = small_block();
  const std::string good = obj_text(block);
  const auto flip = [](topology::SurfaceMesh mesh) {
    for (Triangle& t : mesh.triangles)
      std::swap(t[1], t[2]);
    return mesh;
  };
  topology::SurfaceMesh open = block;
  open.triangles.resize(open.triangles.size() / 2);
  topology::SurfaceMesh fin = block; // a third triangle on an edge
  fin.vertices.emplace_back(0, 0, 0.1);
  fin.triangles.push_back({fin.triangles[0][0], fin.triangles[0][1], static_cast<int>(fin.vertices.size()) - 1});
  topology::SurfaceMesh flat = block;
  for (Vector3& x : flat.vertices)
    x.z() = 0;
  std::string garbage;
  for (int i = 0; i < 5000; ++i)
    garbage += static_cast<char>((i * 7919) % 251);

  struct Case {
    std::string name, contents;
  };
  const std::vector<Case> refused = {
      {"empty.obj", ""},
      {"cut.obj", good.substr(0, good.size() - 5) + "9999 1"},
      {"garbage.stl", garbage},
      {"garbage.ply", garbage},
      {"nan.obj", replaced(good, "v ", "v nan ")},
      {"open.obj", obj_text(open)},
      {"fin.obj", obj_text(fin)},
      {"crossing.obj", obj_text(joined(block, block, {0.01, 0.013, 0.011}))},
      {"two.obj", obj_text(joined(block, block, {0.2, 0, 0}))},
      {"flat.obj", obj_text(flat)},
  };
  for (const Case& c : refused) {
    write_file(folder.path() / c.name, c.contents);
    const auto scenario = write_file(folder.path() / "case.toml", with_file(c.name));
    const auto out = folder.path() / "out";
    const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
    INFO(c.name << ": " << result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, StartsWith("spherecut: error: ") && Contains(c.name));
    CHECK_FALSE(std::filesystem::exists(out));
  }

  const auto says = [&](const std::string& text) {
    return run_spherecut({"check", write_file(folder.path() / "case.toml", text)});
  };
  const ProgramResult missing = says(with_file("nowhere.obj"));
  CHECK(missing.status == 2);
  CHECK_THAT(missing.err, Contains("nowhere.obj"));

  write_file(folder.path() / "inside_out.obj", obj_text(flip(block)));
  const ProgramResult mended = says(with_file("inside_out.obj"));
  INFO(mended.err);
  CHECK(mended.status == 0);
  CHECK_THAT(mended.out, Contains("inside out"));

  topology::SurfaceMesh millimetres = block;
  for (Vector3& x : millimetres.vertices)
    x *= 1000;
  write_file(folder.path() / "millimetres.obj", obj_text(millimetres));
  const ProgramResult sized =
      says(replaced(with_file("millimetres.obj"), "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                    "lower = [-100, -100, -1]\nupper = [100, 100, 1]"));
  CHECK_THAT(sized.out,
             Contains("warning") && Contains("60 m across") && Contains("in millimetres? use scale = 0.001"));
  const ProgramResult scaled = says(replaced(with_file("millimetres.obj"), "file = \"millimetres.obj\"\n",
                                             "file = \"millimetres.obj\"\nscale = 0.001\n"));
  INFO(scaled.err);
  CHECK(scaled.status == 0);
  CHECK_THAT(scaled.out, !Contains("warning"));

  CHECK(says(replaced(small_scenario, "poisson_ratio = 0.3", "poisson_ratio = 0.5")).status == 2);
  CHECK(says(replaced(small_scenario, "young_modulus = 1e4", "young_modulus = 0")).status == 2);
  CHECK(says(small_scenario).status == 0);
}

TEST_CASE("Scenarios that cannot be run exit with 2, a line that says why, and leave nothing behind") {
  const std::string region = "[[fixed]]\nname = \"base\"\nregion = \"box\"\nlower = [-1, -1, -0.001]\n"
                             "upper = [1, 1, 0.001]\n";
  const auto approach = small_scenario.find("[tool.approach]");
  const auto output = small_scenario.find("[output]");
  const std::string inside = small_scenario.substr(0, approach) +
                             "[[tool.path]]\ntime = 0\nposition = [0, 0, 0.02]\n"
                             "[[tool.path]]\ntime = 1\nposition = [0, 0, 0.01]\n" +
                             small_scenario.substr(output);
  struct Case {
    std::string name, text, said;
  };
  const std::vector<Case> refused = {
      {"nothing fixed", replaced(small_scenario, region, ""), "fixed is missing"},
      {"empty region",
       replaced(small_scenario, "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                "lower = [-1, -1, -0.2]\nupper = [1, 1, -0.1]"),
       "no surface node"},
      {"too few nodes",
       replaced(replaced(small_scenario, "fine_spacing = 0.004", "fine_spacing = 0.5"), "coarse_spacing = 0.012",
                "coarse_spacing = 0.5"),
       "case.toml: [nodes] fine_spacing and coarse_spacing: the wall at"},
      {"inside the organ", inside, "case.toml:24: tool.path[1].position = [0, 0, 0.02] m: the tool starts inside"},
      {"incompressible", replaced(small_scenario, "poisson_ratio = 0.3", "poisson_ratio = 0.5"), "poisson_ratio"},
      {"without stiffness", replaced(small_scenario, "young_modulus = 1e4", "young_modulus = -1"), "young_modulus"},
      {"held at a point",
       replaced(small_scenario, "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                "lower = [0.029, 0.029, -0.001]\nupper = [0.031, 0.031, 0.001]"),
       "case.toml:9: fixed: 1 node held leaves the organ 3 of 6 rigid motions"},
      {"pressed where it is held", replaced(small_scenario, "upper = [1, 1, 0.001]", "upper = [1, 1, 1]"),
       "case.toml:18: no free surface node within"},
      {"appended by collocation", small_scenario + "[method]\nname = \"collocation\"\n[cut]\nsight = \"appended\"\n",
       "cut.sight = \"appended\" with method.name = \"collocation\""},
      {"not a scenario", "[organ\n", "case.toml"},
  };
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  for (const Case& c : refused) {
    const auto scenario = write_file(folder.path() / "case.toml", c.text);
    const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
    INFO(c.name << ": " << result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, StartsWith("spherecut: error: ") && Contains(c.said));
    CHECK_FALSE(std::filesystem::exists(out));
    const ProgramResult checked = run_spherecut({"check", scenario});
    CHECK(checked.status == 2);
    CHECK(checked.err == result.err);
    CHECK_THAT(checked.out, !Contains("good"));
  }
}

TEST_CASE("A tool that never touches is a result, not an error") {
  const TemporaryFolder folder;
  const auto from = small_scenario.find("[tool.approach]");
  const auto scenario = write_file(folder.path() / "case.toml",
                                   small_scenario.substr(0, from) +
                                       "path = [{time = 0, position = [0, 0, 0.05]}, {time = 1, position = [0.1, 0, "
                                       "0.05]}]\n");
  const auto out = folder.path() / "out";
  const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK_THAT(result.out, Contains("no contact"));
  const auto summary = nlohmann::json::parse(read_file(out / "summary.json"));
  CHECK(summary["touched"] == false);
  CHECK(summary["peak_force"].is_null());
  CHECK(lines_in(read_file(out / "forces.csv")) == 6);
}

TEST_CASE("An output folder that cannot be made exits with 2") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "case.toml", small_scenario);
  const auto file = write_file(folder.path() / "file", "mine");
  for (const std::string& out : {file.string(), (file / "inside").string(), std::string("/proc/spherecut")}) {
    const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
    INFO(result.err);
    CHECK(result.status == 2);
    CHECK_THAT(result.err, Contains("output folder"));
  }
  CHECK(read_file(file) == "mine");
}

TEST_CASE("A run that may write no more exits with 2 and keeps the rows it had") {
  const TemporaryFolder folder;
  // A limit on the size of files stands for the full disk: the first frame does not fit, the rows do.
  const auto scenario = write_file(folder.path() / "case.toml",
                                   replaced(small_scenario, "figures = false", "vtp_every = 3\nfigures = false"));
  const auto out = folder.path() / "out";
  const ProgramResult result = run_shell("ulimit -f 16; " + spherecut_command({"run", scenario, "--out", out}));
  INFO(result.err);
  CHECK(result.status == 2);
  CHECK_THAT(result.err, Contains("cannot be written"));
  CHECK(lines_in(read_file(out / "forces.csv")) >= 2);
  CHECK_THAT(result.err, Contains("kept in " + out.string() + ": forces.csv with "));
  CHECK_FALSE(std::filesystem::exists(out / "series.pvd"));
  CHECK_FALSE(std::filesystem::exists(out / "frames"));
  const auto summary = nlohmann::json::parse(read_file(out / "summary.json")); // small enough, and says what happened
  CHECK(summary["status"] == "failed");
  CHECK_THAT(summary["message"].get<std::string>(), Contains("cannot be written"));
  CHECK(summary["files"] == nlohmann::json({"forces.csv", "summary.json"}));
}

TEST_CASE("A full disk exits with 2 and keeps the rows it had") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "case.toml", small_scenario);
  const auto disk = folder.path() / "disk";
  std::filesystem::create_directory(disk);
  if (run_shell("mount -t tmpfs -o size=320k tmpfs '" + disk.string() + "'").status != 0)
    return; // only root may mount; the limit on file sizes above covers the same path
  const ProgramResult result = run_spherecut({"run", scenario, "--out", disk / "out"});
  const std::string rows = read_file(disk / "out/forces.csv"), series = read_file(disk / "out/series.pvd");
  std::map<std::string, std::string> frames;
  for (const auto& entry : std::filesystem::directory_iterator(disk / "out/frames"))
    frames[entry.path().filename().string()] = read_file(entry.path());
  run_shell("umount '" + disk.string() + "'");
  INFO(result.err);
  CHECK(result.status == 2);
  CHECK_THAT(result.err, StartsWith("spherecut: error: " + (disk / "out/frames/").string()) &&
                             Contains("cannot be written: No space left on device") &&
                             Contains("kept in " + (disk / "out").string() + ": forces.csv with ") &&
                             Contains("Make room"));
  CHECK(lines_in(rows) >= 2);
  CHECK(rows.back() == '\n');
  CHECK(std::count(rows.begin(), rows.end(), ',') % static_cast<long>(lines_in(rows)) == 0); // whole rows
  CHECK_THAT(result.err, Contains(fmt::format("series.pvd with {} frame", frames.size() / 3)));
  CHECK(frames.size() % 3 == 0);
  std::size_t named = 0;
  for (const auto& [name, text] : frames) {
    CHECK_THAT(series, Contains("file=\"frames/" + name + "\""));
    CHECK_THAT(text, Catch::EndsWith("</VTKFile>\n"));
    ++named;
  }
  CHECK(static_cast<std::size_t>(std::count(series.begin(), series.end(), '\n')) == named + 5);
}

TEST_CASE("An interrupted run keeps its rows, says so in the summary and exits with 130") {
  const TemporaryFolder folder;
  // Far more steps than there is time for.
  const auto scenario =
      write_file(folder.path() / "case.toml", replaced(replaced(small_scenario, "step = 0.25", "step = 0.00001"),
                                                       "figures = false", "vtp_every = 0\nfigures = false"));
  for (const std::string signal : {"INT", "TERM"}) {
    const auto out = folder.path() / signal;
    const std::string rows = "'" + (out / "forces.csv").string() + "'";
    const ProgramResult result = run_shell(
        spherecut_command({"run", scenario, "--out", out}) + " & run=$!; until [ \"$(wc -l 2>/dev/null <" + rows +
        " || echo 0)\" -gt 3 ]; do kill -0 $run || break; sleep 0.05; done; kill -" + signal + " $run; wait $run");
    INFO(result.err);
    CHECK(result.status == 130);
    const auto summary = nlohmann::json::parse(read_file(out / "summary.json"));
    CHECK(summary["interrupted"] == true);
    CHECK(summary["status"] == "interrupted");
    CHECK(lines_in(read_file(out / "forces.csv")) == summary["steps"]["done"].get<std::size_t>() + 1);
    CHECK(summary["steps"]["done"].get<int>() < summary["steps"]["planned"].get<int>());
  }
}

TEST_CASE("A haptic session interrupted while it prepares says that nothing was run") {
  const TemporaryFolder folder;
  const auto text = write_file(folder.path() / "text", small_scenario);
  const auto out = folder.path() / "out";
  const std::string pipe = (folder.path() / "case.toml").string();
  // The program waits at the pipe for its scenario when the signal comes.
  const ProgramResult result = run_shell(
      "mkfifo '" + pipe + "'; " + spherecut_command({"haptics", pipe, "--duration", "100", "--out", out}) +
      " & run=$!; exec 3>'" + pipe + "'; kill -INT $run; cat '" + text.string() + "' >&3; exec 3>&-; wait $run");
  INFO(result.out << result.err);
  CHECK(result.status == 130);
  CHECK_THAT(result.out, Contains("interrupted while preparing: nothing was run") && !Contains("ticks/s, 0 overruns"));
  const auto findings = nlohmann::json::parse(read_file(out / "haptic.json"));
  CHECK(findings["interrupted"] == true);
  CHECK(findings["ticks"] == 0);
}

namespace {

/// The command, sent SIGINT once what it prints holds `line`.
ProgramResult interrupted_after(const std::string& line, const std::vector<std::string>& arguments,
                                const TemporaryFolder& folder) {
  const std::string said = "'" + (folder.path() / "said").string() + "'";
  return run_shell(
      spherecut_command(arguments) + " >" + said + " & run=$!; until grep -q '" + line + "' " + said +
      " 2>/dev/null; do kill -0 $run || break; sleep 0.02; done; kill -INT $run; wait $run; status=$?; cat " + said +
      "; exit $status");
}

} // namespace

TEST_CASE("An interrupted experiment says so and exits with 130") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  const ProgramResult result =
      interrupted_after("yardstick", {"experiment", "run", "solve_rate", "--out", out.string()}, folder);
  INFO(result.out << result.err);
  CHECK(result.status == 130);
  CHECK_THAT(result.out, Contains("interrupted: nothing was checked") && Contains(out.string()));
  CHECK(!std::filesystem::exists(out / "summary.json"));
}

TEST_CASE("An experiment that comes to no next line ends all the same when it is interrupted") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  // Its first line would come after a minute in real time.
  const ProgramResult result =
      run_shell(spherecut_command({"experiment", "run", "haptic_loop", "--out", out}) + " & run=$!; until [ -d '" +
                out.string() + "' ]; do kill -0 $run || break; sleep 0.05; done; kill -INT $run; wait $run");
  INFO(result.out << result.err);
  CHECK(result.status == 130);
  CHECK_THAT(result.out, Contains("interrupted: nothing was checked") && Contains(out.string()));
  CHECK(lines_in(result.out) == 1);
  CHECK(!std::filesystem::exists(out / "summary.json"));
}

TEST_CASE("A haptic session interrupted while it is solved again off line keeps its ticks") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "case.toml", small_scenario);
  const auto out = folder.path() / "out";
  const ProgramResult result = interrupted_after(
      "solving off line",
      {"haptics", scenario.string(), "--virtual", "--duration", "60", "--solved-every", "1", "--out", out.string()},
      folder);
  INFO(result.out << result.err);
  CHECK(result.status == 130);
  CHECK_THAT(result.out, Contains("interrupted: the session is complete"));
  CHECK(lines_in(read_file(out / "haptic_ticks.csv")) == 60'001);
  const auto findings = nlohmann::json::parse(read_file(out / "haptic.json"));
  CHECK(findings["ticks"] == 60'000);
  CHECK(findings["interrupted"] == false);
  CHECK(findings["model_error_N"]["ticks"] == 0);
}

TEST_CASE("A cut that is not open is said to be closed, without digits below the accuracy") {
  const TemporaryFolder folder;
  const auto out = folder.path() / "out";
  const auto scenario = write_file(folder.path() / "case.toml", cut_block + disc_precut);
  const ProgramResult result = run_spherecut({"run", scenario, "--out", out});
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK_THAT(result.out, Contains(", closed") && Contains("it stays closed") && !Contains("e-"));
}

TEST_CASE("A mesh in millimetres taken as metres is warned about in the summary too") {
  const TemporaryFolder folder;
  topology::SurfaceMesh millimetres = small_block(); // of 6 mm, so that as metres it has a node for every metre
  for (Vector3& x : millimetres.vertices)
    x *= 100;
  write_file(folder.path() / "millimetres.obj", obj_text(millimetres));
  std::string text = replaced(with_file("millimetres.obj"), "lower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]",
                              "lower = [-100, -100, -1]\nupper = [100, 100, 1]");
  text = replaced(text, "target = [0, 0, 0.03]", "target = [0, 0, 3]");
  text = replaced(text, "fine_spacing = 0.004\ncoarse_spacing = 0.012\nfine_radius = 0.006",
                  "fine_spacing = 0.6\ncoarse_spacing = 1\nfine_radius = 0.6");
  const auto out = folder.path() / "out";
  const ProgramResult result = run_spherecut({"run", write_file(folder.path() / "case.toml", text), "--out", out});
  INFO(result.out << result.err);
  CHECK(result.status == 0);
  const std::string summary = read_file(out / "summary.json");
  CHECK_THAT(summary, Contains("in millimetres? use scale = 0.001"));
}

TEST_CASE("The shipped scenarios pass the check") {
  for (const std::string name : {"block_punch", "hemisphere_palpation", "cylinder_slide", "liver_tear"}) {
    const ProgramResult result = run_spherecut({"check", source / "scenarios" / (name + ".toml")});
    INFO(name << ": " << result.err);
    CHECK(result.status == 0);
    CHECK_THAT(result.out, Contains(": good"));
  }
}
