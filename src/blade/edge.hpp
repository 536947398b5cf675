// The edge of a blade against a body: where its pieces meet that, how far they push, and what lies ahead of them.
#pragma once

#include "solvers/contact/blade_contact.hpp"
#include "src/model/body_model.hpp"
#include "topology/blade/blade.hpp"

#include <deque>
#include <functional>

namespace spherecut::app {

inline constexpr double least_increment = 0.2; // of the node spacing: no later cut is shorter, but where the edge gives
                                               // way by less than half of that

/// Poses on the way of a blade, the first at the front of its cut.
using BladePoses = std::deque<topology::BladePose>;

/// Against what a piece of the edge stands.
enum class EdgeStand : std::uint8_t {
  front,   // of a cut
  surface, // nothing is cut there yet
  inside,  // where it has slid in along its own line: it cuts on from there as from a front, of which there is none yet
};

/// A body as the edge meets it.
struct EdgeMeeting {
  std::vector<int> pieces; // of the edge, one a contact
  solvers::BladePatch patch;
  std::vector<EdgeStand> stands; // of the contacts
  double area = 0;               // m2 cut
  bool drawn_back = false;       // the blade goes back: its flanks drag the other way
  // The body, whose patch serves for the next meeting as well.
  const solvers::Discretisation* body = nullptr;
  const FiniteModel* finite = nullptr;
  std::shared_ptr<const topology::Incision> incision;
  std::vector<Vector3> nodes; // m
  std::vector<int> held;      // of them, by a grasper
  VectorX grip, held_base;    // m, N on the body at them, 3 entries each, with lips open and without the blade
  [[nodiscard]] bool is_with(const BodyModel& model) const {
    return body == model.body.get() && finite == model.finite.get() && incision == model.incision &&
           nodes == model.sprinkling.nodes.positions;
  }
};

class BladeEdge {
 public:
  /// The rest position of what is at a place of a body without blade.
  using MapOf = std::function<topology::RestMap(const BodyModel& body)>;
  struct Piece {
    Vector3 point, along; // m, in the blade's frame; unit
    double length = 0;    // m
  };

  /// `spacing`, m: of the nodes where the blade cuts, and of the pieces that its edge is taken in; `toughness`, J/m2,
  /// in the tissue at rest. Throws InputError as solvers::edge_half_width.
  BladeEdge(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain, double spacing, MapOf map_of,
            std::function<double(const Vector3&)> toughness);

  [[nodiscard]] const BladeSettings& settings() const { return settings_; }
  [[nodiscard]] bool grasps() const { return grasps_; } // the tool is a grasper
  [[nodiscard]] const std::vector<Piece>& pieces() const { return pieces_; }
  [[nodiscard]] double spacing() const { return spacing_; }
  /// m, of the edge's contact; `finer_than_nodes` when they are too coarse for it and stand for it instead.
  [[nodiscard]] double half_width() const { return half_width_; }
  [[nodiscard]] bool finer_than_nodes() const { return finer_; }
  /// Where a piece is at a pose, m.
  [[nodiscard]] Vector3 place(const topology::BladePose& pose, int piece) const {
    return placed(pose, pieces_[static_cast<std::size_t>(piece)].point);
  }

  /// Whether a part of the edge is inside the body.
  [[nodiscard]] bool inside(const topology::BladePose& pose, const BodyModel& body) const;
  /// Whether all of it that is inside lies in the open cut, away from its front.
  [[nodiscard]] bool is_in_open_cut(const topology::BladePose& pose, const BodyModel& body) const;
  /// The body where the edge meets it on its way from poses[front] to the last. What is as it was in the `last` meeting
  /// is not solved for again. At finite strain the patch is that of a body without blade.
  [[nodiscard]] EdgeMeeting meet(const BodyModel& body, const BladePoses& poses, std::size_t front,
                                 const EdgeMeeting& last) const;
  /// Of each piece of the edge that meets something, past its contact's rest position, m.
  [[nodiscard]] VectorX motions(const EdgeMeeting& meeting, const topology::BladePose& pose) const;
  /// The same, no farther than tissue is pushed.
  [[nodiscard]] VectorX advances(const EdgeMeeting& meeting, const BodyModel& body,
                                 const topology::BladePose& pose) const;
  /// Whether a piece that met the body pushes tissue ahead of itself.
  [[nodiscard]] bool pushes(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& pose) const;
  /// Whether a cut by `cut` m from the front on leaves less than a node spacing of tissue, which the nodes cannot tell
  /// of, before an edge that will have gone through all of it at the pose `end`.
  [[nodiscard]] bool leaves_bridge(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& end,
                                   double cut) const;
  /// How much tissue a piece of the edge has gone through and not cut between two poses, the last of them outside, m;
  /// 0: none, or it was drawn back.
  [[nodiscard]] double passed_uncut(const EdgeMeeting& meeting, const BodyModel& body, const topology::BladePose& from,
                                    const topology::BladePose& to) const;
  /// Where the edge stands, J/m2; and what its force has to release for a cut there, `paid` of which loads release.
  [[nodiscard]] double toughness(const EdgeMeeting& meeting) const;
  [[nodiscard]] double needed(const EdgeMeeting& meeting, double paid) const;

 private:
  [[nodiscard]] bool lies_in(const topology::Incision& cut, const topology::RestMap& to_rest, const Vector3& x) const;
  void add_contact(const BodyModel& body, const topology::RestMap& to_rest, const BladePoses& poses, std::size_t front,
                   int piece, EdgeMeeting& meeting, std::vector<solvers::EdgeContact>& contacts) const;
  [[nodiscard]] double reach(const EdgeMeeting& meeting, Eigen::Index contact, const BodyModel& body,
                             const topology::RestMap& to_rest, const Vector3& x) const;
  [[nodiscard]] solvers::ForcePattern drag(const BodyModel& body, const std::vector<solvers::EdgeContact>& contacts,
                                           const Vector3& way) const;

  BladeSettings settings_;
  std::function<double(const Vector3&)> toughness_; // J/m2
  double spacing_, half_width_;
  bool finer_ = false;
  solvers::LipCondition lips_;
  bool grasps_; // the tool is a grasper
  std::shared_ptr<const topology::Domain> domain_;
  MapOf map_of_;
  std::vector<Piece> pieces_;
};

/// The body under its loads and its tool: lips that the blade brings together are in its own contact. `grasped`: its
/// patch is held where it is.
solvers::Field without_lips(const BodyModel& body, bool grasped);

} // namespace spherecut::app
