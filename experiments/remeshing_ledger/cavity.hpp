// The tetrahedra about a new strip of the cut taken out, what bounds the hole, and other tetrahedra put in.
#pragma once

#include "experiments/remeshing_ledger/cavity_fill.hpp"
#include "experiments/remeshing_ledger/scenario.hpp"

namespace spherecut::experiments::ledger {

struct Cavity {
  std::vector<char> removed; // by tetrahedron
  CavityBorder border;       // triangles: those shared with kept tetrahedra, then the skin's, then the cut's
  std::vector<int> vertex;   // of each of the border's points: the mesh's vertex, -1 for a new one
  std::ptrdiff_t shared = 0, on_cut = 0; // triangles of the first and of the last kind
  double volume = 0;                     // m3
};

/// Whether a tetrahedron is far larger than the sizes ask for, as those are that the front has come near to.
bool is_coarse(const TetMesh& mesh, int tet, const Grading& size);

/// Everything that is_coarse, or lies within `reach` m of where the front moved from increment `before` to `now`. The
/// triangles shared with kept tetrahedra stay. The skin is triangulated anew where the cut meets it, and so is the cut:
/// graded by `size`, with the new front and the new mouth as edges. Vertices within `tolerance` m of the cut's plane
/// belong to it. Throws NumericalError where the hole cannot be bounded.
Cavity open_cavity(const TetMesh& mesh, const Scenario& scenario, int before, int now, const Grading& size,
                   double reach, double tolerance);

/// Kept tetrahedra in their order, then the filling's; vertices that fall out of use stay in their places. Throws
/// NumericalError where the filling lacks a triangle of the border, or its volume is not the cavity's.
void close_cavity(TetMesh& mesh, const Cavity& cavity, const TetMesh& filling);

} // namespace spherecut::experiments::ledger
