// A device of Force Dimension (DHD) in the hand of `spherecut haptics` with device = "bridge" (docs/devices.md).
//
//     force_dimension [PORT]
#include "../haptic_bridge_client/bridge_client.hpp"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <dhdc.h>
#include <thread>

namespace {

// The device has x towards the user, y to the right and z up; the scenario x to the right, y away and z up.
constexpr haptic_bridge::Axes axes({{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}});
volatile std::sig_atomic_t stopped = 0;

int complain(const char* what) {
  std::fprintf(stderr, "%s: %s\n", what, dhdErrorGetLastStr());
  return 1;
}

} // namespace

int main(int argc, char** argv) {
  haptic_bridge::Client bridge(argc > 1 ? std::atoi(argv[1]) : 27510);
  if (!bridge.open()) {
    std::fprintf(stderr, "no socket for the bridge\n");
    return 1;
  }
  if (dhdOpen() < 0)
    return complain("no device");
  std::signal(SIGINT, [](int) { stopped = 1; });
  dhdEnableForce(DHD_ON);
  std::printf("the device holds the tool; Ctrl-C ends\n");
  double rotation[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  int status = 0;
  for (auto due = std::chrono::steady_clock::now(); stopped == 0 && status == 0;) {
    std::this_thread::sleep_until(due += std::chrono::milliseconds(1));
    double position[3] = {};
    if (dhdGetPosition(&position[0], &position[1], &position[2]) < 0 ||
        (dhdHasWrist() && dhdGetOrientationFrame(rotation) < 0)) {
      status = complain("the pose cannot be read");
      break;
    }
    haptic_bridge::Motion motion;
    axes.to_scenario(position, 1, rotation, motion);
    motion.buttons = static_cast<std::uint16_t>(dhdGetButtonMask());
    double force[3];
    axes.to_device(bridge.exchange(motion), force);
    if (dhdSetForce(force[0], force[1], force[2]) < 0)
      status = complain("the force cannot be set");
  }
  dhdSetForce(0, 0, 0);
  dhdClose();
  return status;
}
