// Energy at the port of a client that gets and gives less often than the loop ticks.
#pragma once

#include "src/haptics/device.hpp"

#include <optional>

namespace spherecut::app {

/// The hand at such a client feels one force from reading to reading, one that answers to where it was up to two
/// readings ago: by itself that gives it energy at every press. So energy is counted where it flows, from reading to
/// reading, with the force that the client had at the first of them or with their mean, whichever is worse. The force
/// is that of a spring which has stored no more than the hand has put in (and energy_credit): sqrt(E / U) of the
/// model's where the model's energy U is above E, and never so much that one more step like the last would take more
/// than there is. That share changes evenly over the time between two readings. A hand that has nothing left is braked
/// until it has put some in. [Hannaford and Ryu 2002 damp instead, with a velocity that is too old here; the bound on
/// one step is that of Kim and Ryu 2010.]
class ClientPassivity {
 public:
  static constexpr double energy_credit = 1e-4; // J, that may be given before any was put in

  /// `rate` in ticks per second; `active` false: observes only.
  ClientPassivity(const DeviceLimits& limits, double rate, bool active);

  /// One tick: the position of the loop's tool, the force `wanted` on the hand and the elastic energy behind it (J,
  /// times the gain). Returns the force that may be sent. Call sent() with what is really sent.
  [[nodiscard]] Vector3 control(const ClientReading& reading, const Vector3& position, const Vector3& wanted,
                                double stored) noexcept;
  void sent(const Vector3& force) noexcept;

  /// As of PassivityControl.
  void place() noexcept;
  void find() noexcept { finds_ = true; }
  [[nodiscard]] double energy() const { return energy_; }
  [[nodiscard]] double lowest_energy() const { return lowest_; }

 private:
  void take(const ClientReading& reading, const Vector3& position, const Vector3& wanted, double stored) noexcept;

  DeviceLimits limits_;
  double rate_;
  bool active_;
  bool placed_ = true, finds_ = true;
  static constexpr std::size_t longest_delay = 15;
  std::array<Vector3, longest_delay + 1> sent_;                            // N, newest first
  Vector3 reading_ = Vector3::Zero();                                      // m, the last
  Vector3 start_ = Vector3::Zero(), sum_ = Vector3::Zero();                // N: had at that reading, summed since
  int ticks_ = 0;                                                          // since then
  Vector3 newest_velocity_ = Vector3::Zero(), velocity_ = Vector3::Zero(); // m/s; of the last step, smoothed
  double energy_ = 0, lowest_ = 0;
  double surplus_ = 0, stored_ = 0; // J: E - U, and U, at the last reading
  double share_ = 1, target_ = 1;
  int left_ = 0; // ticks to go to the target
  bool brakes_ = false;
  double brake_ = 0; // 0 to 1
};

} // namespace spherecut::app
