// Which program runs on what: two sessions give the same bits where both are equal.
#pragma once

#include <string>

namespace spherecut::app {

/// Version and the linker's build identity of this program; the version alone where the linker left none.
std::string build_identity();

/// Model of the processor as the system tells it; empty where it does not.
std::string processor_name();

} // namespace spherecut::app
