// An Inverse3 behind the WebSocket service of its maker (docs/devices.md).
//
// Chosen here: a thread of its own speaks with the service, as fast as that answers and at most most_exchanges times a
// second. Between it and the haptic thread lie triple buffers: the newest pose one way, the newest force the other.
// The service answers each message with one state, so the rate is the device's own. Its motion is added to where the
// tool waits, and so are the turns of a grip on it.
#pragma once

#include "src/devices/client_pace.hpp"
#include "src/devices/haply_messages.hpp"
#include "src/haptics/triple_buffer.hpp"

#include <atomic>
#include <memory>
#include <string>
#include <thread>

namespace spherecut::app {

/// What there is between the loop and an Inverse3.
enum class HaplyLink : std::uint8_t {
  streams,   // poses come
  silent,    // the service has not answered for the timeout
  no_device, // it answers, without the device
  gone,      // there is no connection; it is tried again and again
};

struct HaplyCounters : PaceCounters {
  std::uint64_t poses = 0;    // that ticks took, at most one a tick
  std::uint64_t messages = 0; // of the service
  std::uint64_t garbage = 0;  // messages that were not what is documented
  std::uint64_t lost = 0;     // times that no pose came for the timeout
  std::uint64_t renewed = 0;  // connections after the first
};

class HaplyDevice : public Device {
 public:
  static constexpr double most_exchanges = 4000; // a second

  /// Connects, and finds the device. `waiting`: where the tool is while the device has not moved. Throws InputError
  /// that names the address when nobody answers there, when it is no such service, or when it has not the device.
  HaplyDevice(const HaplySettings& settings, const PathPose& waiting, double rate);
  /// Takes the force away and closes.
  ~HaplyDevice() override;
  HaplyDevice(const HaplyDevice&) = delete;
  HaplyDevice& operator=(const HaplyDevice&) = delete;

  /// The newest pose, or where the loop has the tool on the way there (client_pace.hpp). Not connected: none has come
  /// for the timeout; the tool stays where it was, and goes on from there once there is one again.
  DeviceState read(std::uint64_t tick) noexcept override;
  /// The service's next message has this force. A loop that has stood still for the timeout gives none.
  void apply(const Vector3& force) noexcept override;

  [[nodiscard]] const std::string& device_id() const { return device_id_; }
  /// From any thread.
  [[nodiscard]] HaplyLink link() const noexcept;
  [[nodiscard]] PaceReading pace() const noexcept { return pace_watch_.shown(); }
  /// From the haptic thread, or after it has ended.
  [[nodiscard]] HaplyCounters counters() const noexcept;

 private:
  struct Service; // the connection, the network thread's alone once that runs
  void take(const HaplyPose& pose, std::uint64_t tick) noexcept;
  void release() noexcept;
  void speak();
  void hear(std::string_view text);

  std::string device_id_;
  double rate_, timeout_;
  std::uint64_t silence_; // ticks after which the device is gone

  // Between the threads.
  TripleBuffer<HaplyPose> poses_;
  TripleBuffer<Vector3> forces_{Vector3(Vector3::Zero())};
  std::atomic<HaplyLink> link_{HaplyLink::streams}; // as the network thread has it
  std::atomic<bool> silent_{false};                 // as the haptic thread has it
  std::atomic<std::uint64_t> messages_{0}, garbage_{0}, renewed_{0};

  // The haptic thread's.
  DeviceState state_;
  bool held_ = false, grips_ = false;
  std::uint64_t heard_ = 0;
  Vector3 origin_ = Vector3::Zero(), start_ = Vector3::Zero(); // m, of the cursor and of the tool when it was taken up
  Eigen::Quaterniond grip_ = Eigen::Quaterniond::Identity(), turn_ = Eigen::Quaterniond::Identity(); // likewise
  ClientPace pace_;
  PaceWatch pace_watch_;
  HaplyCounters counters_;

  std::unique_ptr<Service> service_;
  std::thread thread_; // last: it uses all of the above
};

} // namespace spherecut::app
