// Whatever device CHAI3D finds in the hand of `spherecut haptics` with device = "bridge" (docs/devices.md).
//
//     chai3d_device [PORT]
#include "../haptic_bridge_client/bridge_client.hpp"

#include <chai3d.h>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace {

// CHAI3D has x towards the user, y to the right and z up; the scenario x to the right, y away and z up.
constexpr haptic_bridge::Axes axes({{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}});
volatile std::sig_atomic_t stopped = 0;

} // namespace

int main(int argc, char** argv) {
  haptic_bridge::Client bridge(argc > 1 ? std::atoi(argv[1]) : 27510);
  if (!bridge.open()) {
    std::fprintf(stderr, "no socket for the bridge\n");
    return 1;
  }
  chai3d::cHapticDeviceHandler handler;
  chai3d::cGenericHapticDevicePtr device;
  if (!handler.getDevice(device, 0) || !device->open()) {
    std::fprintf(stderr, "CHAI3D finds no device\n");
    return 1;
  }
  device->calibrate();
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::printf("the device holds the tool; Ctrl-C ends\n");
  for (auto due = std::chrono::steady_clock::now(); stopped == 0;) {
    std::this_thread::sleep_until(due += std::chrono::milliseconds(1));
    chai3d::cVector3d place;
    chai3d::cMatrix3d turn;
    unsigned int switches = 0;
    device->getPosition(place);
    device->getRotation(turn);
    device->getUserSwitches(switches);
    const double position[3] = {place(0), place(1), place(2)};
    double rotation[3][3];
    for (unsigned int row = 0; row < 3; ++row)
      for (unsigned int column = 0; column < 3; ++column)
        rotation[row][column] = turn(row, column);
    haptic_bridge::Motion motion;
    axes.to_scenario(position, 1, rotation, motion);
    motion.buttons = static_cast<std::uint16_t>(switches);
    double force[3];
    axes.to_device(bridge.exchange(motion), force);
    device->setForce(chai3d::cVector3d(force[0], force[1], force[2]));
  }
  device->setForce(chai3d::cVector3d(0, 0, 0));
  device->close();
  return 0;
}
