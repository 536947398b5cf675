#include "tests/support/run_program.hpp"

#include "tests/support/temporary_folder.hpp"

#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <sys/wait.h>

namespace spherecut::tests {
namespace {

// In single quotes for the shell.
std::string quoted(const std::string& word) {
  std::string out("'");
  for (const char c : word) {
    if (c == '\'')
      out.append("'\\'");
    out.push_back(c);
    if (c == '\'')
      out.append("'");
  }
  out.push_back('\'');
  return out;
}

} // namespace

ProgramResult run_shell(const std::string& command) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const std::string err = (folder.path() / "err").string();
  const int status = std::system(fmt::format("{{ {} ; }} >{} 2>{}", command, quoted(out), quoted(err)).c_str());
  ProgramResult result;
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = read_file(out);
  result.err = read_file(err);
  return result;
}

std::string spherecut_command(const std::vector<std::string>& arguments) {
  std::string command = quoted(SPHERECUT_BINARY);
  for (const std::string& argument : arguments)
    command += " " + quoted(argument);
  return command;
}

ProgramResult run_spherecut(const std::vector<std::string>& arguments) {
  return run_shell(spherecut_command(arguments));
}

std::string read_file(const std::filesystem::path& file) {
  const std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::filesystem::path write_file(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  if (!out.flush())
    throw std::runtime_error(file.string() + " cannot be written");
  return file;
}

} // namespace spherecut::tests
