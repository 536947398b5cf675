// The way of a blade through the steps, and how far the body is behind it.
#pragma once

#include "src/scenario/schedule.hpp"
#include "src/tissue/options.hpp"

namespace spherecut::app {

/// A blade of a scenario. Without one every step leaves it as it is.
class BladeTrack {
 public:
  /// The scenario must outlive this.
  explicit BladeTrack(const Scenario& scenario) : scenario_(scenario) {}

  /// A step begins: the blade goes through `passed` to the pose of the sample. `fine`, m: a blade that goes less than a
  /// millionth of it has not moved.
  void begin_step(const StepSample& sample, std::vector<topology::BladePose> passed, double fine);
  /// It has come to the pose of the step; without one it stays where it was.
  void arrive(const StepSample& sample);
  /// It leaves the tissue where it is, and its next pose places it; from now on its way is not the scenario's. What has
  /// been put off is still to be cut up to where it was.
  void lift();
  /// It has been placed, and cuts from there.
  void put_down() { lifted_ = false; }
  /// Where it was, which it then has not been.
  std::optional<topology::BladePose> take_last() { return std::exchange(last_, std::nullopt); }

  /// In the last step that had one, and since then, before the pose of this step.
  [[nodiscard]] const std::optional<topology::BladePose>& last() const { return last_; }
  [[nodiscard]] const std::vector<topology::BladePose>& passed() const { return passed_; }
  /// m, of the edge from the last through those to this pose.
  [[nodiscard]] double way_to(const topology::BladePose& pose) const;
  /// Whether it has not moved for a while, or there is none; and whether it did in the step at `time`.
  [[nodiscard]] bool rests() const { return rests_; }
  [[nodiscard]] bool moved_at(double time) const { return moved_ == time; }
  [[nodiscard]] bool is_lifted() const { return lifted_; }
  /// Whether it goes where it likes, not along the scenario's path.
  [[nodiscard]] bool is_hand_led() const { return hand_led_; }

  /// m that the edge has gone since the body last followed its cut.
  [[nodiscard]] double put_off() const { return put_off_; }
  void put_off(double way) { put_off_ += way; }
  void body_follows() { put_off_ = 0; }

 private:
  const Scenario& scenario_;
  std::optional<topology::BladePose> last_;
  std::vector<topology::BladePose> passed_;
  double moved_ = 0; // s, when it last did
  bool rests_ = true, lifted_ = false, hand_led_ = false;
  double put_off_ = 0;
};

} // namespace spherecut::app
