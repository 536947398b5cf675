#include "src/blade/course.hpp"

#include "src/scenario/schedule.hpp"

namespace spherecut::app {
namespace {

constexpr double stop_distance = 0.1; // node spacings: poses nearer to each other are one, of a way that is made up for

} // namespace

void BladeCourse::lead_through(std::span<const topology::BladePose> poses) {
  if (empty() && !poses.empty())
    at_ = poses.back();
  poses_.insert(poses_.end(), poses.begin(), poses.end());
}

void BladeCourse::move_front(std::size_t poses) {
  poses_.erase(poses_.begin(), poses_.begin() + static_cast<std::ptrdiff_t>(poses));
}

void BladeCourse::skip_open_cut(const BladeEdge& edge, const BodyModel& now) {
  while (poses_.size() > 1 && edge.is_in_open_cut(poses_[1], now))
    poses_.pop_front();
}

double BladeCourse::travel(const BladeEdge& edge, std::size_t from, std::size_t to) const {
  double sum = 0;
  for (std::size_t k = from; k < to; ++k)
    for (const BladeEdge::Piece& piece : edge.pieces())
      sum += (placed(poses_[k + 1], piece.point) - placed(poses_[k], piece.point)).norm();
  return sum / static_cast<double>(edge.pieces().size());
}

std::vector<topology::BladePose> BladeCourse::up_to(const BladeEdge& edge, std::size_t front, std::size_t last,
                                                    double remaining) {
  std::size_t leg = last;
  while (leg > front) {
    const double length = travel(edge, leg - 1, leg);
    if (remaining <= same_pose * length)
      break;
    if (remaining < (1 - same_pose) * length) {
      const topology::BladePose stop = pose_between(poses_[leg - 1], poses_[leg], 1 - remaining / length);
      poses_.insert(poses_.begin() + static_cast<std::ptrdiff_t>(leg), stop);
      break;
    }
    remaining -= length;
    --leg;
  }
  return {poses_.begin() + static_cast<std::ptrdiff_t>(front) + 1,
          poses_.begin() + static_cast<std::ptrdiff_t>(leg) + 1};
}

std::vector<std::size_t> BladeCourse::stops(const BladeEdge& edge) const {
  std::vector<std::size_t> stops;
  const std::size_t last = this->last();
  std::size_t next = last;
  while (next > 0 && poses_[next - 1].time > at_.time)
    --next;
  topology::BladePose from = at_;
  for (; next < last; ++next)
    if (edge_travel(edge.settings().edge, from, poses_[next]) > stop_distance * edge.spacing()) {
      stops.push_back(next);
      from = poses_[next];
    }
  stops.push_back(last);
  return stops;
}

} // namespace spherecut::app
