#include "solvers/nodes/nodes.hpp"

#include "solvers/nodes/filler.hpp"
#include "topology/base/errors.hpp"
#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {

int NodeCloud::add(const Vector3& position, double spacing, NodeKind kind, const Vector3& normal) {
  positions.push_back(position);
  spacings.push_back(spacing);
  reaches.push_back(spacing);
  kinds.push_back(kind);
  normals.push_back(normal);
  return size() - 1;
}

int NodeCloud::add(const NodeCloud& other, int i) {
  const int added = add(other.positions[i], other.spacings[i], other.kinds[i], other.normals[i]);
  reaches[added] = other.reaches[i];
  return added;
}

double SpacingField::operator()(const Vector3& x) const {
  if (centres.empty() && segments.empty())
    return coarse;
  double squared = std::numeric_limits<double>::infinity();
  for (const Vector3& centre : centres)
    squared = std::min(squared, (x - centre).squaredNorm());
  double distance = std::sqrt(squared) - radius;
  if (!segments.empty())
    distance = std::min(distance, distance_to_segments(x, segments));
  return std::clamp(fine + slope * (distance - plateau * fine), fine, coarse);
}

double SpacingField::reach(const Vector3& x, double h) const {
  constexpr double full = 2; // spacings: sphere for which nodes are counted
  constexpr int shells = 4;
  if (centres.empty() && segments.empty())
    return h;
  // Six faces and eight corners of a cube: mean over a sphere to third degree.
  static const std::array<Vector3, 14> directions = [] {
    std::array<Vector3, 14> result;
    int k = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (const double sign : {-1.0, 1.0})
        result[k++] = sign * Vector3::Unit(axis);
    for (int corner = 0; corner < 8; ++corner)
      result[k++] = Vector3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1) / std::sqrt(3.0);
    return result;
  }();
  // In units of the nodes that a constant spacing puts into the sphere.
  double nodes = 0, inner = 0;
  for (int shell = 0; shell < shells; ++shell) {
    const double middle = full * (shell + 0.5) / shells, outer = std::pow((shell + 1.0) / shells, 3);
    double density = 0;
    for (const Vector3& direction : directions) {
      const double ratio = h / (*this)(x + middle * h * direction);
      density += ratio * ratio * ratio / directions.size();
    }
    if (nodes + density * (outer - inner) > 1)
      return h * std::cbrt(inner + (1 - nodes) / density);
    nodes += density * (outer - inner);
    inner = outer;
  }
  return h;
}

std::vector<std::array<Vector3, 2>> front_segments(const topology::Incision& incision, double length) {
  if (!(length > 0))
    throw InputError(fmt::format("front_segments: pieces of {} m are asked for; the length must be positive", length));
  // A straight run stays whole; another ends where it turns by 20 degrees or its chord exceeds the length.
  std::vector<std::array<Vector3, 2>> result;
  const topology::FrontSegment* last = nullptr;
  Vector3 start = Vector3::Zero();
  bool straight = true;
  for (const topology::FrontSegment& piece : incision.front()) {
    const Vector3 direction = (piece.to - piece.from).normalized();
    const double turn = direction.dot(start);
    const bool goes_on = last != nullptr && last->to == piece.from && last->sheet == piece.sheet;
    const bool still_straight = straight && turn > 1 - 1e-9;
    if (goes_on && (still_straight || (turn > 0.94 && (piece.to - result.back()[0]).norm() <= length))) {
      result.back()[1] = piece.to;
      straight = still_straight;
    } else {
      result.push_back({piece.from, piece.to});
      start = direction;
      straight = true;
    }
    last = &piece;
  }
  return result;
}

std::vector<int> lip_partners(const NodeCloud& nodes) {
  std::vector<int> lips, partners(nodes.size(), -1);
  std::vector<Vector3> places;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] == NodeKind::lip) {
      lips.push_back(i);
      places.push_back(nodes.positions[i]);
    }
  const topology::PointTree tree(places);
  std::vector<topology::PointTree::Found> found;
  for (int k = 0; k < std::ssize(lips); ++k) {
    const int i = lips[k];
    found.clear();
    tree.within(places[k], 20 * lip_offset * nodes.spacings[i], found);
    std::sort(found.begin(), found.end());
    for (const auto& [squared, other] : found)
      if (nodes.normals[lips[other]].dot(nodes.normals[i]) < 0 && partners[i] < 0)
        partners[i] = lips[other];
  }
  return partners;
}

namespace {

SprinkleOptions without_cut(SprinkleOptions options) {
  options.incision = nullptr;
  options.ring_ahead = false;
  return options;
}

/// The nodes of the uncut body with those on the faces of the cut behind them.
Sprinkling with_lips_apart(Sprinkling uncut, const topology::Domain& domain, const SprinkleOptions& options,
                           const NodeCloud* previous) {
  std::vector<int> kept;
  if (previous != nullptr)
    for (int j = 0; j < previous->size(); ++j)
      if (previous->kinds[j] == NodeKind::lip)
        if (const auto on = options.incision->closest(previous->positions[j], 0.01 * previous->spacings[j]); on)
          kept.push_back(j);
  NodeCloud stays;
  for (const int j : kept) {
    stays.add(*previous, j);
    uncut.nodes.add(*previous, j);
    uncut.kept_from.push_back(j);
  }
  const NodeCloud places = lip_places(domain, options, previous != nullptr ? &stays : nullptr, nullptr);
  for (int i = 0; i < places.size(); ++i) {
    uncut.nodes.add(places, i);
    if (previous != nullptr)
      uncut.kept_from.push_back(-1);
  }
  uncut.report.lip_nodes = static_cast<int>(kept.size()) + places.size();
  return uncut;
}

} // namespace

Sprinkling sprinkle(const topology::Domain& domain, const SprinkleOptions& options) {
  check_options(options);
  if (options.lips_apart && options.incision != nullptr)
    return with_lips_apart(sprinkle(domain, without_cut(options)), domain, options, nullptr);
  Filler filler(domain, options);
  filler.place_seeds();
  filler.place_cut();
  filler.place_edges();
  filler.fill_surface();
  filler.fill_interior();
  filler.thicken_pieces();
  return filler.finish();
}

Sprinkling resprinkle(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& previous) {
  check_options(options);
  if (options.lips_apart && options.incision != nullptr) {
    NodeCloud base;
    std::vector<int> ids;
    for (int j = 0; j < previous.size(); ++j)
      if (previous.kinds[j] != NodeKind::lip) {
        base.add(previous, j);
        ids.push_back(j);
      }
    Sprinkling uncut = resprinkle(domain, without_cut(options), base);
    for (int& from : uncut.kept_from)
      from = from < 0 ? -1 : ids[from];
    return with_lips_apart(std::move(uncut), domain, options, &previous);
  }
  Filler filler(domain, options);
  filler.place_seeds();
  filler.keep(previous);
  filler.place_cut();
  filler.place_edges();
  filler.fill_surface();
  filler.fill_interior();
  filler.thicken_pieces();
  return filler.finish();
}

} // namespace spherecut::solvers
