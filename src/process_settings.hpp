// Settings of the whole process that results and times depend on.
#pragma once

namespace spherecut::app {

/// One thread for BLAS and LAPACK in this process, where that is OpenBLAS: how it shares work among threads would
/// change the last bits of a result from machine to machine. Other libraries are left as they are.
void use_one_blas_thread();

/// Freed memory stays with the process, for the next step to use. Every step makes matrices of megabytes anew; given
/// back and fetched again they cost a tenth to a fifth of a rebuild in page faults, and taking a page back interrupts
/// the cores that the other threads run on, the haptic one among them. For programs, not for libraries.
void keep_freed_memory();

} // namespace spherecut::app
