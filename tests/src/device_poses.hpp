// Where a test's hand holds the tool at a tick.
#pragma once

#include "src/haptics/device.hpp"

#include <cmath>
#include <numbers>

namespace spherecut::tests {

inline const Eigen::Quaterniond unturned = Eigen::Quaterniond::Identity();

inline app::DeviceState device_at(std::uint64_t tick, const Vector3& position,
                                  const Eigen::Quaterniond& orientation = unturned) {
  return {tick, 1e-3 * static_cast<double>(tick), position, orientation, true};
}

/// Down to 2 mm, 4 mm sideways, and up again, all within contact from tick 60 on: a closed loop of 400 ticks.
inline Vector3 around(std::uint64_t tick) {
  const double angle = 2 * std::numbers::pi * static_cast<double>(tick) / 400;
  return {0.002 * std::sin(angle), 0.001 * std::sin(2 * angle), 0.0292 - 0.001 * std::cos(angle)};
}

} // namespace spherecut::tests
