// The simulation side of the haptic loop: a session, solved where the device is.
#pragma once

#include "src/haptics/contact_snapshot.hpp"
#include "src/haptics/device.hpp"
#include "src/haptics/loop_records.hpp"
#include "src/session/session.hpp"

namespace spherecut::app {

/// Coarsening rule of a loop that must not fall behind: a rebuild (nodes that follow the tool, a cut) that took longer
/// than its budget raises the level by one, up to most_degradation; eight rebuilds in a row within a third of the
/// budget lower it by one. At level n the next rebuild makes its nodes with spacings coarse_per_level^n times the
/// scenario's. A solve without a rebuild changes nothing. The haptic rate is never touched.
inline constexpr int most_degradation = 4;
inline constexpr double coarse_per_level = 1.19; // 2^(1/4): half the time of a dense solve in about one level

class DegradationRule {
 public:
  explicit DegradationRule(double budget) : budget_(budget) {}
  [[nodiscard]] int level() const { return level_; }
  void rebuilt(double seconds);
  /// What a solve of so many seconds did: a body that was made in the background counts as within a third of the budget
  /// where it came early, else as within it.
  void solved(Rebuild rebuild, double seconds);

 private:
  double budget_;
  int level_ = 0, quick_ = 0;
};

/// The first hand holds what HandMode says, the second the blade beside the first one's tool: both are solved at once.
/// When a hand takes the blade anew that is lifted: it cuts from where it is then. So it is after its device has not
/// answered for a while, and after a jump (fastest_hand).
class HapticSimulation {
 public:
  /// As Session. Throws InputError when there is neither tool nor blade to hold.
  explicit HapticSimulation(
      Scenario scenario, std::function<void(const std::string&)> say = [](const std::string&) {});

  /// Throws InputError unless there are tool and blade: what two hands hold.
  void require_two_hands() const;

  /// Builds and condenses the body at the hands' first poses.
  void prepare(const Hands& hands);

  /// A tick that is not solved: the blade's way to the next solve leads through its pose. Ticks come in order, each
  /// once, with those that are solved in between.
  void pass(const Hands& hands);

  /// Solves at the poses of the hands and the time of the first and fills the snapshots; their sequence is the
  /// caller's. `second` is that of the second hand, without force where that holds nothing; null: not wanted. Throws
  /// NumericalError or InputError as Session::step; the snapshots are then as before.
  void solve(const Hands& hands, int degradation, ContactSnapshot& snapshot, ContactSnapshot* second = nullptr);

  /// Whether a body that was made in the background waits to be taken over; and takes it over, after waiting for it
  /// where need be.
  [[nodiscard]] bool body_is_there() const { return session_.pending().there; }
  void swap_body() { session_.swap_body(); }
  [[nodiscard]] bool has_put_off() const { return session_.pending().put_off; }
  /// SessionOptions::following_in_background.
  void set_following_in_background(bool on);

  /// Result of the last solve.
  [[nodiscard]] const StepResult& result() const { return result_; }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const topology::ToolShape& tool() const;
  /// Whether a tear has grown in the last solve: it may grow on in the next, wherever the device is.
  [[nodiscard]] bool tearing() const { return result_.tear && result_.tear->increments.size() > 1; }
  /// Whether the first hand held the blade in the last solve.
  [[nodiscard]] bool holds_blade() const;
  [[nodiscard]] std::vector<PathPose> path() const { return driven_path(session_.steps()); }
  /// That of the blade. Throws InputError when there is none.
  [[nodiscard]] std::vector<PathPose> second_path() const { return blade_path(session_.steps()); }
  /// Where the tool is while the hand holds something else: away from the organ, on the line through the start of its
  /// way. Nothing in a scenario without a tool.
  [[nodiscard]] std::optional<topology::ToolPose> parked_tool() const;

 private:
  [[nodiscard]] StepSample sample(const Hands& hands) const;
  /// What has the blade.
  enum class Holder : std::uint8_t { nobody, path, first, second };
  [[nodiscard]] Holder holder(const Hands& hands) const;
  void watch_blade(const Hands& hands);
  void fill_tool(ContactSnapshot& snapshot);
  void fill_blade(const DeviceState& device, ContactSnapshot& snapshot) const;
  void fill_common(const DeviceState& device, ContactSnapshot& snapshot) const;
  [[nodiscard]] bool solved_before(double time) const { return last_time_ && *last_time_ < time; }

  Session session_;
  StepResult result_;
  std::shared_ptr<const CondensedContact> condensed_; // handed over last
  std::optional<topology::ToolPose> parked_;
  std::optional<double> last_time_;         // s, of the device in the last solve
  std::uint64_t last_tick_ = 0;             // of that
  std::vector<topology::BladePose> passed_; // by the blade since then, some way apart
  int degradation_ = 0;
  HandMode mode_ = HandMode::usual; // of the first hand in the last solve
  Holder holder_ = Holder::nobody;  // in the last tick
  DeviceState held_;                // of that hand
  int rested_ = 0;                  // ticks for which that hand has not moved, at most longest_unheard
  bool let_go_ = false;             // the blade has been since the last solve, or was taken up elsewhere
};

/// Solves as an event says and tells what came of it. A failure leaves the snapshots as they were. Throws Interrupted.
SolveRecord solve_recording(HapticSimulation& simulation, const Hands& hands, const SolveEvent& event,
                            ContactSnapshot& snapshot, ContactSnapshot* second = nullptr);

} // namespace spherecut::app
