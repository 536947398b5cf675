// The command `spherecut serve`: a live session in a browser.
#pragma once

#include "src/run/run.hpp"

#include <cstdio>
#include <filesystem>
#include <string>

namespace spherecut::app {

struct ServeCommand {
  std::filesystem::path scenario; // empty: liver_live.toml
  std::string address = "127.0.0.1";
  int port = 8080;            // 0: any free one
  bool open = false;          // shows the page in the user's browser
  std::filesystem::path out;  // for recordings; empty: out/serve
  std::filesystem::path page; // empty: beside the program, or where it is installed
};

/// Serves until SIGINT or SIGTERM. Throws InputError when the scenario or the port cannot be had, NumericalError when
/// the first session cannot be built.
RunEnd serve(const ServeCommand& command, std::FILE* screen);

} // namespace spherecut::app
