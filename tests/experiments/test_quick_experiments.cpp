// The quick variant of every experiment: same code as the full run on fewer sizes and seeds, and all its checks hold.
#include "experiments/experiment.hpp"

#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

using namespace spherecut;
using namespace spherecut::experiments;
using spherecut::tests::TemporaryFolder;

namespace {

/// `known`: checks that fail, which the experiment's page says and explains.
void require_quick_run_passes(const std::string& name, const std::set<std::string>& known = {}) {
  const TemporaryFolder folder;
  const std::vector<Check> checks = run_experiment(name, folder.path() / name, true, [](const std::string&) {});
  REQUIRE_FALSE(checks.empty());
  for (const Check& check : checks) {
    INFO(name << ": " << check.name << " = " << check.value << ", " << check.relation << " " << check.bound);
    CHECK(check.pass() == (known.count(check.name) == 0));
  }
  std::ifstream file(folder.path() / name / "summary.json");
  const auto summary = nlohmann::json::parse(file);
  CHECK(summary.at("experiment") == name);
  CHECK(summary.at("checks").size() == checks.size());
  bool table = false, figure = false;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path() / name)) {
    table = table || entry.path().extension() == ".csv";
    figure = figure || entry.path().extension() == ".png";
  }
  CHECK(table);
  CHECK(figure);
}

} // namespace

TEST_CASE("Experiments have distinct names and a purpose") {
  std::set<std::string> names;
  for (const Experiment& experiment : all_experiments()) {
    CHECK(names.insert(experiment.name).second);
    CHECK_FALSE(experiment.purpose.empty());
  }
  CHECK_THROWS_AS(run_experiment("no_such_experiment", "unused", true, [](const std::string&) {}), InputError);
}

TEST_CASE("An experiment refuses a folder that holds results and changes nothing in it") {
  const TemporaryFolder folder;
  const std::filesystem::path kept = folder.path() / "summary.json";
  std::ofstream(kept) << "mine";
  CHECK_THROWS_AS(run_experiment("patch_test", folder.path(), true, [](const std::string&) {}), InputError);
  std::string text;
  std::ifstream(kept) >> text;
  CHECK(text == "mine");
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("Quick patch test: linear fields are reproduced") {
  require_quick_run_passes("patch_test");
}

TEST_CASE("Quick smooth convergence: second order, every seed alike, forces in balance") {
  require_quick_run_passes("smooth_convergence");
}

TEST_CASE("Quick punch: force and far boundary agree with the exact contact") {
  require_quick_run_passes("punch");
}

TEST_CASE("Quick Hertz: force and far boundary agree with the exact contact") {
  require_quick_run_passes("hertz");
}

TEST_CASE("Quick hemisphere palpation: the whole organ at 500 nodes against finite elements") {
  require_quick_run_passes("hemisphere_palpation");
}

TEST_CASE("Quick method comparison: no node set goes astray with either method") {
  require_quick_run_passes("method_comparison");
}

TEST_CASE("Quick liver palpation: the force settles and both methods agree on it") {
  require_quick_run_passes("liver_palpation");
}

TEST_CASE("Quick cut fuzz: every kind of blade on every organ") {
  require_quick_run_passes("cut_fuzz");
}

TEST_CASE("Quick straight crack: opening and intensities in three modes") {
  require_quick_run_passes("precut_straight");
}

TEST_CASE("Quick penny crack: opening volume, displacement and intensities") {
  require_quick_run_passes("precut_penny");
}

TEST_CASE("Quick penny crack in torsion and in shear: K_II and K_III along the front") {
  require_quick_run_passes("precut_torsion");
}

TEST_CASE("Quick elliptical crack: K_I along the front") {
  require_quick_run_passes("precut_ellipse");
}

TEST_CASE("Quick spherical cap crack: K_I and K_II along the front") {
  require_quick_run_passes("precut_lens");
}

TEST_CASE("Quick sensitivity: half and twice a tuned number") {
  require_quick_run_passes("sensitivity");
}

TEST_CASE("Quick kinked slit: opening") {
  require_quick_run_passes("precut_kinked");
}

TEST_CASE("Quick crossing slits: openings") {
  require_quick_run_passes("precut_crossing");
}

TEST_CASE("Quick edge-notched strip: intensity") {
  require_quick_run_passes("precut_edge");
}

TEST_CASE("Quick stress intensities: straight and round fronts") {
  require_quick_run_passes("sif");
}

TEST_CASE("Quick front_position: a front that moves by a tenth of a spacing at a time") {
  require_quick_run_passes("front_position");
}

TEST_CASE("Quick layers: two materials in one body") {
  require_quick_run_passes("layers");
}

TEST_CASE("Quick kink: the first new piece of sheet") {
  require_quick_run_passes("kink");
}

TEST_CASE("Quick penny growth: onset, pressure, roundness and energy") {
  require_quick_run_passes("penny_growth");
}

TEST_CASE("Quick double cantilever that tears: load, straight front, energy") {
  require_quick_run_passes("beam_tearing");
}

TEST_CASE("Quick spacing independence: onset and path of a tear on three spacings") {
  require_quick_run_passes("spacing_independence");
}

TEST_CASE("Quick flap: a grasper tears a flap of liver on") {
  require_quick_run_passes("flap");
}

TEST_CASE("Quick double cantilever: compliance") {
  require_quick_run_passes("precut_beam");
}

TEST_CASE("Quick cutting force: steady force, first rupture, balance of work") {
  require_quick_run_passes("cutting_force");
}

TEST_CASE("Quick severed cube: no coupling, rigid motions") {
  require_quick_run_passes("sever");
}

TEST_CASE("Quick reprojection: a cut that grows and one made at once") {
  require_quick_run_passes("reprojection");
}

TEST_CASE("Quick closed cut: stuck lips are as stiff as none") {
  require_quick_run_passes("closed_cut_compression");
}

TEST_CASE("Quick extrapolation: the force between solves against solving at every tick") {
  require_quick_run_passes("extrapolation");
}

TEST_CASE("Quick force continuity: no step beyond that of the solved force") {
  require_quick_run_passes("force_continuity");
}

TEST_CASE("Quick passivity: the port takes energy up to the device's limit, and swings up beyond it uncontrolled") {
  require_quick_run_passes("passivity");
}

TEST_CASE("Quick haptic loop: every tick of a short session on a liver is made") {
  require_quick_run_passes("haptic_loop");
}

TEST_CASE("Quick remeshing ledger: every back end opens the penny as it should, and better on a finer mesh") {
  require_quick_run_passes("remeshing_ledger");
}

TEST_CASE("Quick solve rate: the steps that are timed give forces") {
  require_quick_run_passes("solve_rate");
}

TEST_CASE("Quick real world: what people bring gets its right answer or a clear word") {
  require_quick_run_passes("real_world");
}

TEST_CASE("Quick finite patch: a constant deformation of 40 % is reproduced") {
  require_quick_run_passes("finite_patch");
}

TEST_CASE("Quick finite exact: stretched and bent blocks agree with the closed forms") {
  require_quick_run_passes("finite_exact");
}

TEST_CASE("Quick finite locking: a bonded block does not lock") {
  require_quick_run_passes("finite_locking");
}

TEST_CASE("Quick tissue fuzz: every step of random laws, cuts and motions finds a sound state") {
  require_quick_run_passes("tissue_fuzz");
}

TEST_CASE("Quick pure shear crack: its release is the energy of the strip ahead") {
  require_quick_run_passes("pure_shear_crack");
}

TEST_CASE("Quick gaping: a cut block that is stretched opens as in finite elements") {
  require_quick_run_passes("gaping");
}

TEST_CASE("Quick truth cube: plates that slip give the closed form, forces settle with the nodes") {
  require_quick_run_passes("truth_cube");
}

TEST_CASE("Quick liver blade: steady force of the measured toughness, balance of work") {
  require_quick_run_passes("liver_blade");
}

TEST_CASE("Quick slicing: less force and an earlier cut the more the edge slices") {
  require_quick_run_passes("push_slice");
}

TEST_CASE("Quick wire: toughness at no radius, slope of the wear") {
  require_quick_run_passes("wire_cutting", {"wire_cutting_transition"});
}

TEST_CASE("Quick skin wound: the hole in a plate, a piece free of stress") {
  require_quick_run_passes("skin_wound", {"skin_wound_isotropic_length", "skin_wound_isotropic_width",
                                          "skin_wound_isotropic_area", "skin_wound_fibres_area"});
}
