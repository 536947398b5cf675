#include "src/version.hpp"

#include <fmt/core.h>

int main() {
  fmt::print("spherecut {}\n", spherecut::app::version());
  return 0;
}
