// Attaches a device to `spherecut haptics` with device = "bridge" (docs/haptic_bridge.md): sends its pose, gets the
// force and its torque about the tool's point. Replace read_device() and drive_device() by the calls of your hardware,
// or begin with one of examples/devices. As it stands, the device sways by 2 mm.
//
//     haptic_bridge_client [PORT [SECONDS]]
#include "bridge_client.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace {

void read_device(double seconds, haptic_bridge::Motion& motion) {
  motion.position[2] = -0.002 * std::sin(6.283 * seconds); // m
}
void drive_device(const double /*force*/[3], const double /*torque*/[3]) {} // N, N m

} // namespace

int main(int argc, char** argv) {
  haptic_bridge::Client bridge(argc > 1 ? std::atoi(argv[1]) : 27510);
  if (!bridge.open())
    return 1;
  haptic_bridge::Motion motion;
  const double seconds = argc > 2 ? std::atof(argv[2]) : 10;
  double peak = 0, turning = 0;
  long ticks = 0;
  for (auto due = std::chrono::steady_clock::now(); ticks < 1000 * seconds; ++ticks) {
    std::this_thread::sleep_until(due += std::chrono::milliseconds(1));
    read_device(1e-3 * static_cast<double>(ticks), motion);
    const double* force = bridge.exchange(motion);
    const double* torque = bridge.torque();
    drive_device(force, torque);
    peak = std::fmax(peak, std::hypot(force[0], force[1], force[2]));
    turning = std::fmax(turning, std::hypot(torque[0], torque[1], torque[2]));
  }
  std::printf("%ld poses, %ld forces, peak %.3g N and %.3g mN m\n", ticks, bridge.heard(), peak, 1e3 * turning);
  return bridge.heard() > 0 ? 0 : 1;
}
