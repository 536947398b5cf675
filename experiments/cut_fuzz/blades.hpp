// Random and degenerate blades against an organ.
#pragma once

#include "topology/domain/domain.hpp"

#include <random>

namespace spherecut::experiments {

struct FuzzOrgan {
  std::string name;
  topology::SurfaceMesh surface;
  std::shared_ptr<const topology::Domain> domain;
};

/// The sheets of a cut as they grow: each stage begins with the triangles of the one before.
struct FuzzCut {
  std::string kind;
  std::vector<std::vector<topology::SurfaceMesh>> stages;
};

/// Kinds of blades: swept by a blade with random edge and path, zero steps and re-entries among them; random flat and
/// waved sheets, alone and crossing; and degenerate ones against this organ's own mesh: through its vertices, along its
/// edges, in the planes of its triangles, tangent and grazing at distances down to rounding, its own triangles, cut
/// twice in one place with the same and with other steps, closed sheets, needles and triangles without area.
int fuzz_kind_count();

FuzzCut make_fuzz_cut(const FuzzOrgan& organ, int kind, std::mt19937_64& random);
/// The blade of a number, which alone decides about it.
FuzzCut make_fuzz_cut(const FuzzOrgan& organ, int number);

} // namespace spherecut::experiments
