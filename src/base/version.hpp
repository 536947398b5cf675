// The version of the library and the command line, from CMake's project().
#pragma once

#include <string_view>

namespace spherecut::app {

std::string_view version();

} // namespace spherecut::app
