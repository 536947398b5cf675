// A Touch (OpenHaptics, HD API) in the hand of `spherecut haptics` with device = "bridge" (docs/devices.md).
//
//     openhaptics_touch [PORT]
#include "../haptic_bridge_client/bridge_client.hpp"

#include <HD/hd.h>
#include <cstdio>
#include <cstdlib>

namespace {

// The Touch has x to the right, y up and z towards the user; the scenario x to the right, y away and z up.
constexpr haptic_bridge::Axes axes({{1, 0, 0}, {0, 0, -1}, {0, 1, 0}});
constexpr double millimetre = 1e-3; // the HD API counts in these

// In the servo loop, 1000 times a second. exchange() does not wait.
HDCallbackCode HDCALLBACK tick(void* data) {
  auto& bridge = *static_cast<haptic_bridge::Client*>(data);
  hdBeginFrame(hdGetCurrentDevice());
  HDdouble transform[16]; // by columns; the last has the position
  HDint buttons = 0;
  hdGetDoublev(HD_CURRENT_TRANSFORM, transform);
  hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
  double rotation[3][3];
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      rotation[row][column] = transform[4 * column + row];
  haptic_bridge::Motion motion;
  axes.to_scenario(transform + 12, millimetre, rotation, motion);
  motion.buttons = static_cast<std::uint16_t>(buttons);
  HDdouble force[3];
  axes.to_device(bridge.exchange(motion), force);
  hdSetDoublev(HD_CURRENT_FORCE, force);
  hdEndFrame(hdGetCurrentDevice());
  return HD_DEVICE_ERROR(hdGetError()) ? HD_CALLBACK_DONE : HD_CALLBACK_CONTINUE;
}

} // namespace

int main(int argc, char** argv) {
  haptic_bridge::Client bridge(argc > 1 ? std::atoi(argv[1]) : 27510);
  if (!bridge.open()) {
    std::fprintf(stderr, "no socket for the bridge\n");
    return 1;
  }
  const HHD device = hdInitDevice(HD_DEFAULT_DEVICE);
  if (const HDErrorInfo error = hdGetError(); HD_DEVICE_ERROR(error)) {
    std::fprintf(stderr, "no Touch: %s\n", hdGetErrorString(error.errorCode));
    return 1;
  }
  hdEnable(HD_FORCE_OUTPUT);
  const HDSchedulerHandle loop = hdScheduleAsynchronous(tick, &bridge, HD_MAX_SCHEDULER_PRIORITY);
  hdStartScheduler();
  std::printf("the Touch holds the tool; Enter ends\n");
  std::getchar();
  hdStopScheduler();
  hdUnschedule(loop);
  hdDisableDevice(device);
  return 0;
}
