// Scenarios of organs as they come: from files, thin, under loads alone, with sheets that reach out of them.
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "topology/files/surface_io.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <set>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

const std::string held_base = held_below("0.0005");

std::string from_file(const std::string& file, const std::string& keys = "") {
  return "[organ]\nshape = \"file\"\nfile = \"" + file + "\"\n" + keys +
         "[material]\nyoung_modulus = 1e4\npoisson_ratio = 0.3\n" + held_base;
}

/// A cube of 20 mm with an island beside it, written in millimetres.
topology::SurfaceMesh cube_and_island() {
  topology::SurfaceMesh mesh = topology::make_block(Vector3::Zero(), Vector3(20, 20, 20), 4);
  const topology::SurfaceMesh island = topology::make_block(Vector3(30, 0, 10), Vector3(32, 2, 12), 2);
  const int offset = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), island.vertices.begin(), island.vertices.end());
  for (const Triangle& t : island.triangles)
    mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return mesh;
}

bool warns(const Session& session, const std::string& part) {
  const std::vector<std::string>& all = session.warnings();
  return std::any_of(all.begin(), all.end(), [&](const std::string& one) { return one.find(part) != one.npos; });
}

/// Corner nodes of a sheet of 60 x 3 x 60 mm that hangs by its upper edge.
std::string hanging_sheet(const std::string& more = "") {
  return "[organ]\nshape = \"block\"\nsize = [0.06, 0.003, 0.06]\nedge = 0.004\n[material]\nyoung_modulus = 1e7\n"
         "poisson_ratio = 0.3\ndensity = 1000\n[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 0.0595]\n"
         "normal = [0, 0, -1]\n[gravity]\nacceleration = [0, -3, -10]\n" +
         more;
}

} // namespace

TEST_CASE("An island is refused with the key that helps, and left out by it") {
  const TemporaryFolder folder;
  topology::write_surface(folder.path() / "island.obj", cube_and_island());
  const auto scenario = [&](const std::string& keys) {
    return write_file(folder.path() / "case.toml", from_file("island.obj", "scale = 0.001\n" + keys) + ball_tool);
  };
  const ProgramResult refused = run_spherecut({"check", scenario("").string()});
  CHECK(refused.status == 2);
  CHECK_THAT(refused.err, Contains("island.obj") && Contains("organ.pieces = \"largest\""));
  const auto mended = folder.path() / "mended.obj";
  const std::string largest = scenario("pieces = \"largest\"\n").string();
  const ProgramResult checked = run_spherecut({"check", largest, "--write", mended.string()});
  INFO(checked.out << checked.err);
  CHECK(checked.status == 0);
  CHECK_THAT(checked.out, Contains("left out 1 of 2 separate pieces") && Contains("mended.obj"));
  // In the unit of its file: the same scenario takes it as it is.
  const topology::PolygonSoup written = topology::read_polygons(mended);
  CHECK(written.vertices.size() == topology::make_block(Vector3::Zero(), Vector3(20, 20, 20), 4).vertices.size());
  write_file(folder.path() / "again.toml", from_file("mended.obj", "scale = 0.001\n") + ball_tool);
  const ProgramResult again = run_spherecut({"check", (folder.path() / "again.toml").string()});
  CHECK(again.status == 0);
  CHECK_THAT(again.out, !Contains("warning: left out"));
  // What is there is not written over.
  CHECK(run_spherecut({"check", largest, "--write", mended.string()}).status == 2);
}

TEST_CASE("A label belongs to a label volume") {
  const TemporaryFolder folder;
  topology::write_surface(folder.path() / "island.obj", cube_and_island());
  CHECK_THROWS_WITH(
      read_scenario(write_file(folder.path() / "case.toml", from_file("island.obj", "label = 2\n") + ball_tool)),
      Contains("organ.label = 2") && Contains(".nii.gz"));
}

TEST_CASE("Weight alone is something to compute: a column sinks by half its strain at the foot") {
  const std::string column =
      "[organ]\nshape = \"block\"\nsize = [0.02, 0.02, 0.04]\nedge = 0.01\n[material]\nyoung_modulus = 5000\n"
      "poisson_ratio = 0.3\ndensity = 1000\n[nodes]\ncoarse_spacing = 0.006\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 1e-4]\nnormal = [0, 0, 1]\naxes = [\"z\"]\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [-0.0099, 0, 0]\nnormal = [1, 0, 0]\naxes = [\"x\"]\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [0, -0.0099, 0]\nnormal = [0, 1, 0]\naxes = [\"y\"]\n";
  CHECK_THAT(complaint(column), Contains("nothing to compute") && Contains("gravity"));
  Session session = session_of(column + "[gravity]\nacceleration = [0, 0, -9.81]\n");
  run(session);
  CHECK(session.model().at({0, 0, 0.04}).displacement.z() ==
        Approx(-1000 * 9.81 * 0.04 * 0.04 / (2 * 5000)).epsilon(0.03));
  // And pretension: it shortens by the strain that it is let go from.
  Session stretched = session_of(replaced(column, "density = 1000", "pretension = [0, 0, 0.05]"));
  run(stretched);
  CHECK(stretched.model().at({0, 0, 0.04}).displacement.z() == Approx(-0.05 * 0.04).epsilon(0.03));
}

TEST_CASE("A derived spacing is no reason to refuse the coarse one that is given") {
  const std::string text = block_organ + held_base + "[nodes]\ncoarse_spacing = 0.0025\n" + disc_precut;
  const Session session = session_of(text);
  CHECK(session.zone().spacing.coarse == 0.0025);
  CHECK(session.zone().spacing.fine <= 0.0025);
  const Session pressed = session_of(block_organ + held_base + "[nodes]\ncoarse_spacing = 0.003\n" + ball_tool);
  CHECK(pressed.zone().spacing.fine == 0.003);
  CHECK_THROWS_WITH(session_of(text + "[cut]\nfront_spacing = 0.004\n"), Contains("cut.front_spacing = 0.004"));
}

TEST_CASE("One cut has the same nodes however far its sheet reaches out of the body") {
  std::set<int> counts;
  for (const double reach : {0.02, 0.2, 2.0}) {
    const std::string text =
        block_organ + held_base +
        rectangle_precut(fmt::format("[0, 0, {}]", 0.015 + 0.5 * (0.015 + reach)), "[1, 0, 0]", "[0, 0, 1]",
                         fmt::format("{}", 0.06 + 2 * reach), fmt::format("{}", 0.015 + reach));
    const Session session = session_of(text);
    counts.insert(session.model().sprinkling.nodes.size());
    CHECK(session.zone().spacing.fine == Approx(0.15 * 0.015)); // of its depth in the body
  }
  CHECK(counts.size() == 1);
}

TEST_CASE("A sheet that ends just below the surface is cut through to it, and that is said") {
  const auto front_of = [](double below, bool& said) {
    const std::string text = cut_block + rectangle_precut(fmt::format("[0, 0, {}]", 0.03 - below - 0.006), "[1, 0, 0]",
                                                          "[0, 0, 1]", "0.02", "0.012");
    const Session session = session_of(text);
    said = warns(session, "cut through to the surface");
    return session.model().incision->front_length();
  };
  bool said = false;
  CHECK(front_of(1e-5, said) == Approx(0.02 + 2 * 0.012).epsilon(0.01));
  CHECK(said);
  CHECK(front_of(2e-4, said) == Approx(2 * (0.02 + 0.012)).epsilon(0.01));
  CHECK_FALSE(said);
}

TEST_CASE("A sheet whose border passes through the surface does not end below it") {
  const Session session = session_of(
      "[organ]\nshape = \"hemisphere\"\nradius = 0.03\n[material]\nyoung_modulus = 1e4\npoisson_ratio = 0.3\n" +
      held_below("0.0001") + "[cut]\nfront_spacing = 0.004\n" +
      rectangle_precut("[0, 0, 0.012]", "[1, 0, 0]", "[0, 0, 1]", "0.03", "0.03"));
  CHECK_FALSE(warns(session, "its sheet ended"));
}

TEST_CASE("A small piece is judged by the nodes that it gets") {
  // A corner of 9 mm, on nodes 12 mm apart where nothing asks for finer ones.
  const std::string corner = rectangle_precut("[0.0255, 0.0255, 0.0255]", "[1, 1, 1]", "[1, -1, 0]", "0.08", "0.08") +
                             "[cut]\nunheld = \"hold\"\n";
  const Session session = session_of(cut_block + corner);
  const auto& nodes = session.model().sprinkling.nodes;
  int in_corner = 0;
  for (const Vector3& x : nodes.positions)
    in_corner += x.sum() > 3 * 0.0255 ? 1 : 0;
  CHECK(in_corner >= 8);
  CHECK_THROWS_WITH(session_of(replaced(cut_block, "fine_spacing = 0.005", "fine_spacing = 0.012") + corner),
                    Contains("smaller than the node spacing there") && Contains("cut.front_spacing"));
}

TEST_CASE("Nodes that nobody has chosen follow a thin wall; chosen ones that cannot bend it are refused") {
  const Session session = session_of(hanging_sheet());
  CHECK(session.zone().spacing.coarse == Approx(0.0015).epsilon(0.02));
  REQUIRE(session.walls().thinnest);
  CHECK(session.walls().thinnest->width == Approx(0.003));
  CHECK_FALSE(warns(session, "the wall at"));
  CHECK_THROWS_WITH(session_of(hanging_sheet("[nodes]\ncoarse_spacing = 0.006\n")),
                    Contains("is 3 mm thick") && Contains("6 mm apart") && Contains("nodes.coarse_spacing = 0.0015"));
  const Session some = session_of(hanging_sheet("[nodes]\ncoarse_spacing = 0.0025\n"));
  CHECK(warns(some, "is 3 mm thick"));
  CHECK(warns(some, "1.2 spacings"));
}

TEST_CASE("The margin of a liver is no wall that is too thin for its nodes") {
  const Session session = session_of("[organ]\nshape = \"liver\"\ntriangles = 5000\n[material]\nyoung_modulus = 6e3\n"
                                     "poisson_ratio = 0.45\n" +
                                     held_below("-0.02") +
                                     "[nodes]\nfine_spacing = 0.008\n"
                                     "coarse_spacing = 0.03\n[gravity]\nacceleration = [0, 0, -9.81]\n");
  CHECK(session.model().sprinkling.nodes.size() > 100);
  const Session derived = session_of("[organ]\nshape = \"liver\"\ntriangles = 5000\n[material]\nyoung_modulus = 6e3\n"
                                     "poisson_ratio = 0.45\n" +
                                     held_below("-0.02") + "[gravity]\nacceleration = [0, 0, -9.81]\n");
  CHECK(derived.model().sprinkling.nodes.size() < 4000);
}

TEST_CASE("The summary and the check tell of walls and gaps") {
  const TemporaryFolder folder;
  const auto file = write_file(folder.path() / "case.toml", small_scenario);
  const ProgramResult checked = run_spherecut({"check", file.string()});
  CHECK_THAT(checked.out, Contains("thickness: 30 mm in the middle"));
  REQUIRE(run_spherecut({"run", file.string(), "--out", (folder.path() / "out").string()}).status == 0);
  const auto summary = nlohmann::json::parse(read_file(folder.path() / "out" / "summary.json"));
  const auto& walls = summary.at("inputs").at("organ").at("walls");
  CHECK(walls.at("thinnest_wall").at("width_m").get<double>() == Approx(0.03));
  CHECK(walls.at("narrowest_gap").is_null());
}

TEST_CASE("A check estimates nodes, memory and time, and says when a scenario is heavy") {
  const TemporaryFolder folder;
  const auto checked = [&](const std::string& text) {
    return run_spherecut({"check", write_file(folder.path() / "case.toml", text).string()}).out;
  };
  CHECK_THAT(checked(small_scenario), Contains("estimate: 0.") && Contains("GB") && !Contains("heavy"));
  const std::string fine = replaced(replaced(small_scenario, "fine_spacing = 0.004", "fine_spacing = 0.0018"),
                                    "coarse_spacing = 0.012", "coarse_spacing = 0.0018");
  CHECK_THAT(checked(fine), Contains("this is heavy") && Contains("nodes.count"));
}
