// `spherecut serve` as a child of the test, which may look into it therefore.
#pragma once

#include "tests/support/temporary_folder.hpp"

#include <string>
#include <sys/types.h>

namespace spherecut::tests {

/// What a process has of the machine.
struct Holdings {
  int files = 0;     // that are open
  int threads = 0;   //
  double memory = 0; // MB, resident
};

class ServedProgram {
 public:
  /// Serves a scenario on a free port of 127.0.0.1, recordings in a folder of its own. Throws std::runtime_error with
  /// what the program said when it does not start.
  explicit ServedProgram(const std::string& scenario);
  /// Kills it.
  ~ServedProgram();
  ServedProgram(const ServedProgram&) = delete;
  ServedProgram& operator=(const ServedProgram&) = delete;

  [[nodiscard]] int port() const { return port_; }
  /// The thread of that name; 0: there is none.
  [[nodiscard]] pid_t thread(const std::string& name) const;
  [[nodiscard]] Holdings holdings() const;

 private:
  TemporaryFolder folder_;
  pid_t child_ = 0;
  int port_ = 0;
};

} // namespace spherecut::tests
