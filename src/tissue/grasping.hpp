// The grasper of a session: it takes hold of a patch of the surface, and the patch moves as it does.
#pragma once

#include "src/model/body_model.hpp"
#include "src/scenario/schedule.hpp"
#include "topology/wound/wound.hpp"

namespace spherecut::app {

/// Tissue in a grasper's jaws.
struct Grasp {
  Vector3 place = Vector3::Zero(), normal = Vector3::UnitZ(); // m, on the surface at rest; outward there
  topology::ToolPose pose;                                    // when it took hold
  std::vector<Vector3> rest, displacement;                    // m, of the patch when it took hold
  std::vector<solvers::SeedNode> nodes;                       // its own and those about it: they stay while it holds
};

class Grasping {
 public:
  /// Scenario and domain must outlive this. A scenario without grasper never holds anything.
  Grasping(const Scenario& scenario, const topology::Domain& domain) : scenario_(scenario), domain_(domain) {}

  [[nodiscard]] bool holds() const { return grasp_.has_value(); }
  /// Its own nodes and those about it, which stay while it holds; null: it holds nothing.
  [[nodiscard]] const std::vector<solvers::SeedNode>* kept_nodes() const { return grasp_ ? &grasp_->nodes : nullptr; }

  /// What the grasper does next to the tissue that it holds or not.
  enum class Change : std::uint8_t { none, closes, opens };
  /// At this moment, by the times of the scenario or, in their place, by `grip` of a hand. A piece that has come off is
  /// not taken again before the grasper has been open.
  Change change_at(const StepSample& sample, const std::optional<bool>& grip);

  /// Free nodes of the surface between the jaws of a grasp: within the radius of its place, not beyond a cut. `fine`,
  /// m: spacing of the nodes. Throws InputError when there are none.
  [[nodiscard]] std::vector<int> nodes_between(const Grasp& grasp, const BodyModel& model, double fine) const;
  /// Likewise of the tissue that it holds.
  [[nodiscard]] std::vector<int> nodes(const BodyModel& model, double fine) const {
    return nodes_between(*grasp_, model, fine);
  }
  /// The place of the surface at rest nearest to `at_rest`, and the nodes there that will stay.
  [[nodiscard]] Grasp reach_for(const Vector3& at_rest, const topology::ToolPose& pose, const BodyModel& model,
                                double fine) const;
  /// Why jaws about this place, which has moved with the model, would hold nothing: the tool is too far from it.
  [[nodiscard]] std::optional<std::string> miss(const Grasp& grasp, const StepSample& sample,
                                                const BodyModel& model) const;
  void take(Grasp grasp) { grasp_ = std::move(grasp); }
  void let_go() { grasp_.reset(); }

  /// Displacements, m, that the grasper gives to the patch of a model: those in which it took hold, and its own way
  /// since.
  [[nodiscard]] std::vector<Vector3> displacements(const topology::ToolPose& pose, const BodyModel& model) const;

  /// Whether the piece that it holds is severed from every fixed region.
  [[nodiscard]] bool piece_is_free(const topology::Wound& wound) const;
  /// That piece has come off: the grasper holds nothing more until it has been open. Returns what it held.
  Grasp lose();
  /// It has not come off.
  void take_back(Grasp grasp);

 private:
  const Scenario& scenario_;
  const topology::Domain& domain_;
  std::optional<Grasp> grasp_;
  bool lost_ = false; // the piece has come off while it was closed
};

/// Where the grasper will take hold of the organ at rest. Throws InputError when `on_path` and its path does not reach
/// it; a device takes it elsewhere.
FirstTouch find_grasp(const Scenario& scenario, const topology::Domain& domain, const std::vector<ToolSample>& motion,
                      bool on_path);

} // namespace spherecut::app
