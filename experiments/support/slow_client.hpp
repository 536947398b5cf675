// A hand at a client that sends its pose, and takes its force, less often than the loop ticks: what a network and a
// busy computer make of a device, in virtual time.
#pragma once

#include "src/devices/client_pace.hpp"

#include <deque>
#include <random>

namespace spherecut::experiments {

struct SlowClientSettings {
  double rate = 100;       // poses a second
  double jitter = 0.3;     // of the time between two of them, to either side
  double loss = 0.01;      // share of the poses that never arrive
  double reordered = 0.01; // share that arrives after the next one
  std::uint64_t seed = 1;
};

/// The hand itself moves in continuous time; it holds each force that its client has taken until the next.
class SlowClient : public app::Device {
 public:
  /// Throws as SimulatedHand.
  SlowClient(std::vector<app::PathPose> path, const app::HandSettings& hand, const SlowClientSettings& settings,
             double rate);
  app::DeviceState read(std::uint64_t tick) noexcept override;
  void apply(const Vector3& force) noexcept override;

  /// Energy that the client's hand has put in, from reading to reading with the force that it held, J: now, at the
  /// least.
  [[nodiscard]] double energy() const { return energy_; }
  [[nodiscard]] double lowest_energy() const { return lowest_; }
  [[nodiscard]] const app::ClientPace& pace() const { return pace_; }
  [[nodiscard]] const app::SimulatedHand& hand() const { return hand_; }

 private:
  struct Packet {
    double arrives = 0; // ticks
    std::uint64_t sequence = 0;
    app::PathPose pose;
  };
  double uniform() noexcept { return static_cast<double>(random_() >> 11U) * 0x1p-53; }

  SlowClientSettings settings_;
  double rate_;
  app::SimulatedHand hand_;
  app::ClientPace pace_;
  std::mt19937_64 random_;
  std::deque<Packet> under_way_;
  double next_ = 0; // ticks, of the client's next turn
  std::uint64_t sequence_ = 0, newest_ = 0;
  Vector3 sent_ = Vector3::Zero(), held_ = Vector3::Zero(); // N: by the loop last, by the client
  Vector3 reading_ = Vector3::Zero();
  bool has_read_ = false;
  double energy_ = 0, lowest_ = 0;
};

} // namespace spherecut::experiments
