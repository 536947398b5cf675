// Where the tools of a scenario are about an organ at rest: where they are parked, what they touch.
#pragma once

#include "src/devices/pointer_hand.hpp"
#include "src/live/simulation.hpp"

namespace spherecut::app {

class ToolPlaces {
 public:
  /// `scenario` and `session`, which is one of this scenario, must outlive it.
  ToolPlaces(const Scenario& scenario, const Session& session);

  /// What there is to hold.
  [[nodiscard]] std::vector<HandMode> modes() const;
  /// Away from the organ: the number of a target there is 0.
  [[nodiscard]] PointerTarget parked(HandMode mode) const;
  /// Whether the tool can be put down at a place without being in the organ at rest.
  [[nodiscard]] bool clear_of_organ(const PointerTarget& target) const;

  /// What the tool of a device has before it.
  struct Touch {
    topology::SurfaceContact contact; // on the surface at rest; of a blade where its edge is deepest
    Vector3 axis = Vector3::UnitZ();  // of the tool
    std::optional<double> depth;      // m, of a blade or a grasper in the organ at rest; empty: of a tool that presses
  };
  [[nodiscard]] Touch touch(const topology::ToolShape& tool, const DeviceState& device) const;

 private:
  const Scenario& scenario_;
  std::shared_ptr<const topology::Domain> domain_;
  std::optional<PathPose> tool_start_, blade_start_;
  topology::ContactQuery query_;
};

} // namespace spherecut::app
