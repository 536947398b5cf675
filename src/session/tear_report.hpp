// What a tear has come to: the numbers of tears.csv.
#pragma once

#include "src/model/body_model.hpp"
#include "src/model/body_update.hpp"

#include <cmath>
#include <optional>
#include <string>

namespace spherecut::app {

/// Where the work of a run has gone since its first solution, J.
struct EnergyLedger {
  double tool = 0;    // work of the tool on the body, from its force and the motion of its point
  double loads = 0;   // work of gravity, of the pressure in cuts, and of a linear body's pre-strain as the load that
                      // it stands for
  double elastic = 0; // change of the energy of the strain; of a linear body by which it differs from its given shape
  double surface = 0; // toughness times the area torn, and what the loads pay of a blade's cut
  double dissipation = 0; // released beyond that: surplus of unstable and of late growth, letting go
  /// What the account leaves open: the error of the solution and of the release rates.
  [[nodiscard]] double imbalance() const { return tool + loads - elastic - surface - dissipation; }
  /// The same as a share of what was spent; none before anything was.
  [[nodiscard]] std::optional<double> open_share() const {
    const double spent = surface + dissipation;
    return spent > 0 ? std::optional(std::abs(imbalance()) / spent) : std::nullopt;
  }
};

/// Of a solved body, J.
struct Energies {
  double loads = 0;   // forces of the loads times displacement
  double elastic = 0; // of the strain; of a linear body by which it differs from its given shape
  [[nodiscard]] double potential() const { return elastic - loads; } // under a tool that stands still
};
Energies energies(const BodyModel& model);

/// The fronts after loading (number 0: up to where the first of them moves, if one does) or after an increment of the
/// tears.
struct TearIncrement {
  int number = 0;
  double time = 0;                                                 // s; in a step, while the load is followed
  double force = 0;                                                // N, on the tool
  int triangles = 0;                                               // of sheet, added
  double advance = 0;                                              // m, farthest way of the front
  double area = 0;                                                 // m2, of the cut
  double front_length = 0;                                         // m
  Vector3 front = Vector3::Zero();                                 // m, mean of the front
  Vector3 most = Vector3::Zero();                                  // m, its place of largest G / G_c; the next of it:
  solvers::Intensities intensities = solvers::Intensities::Zero(); // Pa sqrt(m)
  double release = 0, toughness = 0;                               // J/m2
  EnergyLedger ledger;
  BodyUpdate body;              // how it followed the increment; of loading (number 0): its nodes alone
  double intensity_seconds = 0; // wall clock of the intensities since the row before
};

/// The tears of a step.
struct TearReport {
  std::vector<TearIncrement> increments; // the state after loading first
  double area = 0;                       // m2 torn since the start
  bool seeded = false;                   // a tear has started where there was no cut
  bool unstable = false;                 // it ran on by itself, with as much or more energy at every increment
  bool severed = false;                  // the body has come apart
  std::string reason;                    // why it tears no further in this step
  EnergyLedger ledger;
};

} // namespace spherecut::app
