// Work of libraries that may crash or never end, in a process of its own.
#pragma once

#include "experiments/remeshing_ledger/back_end.hpp"
#include "experiments/remeshing_ledger/tetrahedra.hpp"

#include <string>

namespace spherecut::experiments::ledger {

struct GuardedMesh {
  TetMesh mesh;
  std::string failure;                            // empty: there is a mesh
  double processor_seconds = 0, wall_seconds = 0; // of the work alone, without what carries it over
  double peak_memory = 0;                         // bytes the process came to hold beyond what it began with
};

/// Runs `work` in a process that is ended after `limit` seconds of processor time. What it throws, a crash and the
/// limit come back as `failure`.
GuardedMesh mesh_in_own_process(const std::function<TetMesh()>& work, double limit);

/// The same for an increment: books time, memory and failure, which is set when there is no mesh.
TetMesh mesh_for(Increment& increment, const std::function<TetMesh()>& work, double limit);

/// Bytes this process holds now, and the most since reset_peak_memory().
double memory_held();
double peak_memory();
void reset_peak_memory();

} // namespace spherecut::experiments::ledger
