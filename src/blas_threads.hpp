// How many threads the linear algebra uses.
#pragma once

namespace spherecut::app {

/// One thread for BLAS and LAPACK in this process, where that is OpenBLAS: how it shares work among threads would
/// change the last bits of a result from machine to machine. Other libraries are left as they are.
void use_one_blas_thread();

} // namespace spherecut::app
