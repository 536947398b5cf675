// Attaches a device to `spherecut haptics` with device = "bridge" (docs/haptic_bridge.md): sends its pose, gets the
// force and its torque about the tool's point. Replace read_device() and drive_device() by the calls of your hardware.
// As it stands, the device sways by 2 mm.
//
//     haptic_bridge_client [PORT [SECONDS]]
#include <arpa/inet.h>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

struct Pose { // what goes out: 88 bytes, little endian, nothing between the fields
  std::uint32_t magic = 0x42485053;
  std::uint16_t version = 2, kind = 2; // 1 hello and 3 goodbye are the first 16 bytes alone
  std::uint64_t token = 0, sequence = 0;
  double position[3] = {}, orientation[4] = {0, 0, 0, 1}; // m; x, y, z, w
  std::uint16_t mode = 0, buttons = 0;
  std::uint32_t zero = 0;
};
struct Force { // what comes in: 112 bytes; in version 1 it ends before the torque
  std::uint32_t magic = 0;
  std::uint16_t version = 0, kind = 0;
  std::uint64_t token = 0, tick = 0, sequence = 0;
  double force[3] = {}, position[3] = {}, timeout = 0; // N, m, s
  double torque[3] = {};                               // N m
};
static_assert(sizeof(Pose) == 88 && sizeof(Force) == 112, "packets have no gaps");

void read_device(double seconds, double offset[3]) { // m, from where the device was at first
  offset[0] = offset[1] = 0;
  offset[2] = -0.002 * std::sin(6.283 * seconds);
}
void drive_device(const double /*force*/[3], const double /*torque*/[3]) {} // N, N m

int main(int argc, char** argv) {
  sockaddr_in bridge{};
  bridge.sin_family = AF_INET;
  bridge.sin_port = htons(static_cast<std::uint16_t>(argc > 1 ? std::atoi(argv[1]) : 27510));
  inet_pton(AF_INET, "127.0.0.1", &bridge.sin_addr);
  const int link = socket(AF_INET, SOCK_DGRAM, 0);
  if (link < 0 || connect(link, reinterpret_cast<sockaddr*>(&bridge), sizeof bridge) != 0)
    return 1;
  Pose pose;
  Force force;
  double start[3] = {}, offset[3] = {}, peak = 0, turning = 0;
  const double none[3] = {};
  long ticks = 0, heard = 0, silent = 0;
  std::uint64_t session = 0; // the token of the last one
  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  for (auto due = std::chrono::steady_clock::now(); ticks < 1000 * seconds; ++ticks) {
    std::this_thread::sleep_until(due += std::chrono::milliseconds(1));
    for (Force next; recv(link, &next, sizeof next, MSG_DONTWAIT) == sizeof next;)
      if (next.magic == pose.magic && next.version == pose.version && next.kind == 4) {
        for (int axis = 0; axis < 3 && next.token != session; ++axis)
          start[axis] =
              next.position[axis] - offset[axis]; // a new session: on from where the tool waits, device and all
        pose.token = session = next.token;
        force = next;
        silent = 0;
        ++heard;
      }
    if (++silent > 100) // nobody answers
      pose.token = 0;
    drive_device(pose.token != 0 ? force.force : none, pose.token != 0 ? force.torque : none);
    peak = std::fmax(peak, std::hypot(force.force[0], force.force[1], force.force[2]));
    turning = std::fmax(turning, std::hypot(force.torque[0], force.torque[1], force.torque[2]));
    read_device(1e-3 * ticks, offset);
    for (int axis = 0; axis < 3; ++axis)
      pose.position[axis] = start[axis] + offset[axis];
    ++pose.sequence;
    pose.kind = pose.token != 0 ? 2 : 1;
    send(link, &pose, pose.kind == 2 ? sizeof pose : 16, MSG_DONTWAIT);
  }
  pose.kind = 3;
  send(link, &pose, 16, MSG_DONTWAIT);
  std::printf("%ld poses, %ld forces, peak %.3g N and %.3g mN m\n", ticks, heard, peak, 1e3 * turning);
  close(link);
  return heard > 0 ? 0 : 1;
}
