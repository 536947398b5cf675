// Studies of many runs are the Python package's (python/spherecut/sweep); this hands the command line over to it.
#pragma once

#include <string>
#include <vector>

namespace spherecut::app {

/// Becomes python3 with `spherecut.sweep` and these arguments: of a virtual environment, else Debian's, else the first
/// on the PATH. The package is that of the build tree, of the installation this program is in, or the interpreter's
/// own. Returns only by InputError: there is no python3. Where there is no package python3 says so and ends with
/// status 2.
[[noreturn]] void become_sweep(const std::vector<std::string>& arguments);

} // namespace spherecut::app
