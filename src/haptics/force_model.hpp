// The force between two solves. A model is told of every solve and asked for the force at the tool's pose once a tick,
// by the haptic thread alone: nothing here allocates, locks, waits or throws after construction.
#pragma once

#include "src/haptics/contact_snapshot.hpp"
#include "src/scenario/haptic_settings.hpp"

#include <memory>
#include <optional>

namespace spherecut::app {

struct ModelForce {
  Vector3 force = Vector3::Zero();  // N, of the body on the tool
  Vector3 torque = Vector3::Zero(); // N m, of the same about the tool's point
  std::optional<double> stored{};   // J, elastic energy behind the force; empty: the model knows of none
  bool found = false;   // the stored energy may step at a solve: the hand has put in no more than its own work
  double stiffness = 0; // N/m, by which the force rises against a motion along it; 0: it does not know
  int active = 0;       // nodes in contact; pieces of a blade's edge
  int rounds = 0;       // linearisations of the tool's surface
  bool converged = true;
  double sinking = 0; // m, deepest candidate inside the tool
};

class ForceModel {
 public:
  virtual ~ForceModel() = default;
  /// A new solve; the snapshot stays what it is until the next call. True: it changes nothing in the force, which goes
  /// on as before.
  virtual bool solved(const ContactSnapshot& snapshot) noexcept = 0;
  /// Force and torque with the tool at `pose` at `time` (s), zero before the first solve; of a blade, whose frame is
  /// turned by `orientation`, `pose.point` alone counts.
  virtual ModelForce at(const topology::ToolPose& pose, const Eigen::Quaterniond& orientation,
                        double time) noexcept = 0;
  /// Fetches what the next at() will read into the processor's caches; changes nothing.
  virtual void fetch() const noexcept {}
};

/// A model for the tool of a scenario. The shape must outlive it.
std::unique_ptr<ForceModel> make_force_model(ForceModelKind kind, const topology::ToolShape& tool);

} // namespace spherecut::app
