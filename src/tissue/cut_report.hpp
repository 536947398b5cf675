// What a cut has come to: the numbers of cuts.csv.
#pragma once

#include "src/blade/force.hpp"
#include "src/model/body_model.hpp"
#include "src/model/body_update.hpp"
#include "src/tissue/log.hpp"
#include "topology/wound/wound.hpp"

namespace spherecut::app {

/// The cut at the end of a step, and how the body followed what the blade cut in it.
struct CutReport : BodyUpdate {
  int triangles = 0;                 // of sheet, added in this step
  bool refused = false;              // the cut of this step; everything is as before it
  std::string reason;                // why it was refused, or why the blade added nothing
  double area = 0, front_length = 0; // m2 and m, inside the body
  int sheets = 0;
  int pieces = 1;
  std::vector<double> volumes; // m3, of the pieces, largest first
  int unheld = 0;              // pieces that no fixed region holds
  double opening = 0;          // m, largest distance between the faces along their normal; 0: held together
  double opening_volume = 0;   // m3, between the faces
  int lip_pairs = 0, closed_pairs = 0;
  bool lips_converged = true;
  std::uint64_t surface_hash = 0; // of the wound at rest
  BladeReport blade;              // where the tissue has a toughness

  /// With a later cut of the same step: triangles, refusals, stages, and how the body followed.
  void add(const CutReport& later);
};

/// Nodes of a body that has been built, and what of the time of its assembly, s, was sight and factorisation.
void report_body(const BodyModel& body, double sight, BodyUpdate& report);

/// How far the faces of the cut have parted: largest as the surface shows it that is written, corner by corner. The
/// volume takes them to part with the root of the distance from the front, where that surface is flat from corner to
/// corner.
struct Opening {
  double largest = 0; // m, largest distance between two corners at one place of a sheet, along its normal
  double volume = 0; // m3, the integral of the opening over the sheets, each face displaced as the material on its side
};
Opening opening_of(const topology::Wound& wound, const BodyModel& model);

/// The cut of a step is refused, and why; the report has nothing of it else.
void refuse_cut(double time, const char* why, CutReport& report, SessionLog& log);

} // namespace spherecut::app
