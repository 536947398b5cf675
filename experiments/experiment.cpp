#include "experiments/experiment.hpp"

#include "experiments/measured.hpp"
#include "experiments/real_world/live_situations.hpp"
#include "experiments/registered.hpp"
#include "experiments/remeshing_ledger/run.hpp"
#include "src/base/output_file.hpp"
#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>

namespace spherecut::experiments {

bool Check::pass() const {
  if (!std::isfinite(value))
    return false;
  return relation == "<=" ? value <= bound : value >= bound;
}

const std::vector<Experiment>& all_experiments() {
  static const std::vector<Experiment> experiments = {
      {"patch_test", "a linear field is reproduced on irregular nodes", run_patch_test},
      {"smooth_convergence", "a smooth field converges with the square of the spacing", run_smooth_convergence},
      {"punch", "force and surface of a flat punch on a half-space", run_punch},
      {"hertz", "force, contact radius and surface of a sphere on a half-space", run_hertz},
      {"hemisphere_palpation", "the paper's Figure 3: surface displacement and force against finite elements",
       run_hemisphere_palpation},
      {"liver_palpation", "the paper's Figure 4: a laparoscopic instrument on a liver", run_liver_palpation},
      {"closed_cut_compression", "lips under compression: a closed cut is as stiff as uncut tissue",
       run_closed_cut_compression},
      {"cut_fuzz", "random and degenerate blades leave every wound closed, manifold and of the same volume",
       run_cut_fuzz},
      {"reprojection", "a cut grown in 20 increments gives the field and the surface of the cut made at once",
       run_reprojection},
      {"precut_straight", "opening and stress intensity of a straight crack in modes I, II and III",
       run_precut_straight},
      {"precut_penny", "a disc-shaped crack under pressure and under tilted tension", run_precut_penny},
      {"precut_torsion", "a disc-shaped crack under torsion and under shear: K_II and K_III along the front",
       run_precut_torsion},
      {"precut_ellipse", "an elliptical crack under tension: K_I along the front", run_precut_ellipse},
      {"precut_lens", "a spherical cap crack under hydrostatic tension: K_I and K_II along the front", run_precut_lens},
      {"precut_kinked", "opening of a slit that turns by 45 degrees, against two finite element codes",
       run_precut_kinked},
      {"precut_crossing", "openings of two slits that cross, against two finite element codes", run_precut_crossing},
      {"precut_edge", "stress intensity of an edge-notched strip", run_precut_edge},
      {"precut_beam", "compliance of a double cantilever", run_precut_beam},
      {"cutting_force", "force of a blade: steady cutting, first rupture, balance of work", run_cutting_force},
      {"sever", "a body cut in two: no coupling, rigid motions", run_sever},
      {"front_position", "a front that moves by a tenth of a spacing at a time: energy of each step, openings",
       run_front_position},
      {"sif", "stress intensities and release rate along straight and round fronts", run_sif},
      {"kink", "the direction in which a front in mixed mode tears on", run_kink},
      {"penny_growth", "a penny crack torn on by fluid: onset, pressure against radius, energy", run_penny_growth},
      {"beam_tearing", "a double cantilever that tears: load against opening, straight front, energy",
       run_beam_tearing},
      {"spacing_independence", "onset load and path of a tear on three spacings", run_spacing_independence},
      {"flap", "a cut flap on the liver, pulled by a grasper, tears on", run_flap},
      {"extrapolation", "the force between solves: held, extrapolated in time, and by the condensed contact",
       run_extrapolation},
      {"force_continuity", "the largest step of the force from tick to tick, against the solved force's own",
       run_force_continuity},
      {"passivity", "a light hand on stiff tissue: the loop gives no more energy than it got", run_passivity},
      {"haptic_loop", "60 s of palpating and cutting a liver in real time: time and lateness of every tick",
       run_haptic_loop},
      {"solve_rate", "whole steps from contact to force a second, uncut and while cutting", run_solve_rate},
      {"sensitivity", "what half and twice each tuned number does to the error that it was chosen by", run_sensitivity},
      {"real_world",
       "what people bring: organs from files, thin walls, loads alone, hardware at its own rate, disorder from outside",
       run_real_world},
      {"remeshing_ledger", "time an increment of a cut takes at equal error: finite spheres against finite elements",
       run_remeshing_ledger},
      {"method_comparison", "error against time and robustness over node sets of the methods", run_method_comparison},
      {"finite_patch", "a constant deformation of 40 % with shear is reproduced on irregular nodes", run_finite_patch},
      {"finite_exact", "blocks stretched to twice and half their length and bent by 120 degrees", run_finite_exact},
      {"finite_locking", "a bonded block nearly incompressible is compressed by 30 % and does not lock",
       run_finite_locking},
      {"tissue_fuzz", "random runs of every law of finite strain: does every step find a sound state?",
       run_tissue_fuzz},
      {"pure_shear_crack", "a crack in a wide strip stretched by up to 80 %: its energy release rate",
       run_pure_shear_crack},
      {"gaping", "a cut through half of a block stretched by 20 and 40 % opens as in finite elements", run_gaping},
      {"layers", "two materials in one body: layers compressed and bent, a stiff ball that swells", run_layers},
      {"truth_cube", "a silicone cube under plate and ball: fitted at the smallest compression, the others predicted",
       run_truth_cube},
      {"liver_blade", "a straight edge through a block of liver: force a millimetre, indentation before the cut",
       run_liver_blade},
      {"push_slice", "an edge that slices as it pushes: forces and onset against the slice-push ratio", run_push_slice},
      {"wire_cutting", "force of a wire against its radius: plateau, transition, slope", run_wire_cutting},
      {"skin_wound", "a piece cut out of stretched skin: its shrinking gives the stretch, the hole is predicted",
       run_skin_wound},
  };
  return experiments;
}

std::vector<Check> run_experiment(const std::string& name, const std::filesystem::path& out, bool quick,
                                  const std::function<void(const std::string&)>& say) {
  for (const Experiment& experiment : all_experiments()) {
    if (experiment.name != name)
      continue;
    const app::ResultsClaim claim = app::claim_results_folder(out);
    std::vector<Check> checks = experiment.run({out, quick, say});
    nlohmann::ordered_json summary;
    summary["experiment"] = name;
    summary["quick"] = quick;
    summary["checks"] = nlohmann::ordered_json::array();
    for (const Check& check : checks)
      summary["checks"].push_back({{"name", check.name},
                                   {"value", check.value},
                                   {"relation", check.relation},
                                   {"bound", check.bound},
                                   {"pass", check.pass()}});
    std::ofstream file(out / "summary.json");
    file << summary.dump(2) << '\n';
    if (!file.flush())
      throw InputError(fmt::format("{}: cannot be written", (out / "summary.json").string()));
    return checks;
  }
  std::string known;
  for (const Experiment& experiment : all_experiments())
    known += (known.empty() ? "" : ", ") + experiment.name;
  throw InputError(fmt::format("experiment '{}' does not exist; there are: {}", name, known));
}

} // namespace spherecut::experiments
