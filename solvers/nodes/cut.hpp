// Where the nodes of a cut go: pairs of lip nodes on its sheets and, where wanted, a ring of single nodes ahead of its
// front.
#pragma once

#include "solvers/nodes/search.hpp"
#include "solvers/nodes/sheets.hpp"

namespace spherecut::solvers {

// Distances in units of the spacing h.
constexpr double ring_offset = 0.5;         // of the rings behind and ahead of the front
constexpr double sheet_clearance = 0.35;    // kept by the ring ahead from every sheet
constexpr double crossing_clearance = 0.25; // kept by lip nodes from lines where sheets cross

struct CutNode {
  Vector3 position; // m
  double spacing;   // m
  NodeKind kind;
  Vector3 normal;
};

/// What is there before the nodes of a cut are chosen.
struct Surroundings {
  const NodeGrid* taken = nullptr;     // nodes that stay in any case
  const NodeCloud* previous = nullptr; // nodes that stay when they fit; null: none
  std::vector<int> lips;               // those of `previous` that are lip nodes and stay
  const BoundingBox* region = nullptr; // places outside are left alone; null: none
};

/// Pairs follow one another, the node on the + side of the sheet first. In this order: rings of pairs ring_offset
/// behind the fronts and, with options.ring_ahead, of single nodes as far ahead, spaced by h along them; pairs on the
/// rims and single nodes ahead of the fronts on the surface; pairs that fill the sheets. A pair that would crowd the
/// lip nodes there are is left out; a previous node stands in for a single one that it almost coincides with.
std::vector<CutNode> choose_cut_nodes(const topology::Domain& domain, const SprinkleOptions& options,
                                      const SharpFeatures& features, const topology::SurfaceMesh& surface,
                                      const SheetLayout& layout, const Surroundings& there);

} // namespace spherecut::solvers
