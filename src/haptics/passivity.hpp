// Energy at the tool port, and the damping that keeps the loop from giving more than it got.
#pragma once

#include "src/scenario/haptic_settings.hpp"
#include "topology/base/types.hpp"

#include <array>
#include <optional>

namespace spherecut::app {

/// Time-domain passivity observer and controller [Hannaford and Ryu 2002; Ryu, Preusche, Hannaford and Hirzinger 2005].
/// The force is constant between ticks and its delay is known, so the energy that the hand has put in is exact at the
/// sensor: E += -F . dx. It must cover the elastic energy U behind the force where the model knows it, else zero: D = E
/// - U >= 0. When D falls below zero, damping opposes the motion until it is made up, by at most DeviceLimits::damping.
/// D above a small reserve is forgotten, so that energy lost in one place (friction, cutting) does not pay for energy
/// gained in another.
///
/// The velocity is the slope of the longest stretch of readings, up to a window, that an even motion explains to the
/// sensor's step [Janabi-Sharifi, Hayward and Chen 2000]: a fast tool that stops has none from the next reading on.
class PassivityControl {
 public:
  /// `rate` in ticks per second; `active` false: observes only.
  PassivityControl(const DeviceLimits& limits, double rate, bool active);

  /// One tick: `position` of the device now, the force `wanted` on the hand, and the elastic energy behind it (J, times
  /// the gain). Returns the force with the damping added. Call sent() with what is really sent.
  [[nodiscard]] Vector3 control(const Vector3& position, const Vector3& wanted, std::optional<double> stored) noexcept;
  void sent(const Vector3& force) noexcept;

  /// The next position is where the tool is taken up anew: no motion has led there, nothing is owed and nothing stored.
  void place() noexcept;
  /// The energy behind the next force has been found there, not put in: the change does not count.
  void find() noexcept { finds_ = true; }

  /// Energy that the hand has put in since the start, J.
  [[nodiscard]] double energy() const { return energy_; }
  [[nodiscard]] double lowest_energy() const { return lowest_; }
  /// Energy taken out by the controller, J.
  [[nodiscard]] double damped() const { return damped_; }

  /// Worst error of the observed energy below the true one, J: the sensor's rounding under the largest force, half a
  /// step at either end.
  [[nodiscard]] double sampling_allowance() const;

 private:
  [[nodiscard]] Vector3 velocity() const noexcept;

  static constexpr std::size_t window = 11; // readings over which the velocity is taken at most
  DeviceLimits limits_;
  double rate_;
  bool active_;
  std::array<Vector3, window> positions_; // m, newest first
  bool placed_ = true;                    // the next position is the first
  static constexpr std::size_t longest_delay = 15;
  std::array<Vector3, longest_delay + 1> sent_, damping_forces_; // N, newest first
  double energy_ = 0, lowest_ = 0, damped_ = 0;
  double damping_ = 0;              // N s/m, added now
  bool finds_ = true;               // at the next force
  double surplus_ = 0, stored_ = 0; // J: D, and U at the last tick
};

} // namespace spherecut::app
