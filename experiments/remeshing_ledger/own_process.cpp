#include "experiments/remeshing_ledger/own_process.hpp"

#include "experiments/remeshing_ledger/back_end.hpp"

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <malloc.h>
#include <poll.h>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace spherecut::experiments::ledger {

namespace {

struct Header {
  std::int64_t vertices = -1, tets = 0, message = 0; // -1: a message follows instead of a mesh
  double processor_seconds = 0, wall_seconds = 0, peak_memory = 0;
};

bool write_all(int file, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = write(file, at, size);
    if (written <= 0)
      return false;
    at += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

/// False when the limit or the end of the file comes first.
bool read_all(int file, void* data, std::size_t size, double until) {
  char* at = static_cast<char*>(data);
  while (size > 0) {
    const double left = until - wall_seconds();
    pollfd wait{file, POLLIN, 0};
    if (left <= 0 || poll(&wait, 1, static_cast<int>(1000 * left) + 1) <= 0)
      return false;
    const ssize_t got = read(file, at, size);
    if (got <= 0)
      return false;
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

double status_entry(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == key) {
      double kilobytes = 0;
      status >> kilobytes;
      return 1024 * kilobytes;
    }
  return 0;
}

constexpr double patience = 30; // wall clock over processor time

/// Ended by the system for the processor time it took (some end a process whose limits are equal outright).
bool is_over_limit(int status) {
  return WIFSIGNALED(status) != 0 && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL);
}

[[noreturn]] void work_and_leave(int file, const std::function<TetMesh()>& work) {
  Header header;
  TetMesh mesh;
  std::string message;
  reset_peak_memory();
  const double held = memory_held(), processor = processor_seconds(), wall = wall_seconds();
  try {
    mesh = work();
    header.vertices = std::ssize(mesh.vertices);
    header.tets = std::ssize(mesh.tets);
  } catch (const std::exception& error) {
    message = error.what();
  } catch (...) {
    message = "the mesher gave up";
  }
  header.processor_seconds = processor_seconds() - processor;
  header.wall_seconds = wall_seconds() - wall;
  header.peak_memory = peak_memory() - held;
  header.message = std::ssize(message);
  bool sent = write_all(file, &header, sizeof header);
  if (header.vertices < 0)
    sent = sent && write_all(file, message.data(), message.size());
  else
    sent = sent && write_all(file, mesh.vertices.data(), mesh.vertices.size() * sizeof(Vector3)) &&
           write_all(file, mesh.tets.data(), mesh.tets.size() * sizeof(mesh.tets[0]));
  _exit(sent ? 0 : 1);
}

} // namespace

double memory_held() {
  return status_entry("VmRSS:");
}

double peak_memory() {
  return status_entry("VmHWM:");
}

void reset_peak_memory() {
  malloc_trim(0);                                // what was freed before goes back to the system and is not held
  std::ofstream("/proc/self/clear_refs") << "5"; // where it may not be written the peak stays that of the whole run
}

GuardedMesh mesh_in_own_process(const std::function<TetMesh()>& work, double limit) {
  GuardedMesh result;
  int ends[2];
  if (pipe(ends) != 0) {
    result.failure = fmt::format("no pipe: {}", std::strerror(errno));
    return result;
  }
  const pid_t child = fork();
  if (child < 0) {
    close(ends[0]);
    close(ends[1]);
    result.failure = fmt::format("no process: {}", std::strerror(errno));
    return result;
  }
  if (child == 0) {
    close(ends[0]);
    const auto seconds = static_cast<rlim_t>(std::ceil(limit));
    const rlimit most{seconds, seconds};
    setrlimit(RLIMIT_CPU, &most);
    work_and_leave(ends[1], work);
  }
  close(ends[1]);
  const double until = wall_seconds() + patience * limit; // it may wait for a processor
  Header header;
  bool complete = read_all(ends[0], &header, sizeof header, until);
  if (complete && header.vertices >= 0) {
    result.mesh.vertices.resize(static_cast<std::size_t>(header.vertices));
    result.mesh.tets.resize(static_cast<std::size_t>(header.tets));
    complete = read_all(ends[0], result.mesh.vertices.data(), result.mesh.vertices.size() * sizeof(Vector3), until) &&
               read_all(ends[0], result.mesh.tets.data(), result.mesh.tets.size() * sizeof(result.mesh.tets[0]), until);
  } else if (complete) {
    result.failure.resize(static_cast<std::size_t>(header.message));
    complete = read_all(ends[0], result.failure.data(), result.failure.size(), until);
  }
  close(ends[0]);
  const bool late = wall_seconds() >= until;
  if (late)
    kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  if (!complete)
    result.failure = late || is_over_limit(status) ? fmt::format("not done after {} s", limit)
                     : WIFSIGNALED(status) != 0    ? fmt::format("the mesher crashed (signal {})", WTERMSIG(status))
                                                   : std::string("the mesher ended without a mesh");
  result.processor_seconds = header.processor_seconds;
  result.wall_seconds = header.wall_seconds;
  result.peak_memory = header.peak_memory;
  return result;
}

TetMesh mesh_for(Increment& increment, const std::function<TetMesh()>& work, double limit) {
  GuardedMesh guarded = mesh_in_own_process(work, limit);
  increment.times.add(Stage::meshing, guarded.processor_seconds, guarded.wall_seconds);
  increment.mesher_memory = guarded.peak_memory;
  increment.failure = guarded.failure;
  return std::move(guarded.mesh);
}

} // namespace spherecut::experiments::ledger
