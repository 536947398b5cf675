// The fine zone of a session: it goes along with the tool, with the fronts of cuts and with the way of the blade.
#pragma once

#include "src/model/incision_builder.hpp"
#include "src/model/node_zone.hpp"
#include "src/model/organ_walls.hpp"
#include "src/tissue/log.hpp"

namespace spherecut::app {

/// Holds between calls: without a tool that touches there is no centre; with one, the spacing is fine about it.
class FineZoneTracker {
 public:
  /// Spacings of the scenario, where it leaves them out fit for the walls of the organ; still without places where they
  /// are fine. Scenario and domain must outlive this. Throws InputError as fine_zone().
  FineZoneTracker(const Scenario& scenario, std::shared_ptr<const topology::Domain> domain);

  [[nodiscard]] const FineZone& zone() const { return zone_; }
  [[nodiscard]] const solvers::SpacingField& spacing() const { return zone_.spacing; }
  [[nodiscard]] double fine() const { return zone_.spacing.fine; } // m
  [[nodiscard]] const OrganWalls& walls() const { return walls_; }
  /// Of the spacings, in those of the scenario.
  [[nodiscard]] double coarseness() const { return coarseness_; }
  /// Spacings `factor` times the scenario's from the next sprinkling on. Throws InputError unless it is positive.
  void coarsen(double factor);

  /// Whether coarse spheres would bridge gaps of the organ; nodes made from now on do not see through them.
  bool find_gaps();
  /// Warns of walls with fewer than three nodes through them; throws InputError where there is less than one spacing.
  void judge_walls(SessionLog& log) const;

  /// Where fine nodes belong: at the contact; under a flat punch, whose deepest point may be anywhere on its end, below
  /// the middle of that.
  [[nodiscard]] topology::SurfaceContact centre_of(const topology::SurfaceContact& contact,
                                                   const topology::ToolPose& pose) const;
  /// The first centre, about which all others lie.
  void begin_at(const topology::SurfaceContact& centre) { centre_ = first_ = centre; }
  /// Fine at `places` of contact, at the fronts of the precuts, whose `wound` is null where there are none, and where
  /// the blade is going to cut; with so many nodes as the scenario asks for.
  void lay_out(std::vector<Vector3> places, const std::shared_ptr<const topology::Incision>& incision,
               const topology::Wound* wound);

  /// Empty: no tool touches.
  [[nodiscard]] const std::optional<topology::SurfaceContact>& centre() const { return centre_; }
  /// Whether the contact has come so far from the centre that the zone must follow.
  [[nodiscard]] bool must_follow(const topology::SurfaceContact& contact) const;
  /// Whether it has left the zone.
  [[nodiscard]] bool is_left_by(const topology::SurfaceContact& contact) const;
  /// Where the centre goes for this contact.
  [[nodiscard]] topology::SurfaceContact next_centre(const topology::SurfaceContact& contact) const;
  void move_to(const topology::SurfaceContact& centre);
  /// Outward normal where the tool comes from; empty: there is none that presses.
  [[nodiscard]] std::optional<Vector3> facing() const;

  /// Of the cut's fronts alone, for a blade that goes where it likes; with the blade's way; with the way ahead.
  void follow_fronts(const topology::Incision& incision);
  void follow_fronts_and_way(const topology::Incision& incision);
  /// Leads the zone ahead of the fronts, so that it lasts for some increments. Returns why nodes have to be made anew;
  /// empty: the zone still holds all fronts.
  std::string lead_ahead(const topology::Incision& incision);
  /// The same for a cut that a hand leads where it likes, as long as it goes through nodes that are fine.
  std::string lead_by_hand(const topology::Incision& incision, const solvers::NodeCloud& nodes);

  /// Segments along which it is fine, to go back to.
  struct Mark {
    std::vector<std::array<Vector3, 2>> segments, led;
  };
  [[nodiscard]] Mark mark() const { return {zone_.spacing.segments, led_segments_}; }
  void go_back(Mark mark);

  /// How nodes are sprinkled now on a body with this incision (null: uncut). `kept`: nodes that stay in place of those
  /// at the centre; null: none.
  [[nodiscard]] solvers::SprinkleOptions sprinkle_options(const std::shared_ptr<const topology::Incision>& incision,
                                                          const std::vector<solvers::SeedNode>* kept) const;

 private:
  void add_way_ahead(const topology::Incision& incision, double spacings);
  [[nodiscard]] std::vector<std::array<Vector3, 2>> fine_segments(const topology::Incision& incision) const;

  const Scenario& scenario_;
  std::shared_ptr<const topology::Domain> domain_;
  FineZone zone_;
  OrganWalls walls_;
  std::shared_ptr<const topology::Incision> gap_walls_;    // null: no narrow gaps
  double coarseness_ = 1;                                  // of the spacings in zone_
  std::vector<std::array<Vector3, 2>> tracks_;             // of the blade, where fine nodes belong
  std::vector<std::array<Vector3, 2>> led_segments_;       // of zone_ when it was last led ahead of a tear's front
  std::optional<topology::SurfaceContact> centre_, first_; // of the zone, and the first one
};

} // namespace spherecut::app
