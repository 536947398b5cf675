// The blade of a run against its tissue (solvers/contact/blade_contact.hpp): where its edge presses, what force that
// takes, and when the next piece of its way is cut. The cut lags behind the blade: its front is where the blade once
// was, and the blade has pushed the material there ahead of itself ever since.
//
// The next cut is built before it is due, as a proposal, and taken at the moment at which the difference of the two
// bodies' energies pays for it. Up to then everything, the force too, is that of the body as it is.
#pragma once

#include "src/blade/course.hpp"
#include "src/blade/grip.hpp"

#include <functional>

namespace spherecut::app {

/// What the blade feels at the end of a step, and where its work has gone since the start.
struct BladeReport {
  Vector3 force = Vector3::Zero();  // N, of the tissue on the blade: edge and flanks
  Vector3 torque = Vector3::Zero(); // N m, of the same about the origin of the blade's frame
  double edge_force = 0;            // N, of the edge alone
  double advance = 0;               // m, farthest that the edge has pushed material ahead of itself
  double release = 0;               // J/m2, of the edge's force on the front that it presses
  int contacts = 0;                 // pieces of the edge that press
  bool converged = true;
  solvers::BladeLedger ledger;
};

inline constexpr double first_trigger = 1.2;            // of the needed release, at which a first cut is proposed
inline constexpr double first_wait = 2 * first_trigger; // the same, past which the blade waits for a first cut

/// What the edge tells in a state, without ledger and torque.
BladeReport report_of(const EdgeMeeting& meeting, const solvers::BladeState& state);
/// Whether most of its force is where nothing is cut yet.
bool first_cut(const EdgeMeeting& meeting, const solvers::BladeState& state);

/// Where a piece of an edge presses on the front of a cut.
struct FrontPlace {
  Vector3 point = Vector3::Zero(); // m, at rest
  double share = 0;                // of the length of the edge that presses, on surfaces as well
};

class BladeForce {
 public:
  BladeForce(const Scenario& scenario, BladeEdge edge);

  [[nodiscard]] const BladeEdge& edge() const { return edge_; }
  [[nodiscard]] const BladeCourse& way() const { return way_; }

  /// Whether a part of the edge is inside the body, or pushes tissue ahead of itself beyond where that was.
  [[nodiscard]] bool meets(const topology::BladePose& pose, const BodyModel& body) const;
  /// The blade goes on through poses to the last. `body` is solved, without blade.
  void go_to(std::span<const topology::BladePose> poses, const BodyModel& body);
  /// Poses on its way to the next that it goes on to.
  void pass_by(std::span<const topology::BladePose> poses) { way_.lead_through(poses); }
  /// Once its last motion has brought the whole edge out of `body`: how much tissue a piece of the edge has gone
  /// through and not cut on it, m; 0: none, or it was drawn back.
  [[nodiscard]] double passed_uncut(const BodyModel& body) const;
  /// The blade has left the body: its way starts anew from where it is.
  void leave();

  /// The hand has let go of the blade: it is nowhere until it is put somewhere.
  void lift();

  /// Poses through which the next proposal should cut, in order; none: no cut is near. A later cut ends where the edge
  /// would be left with the force of steady cutting at the end of its motion.
  [[nodiscard]] std::vector<topology::BladePose> wanted(const BodyModel& now);
  /// The body with the way cut through these poses. Throws NumericalError where a body at finite strain has no
  /// equilibrium under the edge: what was proposed before stays.
  void propose(BodyModel body, std::size_t poses);
  /// The proposed body is solved anew by `solve`, the tool having moved, and the edge meets it again. Throws as propose
  /// and what `solve` throws; then it is of no use.
  void solve_proposal(const std::function<void(BodyModel&)>& solve);
  /// Where the edge presses on the front of a cut.
  [[nodiscard]] std::vector<FrontPlace> places_at_front() const;
  /// What loads other than the blade release there as the front goes on, J/m2. The edge has the rest to pay.
  void draw_on(double release) { drawn_ = release; }
  /// Where the edge stands, J/m2.
  [[nodiscard]] double toughness() const { return edge_.toughness(meeting_); }
  /// Nothing is proposed any more.
  void withdraw() { proposal_.reset(); }
  /// The cut has grown otherwise: the blade meets the body `now`, and nothing is proposed. Poses of its way that lie in
  /// the open cut are passed.
  void meet_again(const BodyModel& now);
  /// There was nothing to cut through these poses, or it cannot be: the front goes on without a cut.
  void pass(std::size_t poses, const BodyModel& now);
  /// Whether the edge stands against the body.
  [[nodiscard]] bool presses() const { return state_.has_value(); }
  [[nodiscard]] bool proposed() const { return proposal_.has_value(); }
  /// Moves the blade on while its next cut is being made: as far as the force of steady cutting (in a first cut, which
  /// takes more, a multiple of it) or to its pose.
  void wait(const BodyModel& now);
  /// What the edge releases over what a cut takes that nothing else pays for; more than a few times, step by step, is a
  /// cut that does not come.
  [[nodiscard]] double overload() const { return state_ ? report().release / edge_.needed(meeting_, 0) : 0; }
  /// Whether it has been left so far behind its pose that there is a cut to come.
  [[nodiscard]] bool lags() const;

  /// Moves the blade on until the proposal is due (true) or it has reached its pose.
  bool advance(const BodyModel& now);
  struct Taken {
    BodyModel body;
    double surface = 0; // J, of the energy of what has been cut
  };
  /// The proposed body, which is the present one from now on.
  Taken take();

  /// Forces on the shares that a grasper holds, blade and lips included, N on the body, 3 entries each; empty: there is
  /// no such share, the blade does not press, or the law is not linear.
  [[nodiscard]] VectorX on_held() const;
  /// Whether the grasper holds the body as it did when the blade met it last (linear law).
  [[nodiscard]] bool is_gripped_as(const BodyModel& body) const;
  /// Field of the body under the blade; `body.field` where it does not press.
  [[nodiscard]] solvers::Field field(const BodyModel& body) const;
  [[nodiscard]] BladeReport report() const;
  /// How the force goes on from here, on the body `now` that it was left in.
  [[nodiscard]] BladeGrip grip(const BodyModel& now) const;

 private:
  struct Proposal {
    BodyModel body;
    EdgeMeeting meeting;
    std::size_t poses = 0;
    double way = 0;       // m, from the front to the blade when it was proposed
    bool through = false; // it ends outside the body: nothing is left to press on
  };

  [[nodiscard]] double needed() const { return edge_.needed(meeting_, drawn_); } // J/m2
  [[nodiscard]] double needed_for_proposal() const { return needed() * (proposal_->meeting.area - meeting_.area); } // J
  void stroke(const BodyModel& now, const topology::BladePose& target, double share);
  void press(const BodyModel& now);
  [[nodiscard]] static double drag_of(const EdgeMeeting& meeting) { return meeting.patch.dragged ? 1 : 0; }
  [[nodiscard]] static solvers::BladeState state_at(EdgeMeeting& meeting, const BodyModel& body,
                                                    const VectorX& advance);
  void meet_proposal(const EdgeMeeting& last);
  void press_proposal();
  [[nodiscard]] std::optional<double> due_on_way_to(const BodyModel& now, const topology::BladePose& target) const;
  [[nodiscard]] bool is_due();

  BladeEdge edge_;
  bool tears_; // the cut may run ahead of the blade
  BladeCourse way_;
  EdgeMeeting meeting_;
  std::optional<solvers::BladeState> state_; // where the blade is; empty: the edge meets nothing
  std::optional<Proposal> proposal_;
  double drawn_ = 0; // J/m2, released by other loads at the front
  solvers::BladeLedger ledger_;
};

} // namespace spherecut::app
