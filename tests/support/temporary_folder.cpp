#include "tests/support/temporary_folder.hpp"

#include <stdlib.h>
#include <string>
#include <system_error>

namespace spherecut::tests {

TemporaryFolder::TemporaryFolder() {
  constexpr int letters = 6; // that mkdtemp(3) fills in, each given as X
  std::string pattern =
      (std::filesystem::temp_directory_path() / "spherecut-test-").string() + std::string(letters, 'X');
  if (mkdtemp(pattern.data()) == nullptr)
    throw std::system_error(errno, std::generic_category(), pattern);
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

} // namespace spherecut::tests
