// Whether the surface of a wound stays right under random and degenerate blades.
#pragma once

#include "experiments/cut_fuzz/blades.hpp"

#include "topology/wound/wound.hpp"

#include <map>
#include <optional>

namespace spherecut::experiments {

/// The first thing wrong with a wound of an organ of this volume, by means other than those that made it: closed and
/// manifold, finite, components, Euler characteristic and volumes recounted from the triangles, every wall facing its
/// twin, the total volume kept to 1e-9.
std::optional<std::string> wound_defect(const topology::Wound& wound, double organ_volume);

struct FuzzOutcome {
  int blades = 0, stages = 0;
  int opened = 0, severed = 0; // blades that left walls, more than one piece
  int refused = 0;             // blades that were refused, with the state before intact
  int most_pieces = 0;
  double worst_volume = 0;             // relative deviation of the total
  double worst_piece = 0;              // of one piece's volume, growing against at once, of the organ's
  std::map<std::string, int> kinds;    // blades
  std::vector<std::string> failures{}; // organ, number, kind, what is wrong
};

/// Cuts the organ with blades number first to first + count - 1: every stage by growth, the last one at once as well;
/// both must agree in surface hash, components and pieces. Blade numbers alone decide about the blades.
FuzzOutcome cut_fuzz(const FuzzOrgan& organ, int first, int count);

/// Adds one outcome to another.
void add(FuzzOutcome& total, const FuzzOutcome& more);

/// make_block, make_liver, and the surface file that SPHERECUT_LIVER_OBJ names (scale 0.0337), a cylinder without; a
/// block with fissures of 0.1 and 1 mm, a box with walls of 0.5 mm, a block with a closed cavity, and three islands.
std::vector<FuzzOrgan> fuzz_organs();

/// Those whose cuts are solved: the block with fissures, a box whose walls of 5 mm a small body resolves, the cavity
/// and the islands.
std::vector<FuzzOrgan> solved_organs();

} // namespace spherecut::experiments
