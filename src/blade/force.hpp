// The blade of a run against its tissue (solvers/contact/blade_contact.hpp): where its edge presses, what force that
// takes, and when the next piece of its way is cut. The cut lags behind the blade: its front is where the blade once
// was, and the blade has pushed the material there ahead of itself ever since.
//
// The next cut is built before it is due, as a proposal, and taken at the moment at which the difference of the two
// bodies' energies pays for it. Up to then everything, the force too, is that of the body as it is.
#pragma once

#include "solvers/contact/blade_contact.hpp"
#include "src/blade/grip.hpp"
#include "src/model/body_model.hpp"
#include "topology/blade/blade.hpp"

#include <deque>
#include <functional>
#include <span>

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

class BladeForce {
 public:
  /// The rest position of what is at a place of a body without blade.
  using MapOf = std::function<topology::RestMap(const BodyModel& body)>;

  /// `spacing`, m: of the nodes where the blade cuts, and of the pieces that its edge is taken in; `toughness`, J/m2,
  /// in the tissue at rest. Throws InputError as solvers::edge_half_width.
  BladeForce(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double spacing, MapOf map_of,
             std::function<double(const Vector3&)> toughness);

  /// m, of the edge's contact; `finer_than_nodes` when they are too coarse for it and stand for it instead.
  [[nodiscard]] double half_width() const { return half_width_; }
  [[nodiscard]] bool finer_than_nodes() const { return finer_; }

  /// Whether a part of the edge is inside the body, or pushes tissue ahead of itself beyond where that was.
  [[nodiscard]] bool meets(const topology::BladePose& pose, const BodyModel& body) const;
  /// Whether a part of the edge is inside the body.
  [[nodiscard]] bool inside(const topology::BladePose& pose, const BodyModel& body) const;

  /// Whether it has been anywhere yet.
  [[nodiscard]] bool has_place() const { return !way_.empty(); }
  /// The blade goes on to a pose, or through several to the last. `body` is solved, without blade.
  void go_to(const topology::BladePose& pose, const BodyModel& body);
  void go_to(std::span<const topology::BladePose> poses, const BodyModel& body);
  /// Poses on its way to the next that it goes on to.
  void pass_by(std::span<const topology::BladePose> poses) { way_.insert(way_.end(), poses.begin(), poses.end()); }
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
  /// The body with the way cut through these poses. `drawn`, J: what loads other than the blade release by that cut;
  /// the edge has the rest to pay.
  void propose(BodyModel body, std::size_t poses, double drawn = 0);
  /// Nothing is proposed any more.
  void withdraw() { proposal_.reset(); }
  /// Energy of the surface that the proposal makes, J.
  [[nodiscard]] double proposed_surface() const;
  /// The cut has grown otherwise: the blade meets the body `now`, and nothing is proposed. Poses of its way that lie in
  /// the open cut are passed.
  void meet_again(const BodyModel& now);
  /// There was nothing to cut through these poses, or it cannot be: the front goes on without a cut.
  void pass(std::size_t poses, const BodyModel& now);
  [[nodiscard]] bool proposed() const { return proposal_.has_value(); }
  /// Moves the blade on while its next cut is being made: as far as the force of steady cutting (in a first cut, which
  /// takes more, a multiple of it) or to its pose.
  void wait(const BodyModel& now);
  /// Whether it has been left so far behind its pose that there is a cut to come.
  [[nodiscard]] bool lags() const;
  /// m, from the front of the cut to the blade's pose; 0: it has been nowhere.
  [[nodiscard]] double way_left() const { return way_.empty() ? 0 : travel(0, way_.size() - 1); }

  /// Moves the blade on until the proposal is due (true) or it has reached its pose.
  bool advance(const BodyModel& now);
  /// The proposed body, which is the present one from now on.
  BodyModel take();

  /// Field of the body under the blade; `body.field` where it does not press.
  [[nodiscard]] solvers::Field field(const BodyModel& body) const;
  [[nodiscard]] BladeReport report() const;
  /// How the force goes on from here, on the body `now` that it was left in.
  [[nodiscard]] BladeGrip grip(const BodyModel& now) const;

 private:
  struct EdgePiece {
    Vector3 point, along; // m, in the blade's frame; unit
    double length = 0;    // m
  };
  /// A body as the edge meets it.
  struct Meeting {
    std::vector<int> pieces; // of the edge, one a contact
    solvers::BladePatch patch;
    std::vector<char> surface; // contacts where nothing is cut yet
    double area = 0;           // m2 cut
    bool drawn_back = false;   // the blade goes back: its flanks drag the other way
    // The body, whose patch serves for the next meeting as well.
    const solvers::Discretisation* body = nullptr;
    std::shared_ptr<const topology::Incision> incision;
    std::vector<Vector3> nodes; // m
    [[nodiscard]] bool is_with(const BodyModel& model) const {
      return body == model.body.get() && incision == model.incision && nodes == model.sprinkling.nodes.positions;
    }
  };
  struct Proposal {
    BodyModel body;
    Meeting meeting;
    std::size_t poses = 0;
    double way = 0;       // m, from the front to the blade when it was proposed
    double drawn = 0;     // J, released by other loads
    bool through = false; // it ends outside the body: nothing is left to press on
  };

  [[nodiscard]] bool lies_in(const topology::Incision& cut, const topology::RestMap& to_rest, const Vector3& x) const;
  [[nodiscard]] Meeting meet(const BodyModel& body, std::size_t front, const Meeting& last) const;
  void add_contact(const BodyModel& body, const topology::RestMap& to_rest, std::size_t front, int piece,
                   Meeting& meeting, std::vector<solvers::EdgeContact>& contacts) const;
  [[nodiscard]] double reach(const Meeting& meeting, Eigen::Index contact, const BodyModel& body,
                             const topology::RestMap& to_rest, const Vector3& x) const;
  [[nodiscard]] VectorX motions(const Meeting& meeting, const topology::BladePose& pose) const;
  [[nodiscard]] bool leaves_bridge(const BodyModel& now, std::size_t last, double cut) const;
  [[nodiscard]] VectorX advances(const Meeting& meeting, const BodyModel& body, const topology::BladePose& pose) const;
  [[nodiscard]] solvers::ForcePattern drag(const BodyModel& body, const std::vector<solvers::EdgeContact>& contacts,
                                           const Vector3& way) const;
  [[nodiscard]] double toughness_of(const Meeting& meeting) const;
  [[nodiscard]] double needed() const { return toughness_of(meeting_) / settings_.sharpness; } // J/m2
  [[nodiscard]] double needed_for_proposal() const;                                            // J
  void pass_open_cut(const BodyModel& now);
  [[nodiscard]] bool first_cut(const solvers::BladeState& state) const;
  [[nodiscard]] bool is_past_due(const VectorX& advance) const;
  void stroke(const BodyModel& now, const topology::BladePose& target, double share);
  [[nodiscard]] double travel(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::vector<topology::BladePose> poses_up_to(std::size_t front, std::size_t last, double remaining);
  [[nodiscard]] std::vector<std::size_t> stops() const;
  [[nodiscard]] BladeReport report_of(const solvers::BladeState& state) const;
  [[nodiscard]] solvers::BladeTorque torque() const;
  void press(const BodyModel& now);

  BladeSettings settings_;
  std::function<double(const Vector3&)> toughness_; // J/m2
  double spacing_, half_width_;
  bool finer_ = false;
  bool tears_; // the cut may run ahead of the blade
  solvers::LipCondition lips_;
  std::shared_ptr<const topology::Domain> domain_;
  MapOf map_of_;
  std::vector<EdgePiece> edge_;
  std::deque<topology::BladePose> way_; // from the front of the cut to the blade's target
  topology::BladePose at_;              // of the blade: on its way to the last of way_
  Meeting meeting_;
  std::optional<solvers::BladeState> state_; // at at_; empty: the edge meets nothing
  std::optional<Proposal> proposal_;
  solvers::BladeLedger ledger_;
};

} // namespace spherecut::app
