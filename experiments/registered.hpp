// The run functions of all experiments, one per folder. experiment.cpp lists them with their names.
#pragma once

#include "experiments/experiment.hpp"

namespace spherecut::experiments {

std::vector<Check> run_patch_test(const ExperimentContext& context);
std::vector<Check> run_smooth_convergence(const ExperimentContext& context);
std::vector<Check> run_punch(const ExperimentContext& context);
std::vector<Check> run_hertz(const ExperimentContext& context);
std::vector<Check> run_hemisphere_palpation(const ExperimentContext& context);
std::vector<Check> run_method_comparison(const ExperimentContext& context);
std::vector<Check> run_liver_palpation(const ExperimentContext& context);
std::vector<Check> run_cut_fuzz(const ExperimentContext& context);
std::vector<Check> run_closed_cut_compression(const ExperimentContext& context);
std::vector<Check> run_reprojection(const ExperimentContext& context);
std::vector<Check> run_precut_straight(const ExperimentContext& context);
std::vector<Check> run_precut_penny(const ExperimentContext& context);
std::vector<Check> run_precut_torsion(const ExperimentContext& context);
std::vector<Check> run_precut_ellipse(const ExperimentContext& context);
std::vector<Check> run_precut_lens(const ExperimentContext& context);
std::vector<Check> run_front_position(const ExperimentContext& context);
std::vector<Check> run_precut_edge(const ExperimentContext& context);
std::vector<Check> run_precut_kinked(const ExperimentContext& context);
std::vector<Check> run_precut_crossing(const ExperimentContext& context);
std::vector<Check> run_precut_beam(const ExperimentContext& context);
std::vector<Check> run_sif(const ExperimentContext& context);
std::vector<Check> run_kink(const ExperimentContext& context);
std::vector<Check> run_penny_growth(const ExperimentContext& context);
std::vector<Check> run_beam_tearing(const ExperimentContext& context);
std::vector<Check> run_spacing_independence(const ExperimentContext& context);
std::vector<Check> run_flap(const ExperimentContext& context);
std::vector<Check> run_cutting_force(const ExperimentContext& context);
std::vector<Check> run_sever(const ExperimentContext& context);
std::vector<Check> run_extrapolation(const ExperimentContext& context);
std::vector<Check> run_force_continuity(const ExperimentContext& context);
std::vector<Check> run_passivity(const ExperimentContext& context);
std::vector<Check> run_haptic_loop(const ExperimentContext& context);
std::vector<Check> run_solve_rate(const ExperimentContext& context);
std::vector<Check> run_real_world(const ExperimentContext& context);
std::vector<Check> run_sensitivity(const ExperimentContext& context);
std::vector<Check> run_finite_patch(const ExperimentContext& context);
std::vector<Check> run_finite_exact(const ExperimentContext& context);
std::vector<Check> run_finite_locking(const ExperimentContext& context);
std::vector<Check> run_tissue_fuzz(const ExperimentContext& context);
std::vector<Check> run_pure_shear_crack(const ExperimentContext& context);
std::vector<Check> run_gaping(const ExperimentContext& context);
std::vector<Check> run_layers(const ExperimentContext& context);

} // namespace spherecut::experiments
