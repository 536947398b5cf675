// Runs a program as a user would and keeps what it said.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace spherecut::tests {

struct ProgramResult {
  int status = -1; // exit status; 128 + signal when killed
  std::string out, err;
};

/// Runs `command` through the shell and waits.
ProgramResult run_shell(const std::string& command);

/// Runs the spherecut binary with arguments given as they are (quoted here).
ProgramResult run_spherecut(const std::vector<std::string>& arguments);

/// The same as one shell command, for use with redirections and limits.
std::string spherecut_command(const std::vector<std::string>& arguments);

/// Contents of a file, and a file with contents.
std::string read_file(const std::filesystem::path& file);
std::filesystem::path write_file(const std::filesystem::path& file, const std::string& text);

} // namespace spherecut::tests
