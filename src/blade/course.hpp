// The way of a blade against the tissue: from the front of its cut, past where it is, to its target.
#pragma once

#include "src/blade/edge.hpp"

#include <span>

namespace spherecut::app {

inline constexpr double same_pose = 1e-6; // of the way from one pose to the next: no other pose

/// The blade is somewhere on its way, unless that is empty: then it is nowhere.
class BladeCourse {
 public:
  [[nodiscard]] bool empty() const { return poses_.empty(); }
  [[nodiscard]] std::size_t last() const { return poses_.size() - 1; }
  [[nodiscard]] const BladePoses& poses() const { return poses_; }
  [[nodiscard]] const topology::BladePose& target() const { return poses_.back(); }
  [[nodiscard]] const topology::BladePose& at() const { return at_; }

  /// Goes on to the target through these poses; a blade that is nowhere is put at the last of them.
  void lead_through(std::span<const topology::BladePose> poses);
  /// The blade has come to a pose.
  void come_to(const topology::BladePose& pose) { at_ = pose; }
  /// The front has come to the pose so many after it.
  void move_front(std::size_t poses);
  /// Where a tear has run ahead of the blade, its edge is in the open cut and meets nothing until it comes to the
  /// front: poses there are passed.
  void skip_open_cut(const BladeEdge& edge, const BodyModel& now);
  void clear() { poses_.clear(); }

  /// Mean way of the edge from one of the poses to another, m.
  [[nodiscard]] double travel(const BladeEdge& edge, std::size_t from, std::size_t to) const;
  /// m, from the front of the cut to the target; 0: it has been nowhere.
  [[nodiscard]] double left(const BladeEdge& edge) const { return empty() ? 0 : travel(edge, 0, last()); }
  /// Poses after the one with number `front` up to the place from which there are `remaining` m to that of `last`; that
  /// becomes a pose of the way.
  [[nodiscard]] std::vector<topology::BladePose> up_to(const BladeEdge& edge, std::size_t front, std::size_t last,
                                                       double remaining);
  /// Numbers of the poses that the blade has still to go to, not too near to each other; the last is among them.
  [[nodiscard]] std::vector<std::size_t> stops(const BladeEdge& edge) const;

 private:
  BladePoses poses_;
  topology::BladePose at_; // on the way to the last of them
};

} // namespace spherecut::app
