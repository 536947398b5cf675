// CHOLMOD's workspace, for the sources that factorise or analyse with it. Not a header: installed ones name no library
// but Eigen.
#pragma once

#include <cholmod.h>

namespace spherecut::solvers {

/// Started and finished with the object that owns it; prints nothing.
struct CholmodWorkspace {
  cholmod_common common{};
  explicit CholmodWorkspace(int supernodal) { // CHOLMOD_SIMPLICIAL, CHOLMOD_SUPERNODAL
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = supernodal;
    common.error_handler = nullptr;
  }
  ~CholmodWorkspace() { cholmod_finish(&common); }
  CholmodWorkspace(const CholmodWorkspace&) = delete;
  CholmodWorkspace& operator=(const CholmodWorkspace&) = delete;
};

} // namespace spherecut::solvers
