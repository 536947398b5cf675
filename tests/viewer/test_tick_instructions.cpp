// The haptic thread of `spherecut serve`, single-stepped: how many instructions a tick takes, with and without viewers.
// A count, not a time: it is the same on a slow or busy machine, and where there are no hardware counters.
#include "tests/src/scenario_text.hpp"
#include "tests/support/served_program.hpp"
#include "tests/support/web_client.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>
#include <dlfcn.h>
#include <fstream>
#include <sched.h>
#include <stdexcept>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <utility>

using namespace spherecut::tests;

namespace {

/// Steps a thread from one reading of its processor time to the next. A tick reads it once before and once after its
/// work, so two stretches on end are a whole tick, waiting left out: a stepped thread is always late. A reading of the
/// clock in the page of the kernel (the vDSO) becomes a system call: the page's own code begins anew whenever the
/// kernel has just set the clock, which a stepped thread meets at any time, and for ever where a step takes long.
class Stepper {
 public:
  explicit Stepper(pid_t thread) : thread_(thread) {
    if (ptrace(PTRACE_SEIZE, thread_, nullptr, nullptr) != 0)
      throw std::runtime_error(std::string("this process may not trace its child: ") + std::strerror(errno));
    ptrace(PTRACE_INTERRUPT, thread_, nullptr, nullptr);
    wait();
    // The page is the same in every process, at another place.
    void* const page = dlopen("linux-vdso.so.1", RTLD_LAZY | RTLD_NOLOAD);
    const void* const reading = page != nullptr ? dlsym(page, "__vdso_clock_gettime") : nullptr;
    const unsigned long long there = clock_page(thread_);
    Dl_info here{};
    if (reading == nullptr || dladdr(reading, &here) == 0 || there == 0)
      return; // without such a page every reading is a system call
    const auto* const first = static_cast<const unsigned char*>(here.dli_fbase);
    read_clock_ = there + static_cast<unsigned long long>(static_cast<const unsigned char*>(reading) - first);
    system_call_ = there + system_call_of(first);
  }
  ~Stepper() { ptrace(PTRACE_DETACH, thread_, nullptr, nullptr); }
  Stepper(const Stepper&) = delete;
  Stepper& operator=(const Stepper&) = delete;

  /// Instructions of the shortest of some ticks on end: one in a hundred meets something to pass on.
  long shortest_tick(int ticks) {
    long least = 0;
    long before = -1; // of the stretch before; unknown at first
    for (int i = 0; i < 2 * ticks + 2; ++i) {
      const long now = stretch();
      if (i > 0 && before >= 0 && (least == 0 || before + now < least))
        least = before + now;
      before = i > 0 ? now : -1; // the first began anywhere
    }
    return least;
  }

 private:
  // Where the page begins in a process; 0 if it has none.
  static unsigned long long clock_page(pid_t process) {
    std::ifstream maps("/proc/" + std::to_string(process) + "/maps");
    for (std::string line; std::getline(maps, line);)
      if (line.find("[vdso]") != std::string::npos)
        return std::stoull(line, nullptr, 16);
    return 0;
  }
  // Of a system call in the page that begins here: bytes from its beginning.
  static unsigned long long system_call_of(const unsigned char* first) {
    constexpr std::array<unsigned char, 2> call{0x0f, 0x05};
    const auto* const last = first + sysconf(_SC_PAGESIZE);
    const auto* const found = std::search(first, last, call.begin(), call.end());
    if (found == last)
      throw std::runtime_error("the kernel's page of clock readings holds no system call");
    return static_cast<unsigned long long>(found - first);
  }
  [[nodiscard]] bool is_system_call(unsigned long long instruction) const {
    return (ptrace(PTRACE_PEEKTEXT, thread_, instruction, nullptr) & 0xffff) == 0x050f;
  }
  // The thread has called the page's function and has its arguments where a system call expects them.
  void read_clock_by_system_call(const user_regs_struct& called) const {
    user_regs_struct registers = called;
    registers.rax = SYS_clock_gettime;
    registers.rip = system_call_;
    ptrace(PTRACE_SETREGS, thread_, nullptr, &registers);
    ptrace(PTRACE_SINGLESTEP, thread_, nullptr, nullptr);
    wait();
    ptrace(PTRACE_GETREGS, thread_, nullptr, &registers);
    registers.rip = static_cast<unsigned long long>(ptrace(PTRACE_PEEKTEXT, thread_, called.rsp, nullptr));
    registers.rsp = called.rsp + sizeof(registers.rsp); // the function has returned
    ptrace(PTRACE_SETREGS, thread_, nullptr, &registers);
  }
  void wait() const {
    int status = 0;
    if (waitpid(thread_, &status, __WALL) != thread_ || !WIFSTOPPED(status))
      throw std::runtime_error("the haptic thread has ended");
  }
  long stretch() const {
    long count = 0;
    for (long steps = 0; steps < 10'000'000; ++steps) {
      user_regs_struct registers{};
      ptrace(PTRACE_GETREGS, thread_, nullptr, &registers);
      ++count;
      const bool calls = read_clock_ != 0 && registers.rip == read_clock_;
      const bool is_own = registers.rdi == CLOCK_THREAD_CPUTIME_ID;
      const bool reads = is_own && (calls || (registers.rax == SYS_clock_gettime && is_system_call(registers.rip)));
      if (calls) {
        read_clock_by_system_call(registers);
      } else {
        ptrace(PTRACE_SINGLESTEP, thread_, nullptr, nullptr);
        wait();
      }
      if (reads)
        return count;
    }
    throw std::runtime_error("the haptic thread does not read its processor time any more: the ticks cannot be told");
  }
  pid_t thread_;
  unsigned long long read_clock_ = 0, system_call_ = 0; // addresses in the page of the thread; 0 without a page
};

/// Watches until it is told to stop.
class Viewer {
 public:
  explicit Viewer(int port) : socket_(port) {
    socket_.send(R"({"type":"hello","version":1})");
    socket_.send(R"({"type":"credit","frames":2})");
    thread_ = std::thread([this] {
      while (!stop_) {
        if (const auto message = socket_.receive(0.2); message && message->binary && message->bytes[0] == 2) {
          ++frames_;
          socket_.send(R"({"type":"credit","frames":1})");
        }
      }
    });
  }
  ~Viewer() {
    stop_ = true;
    thread_.join();
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  [[nodiscard]] int frames() const { return frames_; }

 private:
  WebSocketClient socket_; // the thread's
  std::atomic<bool> stop_{false};
  std::atomic<int> frames_{0};
  std::thread thread_;
};

/// Comes and goes with nonsense until it is told to stop.
class Noise {
 public:
  explicit Noise(int port) {
    thread_ = std::thread([this, port] {
      while (!stop_) {
        WebSocketClient client(port);
        client.send(visits % 3 == 0   ? std::string("{\"type\":\"pose\",\"n\":1}")
                    : visits % 3 == 1 ? std::string("\xff\x00 nonsense", 11)
                                      : R"({"type":"hello","version":7})");
        if (client.wait_for_close(1))
          ++ended;
        ++visits;
      }
    });
  }
  ~Noise() {
    stop_ = true;
    thread_.join();
  }
  Noise(const Noise&) = delete;
  Noise& operator=(const Noise&) = delete;
  std::atomic<int> visits{0}, ended{0};

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

template <typename Condition>
bool soon(const Condition& condition) {
  for (int i = 0; i < 6000; ++i) {
    if (condition())
      return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

} // namespace

TEST_CASE("Viewers, nonsense and reconnects cost the haptic thread not one instruction of a tick") {
  const ServedProgram server(small_scenario);
  pid_t haptic = 0;
  REQUIRE(soon([&] { return (haptic = server.thread("haptic")) != 0; }));
  // A stepped thread and the one that steps it take turns: where that is allowed, before what else there is to do.
  sched_param priority{};
  priority.sched_priority = 10;
  static_cast<void>(sched_setscheduler(0, SCHED_FIFO, &priority));
  try {
    const Stepper probe(haptic);
  } catch (const std::runtime_error& error) {
    WARN("NOT COUNTED: " << error.what());
    return;
  }
  const auto count = [&] { return Stepper(haptic).shortest_tick(10); };
  // A session that has just begun feels nothing yet: it is at rest once its first solve has come, which frames follow.
  {
    const Viewer first(server.port());
    CHECK(soon([&] { return first.frames() > 3; }));
  }
  long alone = 0;
  CHECK(soon([&] {
    const long before = std::exchange(alone, count());
    return before == alone;
  }));
  CHECK(alone > 1000);
  CHECK(count() == alone);
  std::array<std::unique_ptr<Viewer>, 4> viewers;
  for (auto& viewer : viewers)
    viewer = std::make_unique<Viewer>(server.port());
  CHECK(
      soon([&] { return std::all_of(viewers.begin(), viewers.end(), [](const auto& v) { return v->frames() > 3; }); }));
  CHECK(count() == alone);
  {
    const Noise noise(server.port());
    CHECK(soon([&] { return noise.visits > 3; }));
    const int before = noise.visits;
    CHECK(count() == alone);
    CHECK(noise.visits > before); // while it was counted
    CHECK(soon([&] { return noise.ended > 10; }));
  }
  for (auto& viewer : viewers)
    viewer.reset();
  CHECK(count() == alone);
  std::printf("instructions from one tick to the next: %ld\n", alone);
}
