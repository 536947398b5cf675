// Settings of the whole process that results and times depend on.
#pragma once

namespace spherecut::app {

/// One thread for BLAS and LAPACK in this process, where that is OpenBLAS: how it shares work among threads would
/// change the last bits of a result from machine to machine. Other libraries are left as they are.
void use_one_blas_thread();

/// Has OpenBLAS make the buffers that so many threads may need at a time, 128 MB of addresses each, of which it touches
/// what it uses; it keeps them. When it finds no memory for one later it tries again for ever. Throws std::bad_alloc
/// where there is none now.
void reserve_blas_memory(int threads);

/// Freed memory stays with the process, for the next step to use. Every step makes matrices of megabytes anew; given
/// back and fetched again they cost a tenth to a fifth of a rebuild in page faults, and taking a page back interrupts
/// the cores that the other threads run on, the haptic one among them. For programs, not for libraries.
void keep_freed_memory();

} // namespace spherecut::app
