// The two ways a computation is refused. Neither leaves partial state behind.
#pragma once

#include <stdexcept>
#include <string>

namespace spherecut {

/// Input that cannot be used: a file, a scenario key, an argument. The message says what is wrong, where, the value and
/// the limit. The command line exits with status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A computation that failed on valid input: a singular system, a support that never becomes sound. The message carries
/// the node or the residual and condition. The command line exits with status 3.
class NumericalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

} // namespace spherecut
