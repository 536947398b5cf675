#include "src/base/version.hpp"

namespace spherecut::app {

std::string_view version() {
  return SPHERECUT_VERSION;
}

} // namespace spherecut::app
