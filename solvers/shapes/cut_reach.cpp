#include "solvers/shapes/cut_reach.hpp"

#include "solvers/shapes/cut_sight.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {

namespace {

/// Of a sphere radius: eyes at a bulging face are lifted off it before they look (cut_sight.cpp), by 0.05 at both ends.
constexpr double looking_around = 1.1;
/// Of a sphere radius: nearer to a sheet an eye is lifted off it (topology::eye_at).
constexpr double lifted_below = 0.02;

/// Empty (lower above upper) without places, and infinitely far then.
BoundingBox bounds_of(const std::vector<Vector3>& places) {
  BoundingBox box{Vector3::Constant(1e300), Vector3::Constant(-1e300)};
  for (const Vector3& place : places) {
    box.lower = box.lower.cwiseMin(place);
    box.upper = box.upper.cwiseMax(place);
  }
  return box;
}

/// Between a box and centre +- half, m.
double distance_between(const BoundingBox& box, const Vector3& centre, const Vector3& half = Vector3::Zero()) {
  return (box.lower - centre - half).cwiseMax(centre - half - box.upper).cwiseMax(0).norm();
}

} // namespace

std::vector<Vector3> sample_points(const topology::SurfaceMesh& sheet, std::size_t first_triangle, double spacing) {
  std::vector<Vector3> points;
  std::vector<std::array<Vector3, 3>> pending;
  for (std::size_t t = first_triangle; t < sheet.triangles.size(); ++t) {
    const Triangle& triangle = sheet.triangles[t];
    pending.push_back({sheet.vertices[triangle[0]], sheet.vertices[triangle[1]], sheet.vertices[triangle[2]]});
    while (!pending.empty()) {
      const std::array<Vector3, 3> corner = pending.back();
      pending.pop_back();
      const double longest =
          std::max({(corner[1] - corner[0]).norm(), (corner[2] - corner[1]).norm(), (corner[0] - corner[2]).norm()});
      if (longest <= spacing) {
        points.insert(points.end(), corner.begin(), corner.end());
        continue;
      }
      const std::array<Vector3, 3> middle = {0.5 * (corner[0] + corner[1]), 0.5 * (corner[1] + corner[2]),
                                             0.5 * (corner[2] + corner[0])};
      pending.push_back({corner[0], middle[0], middle[2]});
      pending.push_back({middle[0], corner[1], middle[1]});
      pending.push_back({middle[2], middle[1], corner[2]});
      pending.push_back(middle);
    }
  }
  return points;
}

bool continues(const topology::Incision* before, const topology::Incision& now) {
  if (before == nullptr)
    return true;
  if (now.sheets().size() < before->sheets().size())
    return false;
  for (std::size_t s = 0; s < before->sheets().size(); ++s) {
    const topology::SurfaceMesh &a = before->sheets()[s], &b = now.sheets()[s];
    if (b.triangles.size() < a.triangles.size() || b.vertices.size() < a.vertices.size() ||
        !std::equal(a.triangles.begin(), a.triangles.end(), b.triangles.begin()) ||
        !std::equal(a.vertices.begin(), a.vertices.end(), b.vertices.begin()))
      return false;
  }
  return true;
}

NodeCloud present_nodes(const NodeCloud& nodes, const std::vector<char>& removed) {
  NodeCloud present;
  for (int i = 0; i < nodes.size(); ++i)
    if (removed[i] == 0)
      present.add(nodes, i);
  return present;
}

std::vector<int> places_after(const SprinkleIncrement& change, int count, int grown) {
  std::vector<int> place(count, 0);
  for (const int node : change.removed) {
    if (node < 0 || node >= count)
      throw InputError(fmt::format("node {} cannot be removed: there are {}", node, count));
    place[node] = -1;
  }
  int kept = 0;
  for (int& p : place)
    if (p == 0)
      p = kept++;
  if (grown != kept + change.added.size())
    throw InputError(
        fmt::format("the grown body has {} nodes; {} stay and {} are added", grown, kept, change.added.size()));
  return place;
}

KnownChange known_change(const topology::Incision* before, const topology::Incision& now, const Spheres& spheres_before,
                         const Spheres& spheres_now) {
  KnownChange known{&now, {}, std::vector<char>(static_cast<std::size_t>(spheres_now.size()), 1)};
  if (before != nullptr)
    for (const topology::SurfaceMesh& sheet : before->sheets())
      known.triangles.push_back(static_cast<int>(sheet.triangles.size()));
  if (spheres_before.cut() != nullptr)
    for (int i = 0; i < spheres_now.size(); ++i)
      known.turned[static_cast<std::size_t>(i)] = spheres_now.cut()->has_branch_of(*spheres_before.cut(), i) ? 0 : 1;
  return known;
}

Changes changes_between(const topology::Incision* before, const SpacingAt& spacing_before,
                        const topology::Incision& now, const SpacingAt& spacing_now, double spacing) {
  Changes changes;
  for (std::size_t s = 0; s < now.sheets().size(); ++s) {
    const std::size_t known =
        before != nullptr && s < before->sheets().size() ? before->sheets()[s].triangles.size() : 0;
    const std::vector<Vector3> points = sample_points(now.sheets()[s], known, spacing);
    changes.faces.insert(changes.faces.end(), points.begin(), points.end());
  }
  // Triangles share their corners.
  const auto before_in_order = [](const Vector3& a, const Vector3& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::sort(changes.faces.begin(), changes.faces.end(), before_in_order);
  changes.faces.erase(std::unique(changes.faces.begin(), changes.faces.end()), changes.faces.end());
  // The reach of the enrichment goes with the lengths of the nodes nearest to a segment's ends, so they count too.
  using Ends = std::array<double, 8>;
  const auto ends = [](const topology::FrontSegment& f, const SpacingAt& spacing_at) {
    return Ends{f.from.x(), f.from.y(), f.from.z(), f.to.x(), f.to.y(), f.to.z(), spacing_at(f.from), spacing_at(f.to)};
  };
  std::vector<Ends> old_front, new_front;
  if (before != nullptr)
    for (const topology::FrontSegment& segment : before->front())
      old_front.push_back(ends(segment, spacing_before));
  for (const topology::FrontSegment& segment : now.front())
    new_front.push_back(ends(segment, spacing_now));
  std::sort(old_front.begin(), old_front.end());
  std::sort(new_front.begin(), new_front.end());
  std::vector<Ends> different;
  std::set_symmetric_difference(old_front.begin(), old_front.end(), new_front.begin(), new_front.end(),
                                std::back_inserter(different));
  for (const Ends& e : different) {
    const Vector3 from(e[0], e[1], e[2]), to(e[3], e[4], e[5]);
    const int parts = std::max(1, static_cast<int>(std::ceil((to - from).norm() / spacing)));
    for (int k = 0; k <= parts; ++k)
      changes.front.push_back(from + (to - from) * k / parts);
  }
  return changes;
}

void add_front(const topology::Incision* incision, double spacing, std::vector<Vector3>& places) {
  if (incision == nullptr)
    return;
  for (const topology::FrontSegment& segment : incision->front()) {
    const int parts = std::max(1, static_cast<int>(std::ceil((segment.to - segment.from).norm() / spacing)));
    for (int k = 0; k <= parts; ++k)
      places.push_back(segment.from + (segment.to - segment.from) * k / parts);
  }
}

Reach::Reach(const std::vector<Vector3>& faces, const std::vector<Vector3>& front,
             const std::vector<Vector3>& all_front, double enriched, const std::vector<Vector3>& nodes,
             const std::vector<double>& radii, double slack, KnownChange known)
    : faces_(faces), front_(front), all_front_(all_front), around_faces_(bounds_of(faces)),
      around_front_(bounds_of(front)), around_all_(bounds_of(all_front)), to_faces_(faces), to_front_(front),
      to_all_(all_front), enriched_(enriched), known_(std::move(known)), slack_(slack) {
  std::vector<Vector3> present;
  std::vector<double> present_radii;
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    if (!(radii[j] > 0))
      continue;
    present.push_back(nodes[j]);
    present_radii.push_back(radii[j]);
    const double longest = looking_around * radii[j] + slack,
                 farthest = std::max(longest, (2 * enriched + 1) * radii[j]);
    if (std::min(distance_between(around_faces_, nodes[j]), distance_between(around_front_, nodes[j])) > farthest)
      continue; // most nodes
    const double to_front = to_front_(nodes[j]), to_faces = to_faces_(nodes[j]);
    const bool at_face = std::min(to_front, to_faces) < longest &&
                         (known_.incision == nullptr || known_.incision->near(nodes[j], lifted_below * radii[j]));
    if (const double spare = longest - to_faces; spare > 0)
      by_faces_.push_back({nodes[j], radii[j], spare, at_face});
    if (const double spare = longest - to_front; spare > 0)
      by_front_.push_back({nodes[j], radii[j], spare, at_face});
    // The branch functions at a node are those of the front nearest to it.
    if (enriched > 0 && to_front < (2 * enriched + 1) * radii[j] &&
        (known_.incision == nullptr ? to_front < to_all_(nodes[j]) + 2 * slack : known_.turned[j] != 0))
      by_branch_.push_back({nodes[j], radii[j], 0, at_face});
  }
  const topology::PointTree tree(present);
  const auto radii_beside = [&](const std::vector<Vector3>& places) {
    std::vector<double> beside;
    beside.reserve(places.size());
    for (const Vector3& place : places)
      beside.push_back(present_radii[static_cast<std::size_t>(tree.nearest(place).index)]);
    return beside;
  };
  faces_radii_ = radii_beside(faces_);
  front_radii_ = radii_beside(front_);
  for (const std::vector<double>& some : {front_radii_, radii_beside(all_front_)})
    for (const double radius : some)
      largest_beside_ = std::max(largest_beside_, radius);
  for (std::vector<Eye>* eyes : {&by_faces_, &by_front_}) // those nearest to the change first: they tell most often
    std::stable_sort(eyes->begin(), eyes->end(), [](const Eye& a, const Eye& b) { return a.spare > b.spare; });
}

bool Reach::sees(const Vector3& x, double half) const {
  const double faces = to_faces_(x) - half - slack_, front = to_front_(x) - half - slack_;
  const auto holds = [&](const Eye& eye) {
    return (eye.position - x).squaredNorm() < (eye.radius + half) * (eye.radius + half);
  };
  const auto concerns = [&](const std::vector<Eye>& eyes, double distance) {
    for (const Eye& eye : eyes) {
      if (eye.spare <= distance)
        return false;
      if (holds(eye))
        return true;
    }
    return false;
  };
  if (faces < 0 || concerns(by_faces_, faces) || concerns(by_front_, front))
    return true;
  if (std::none_of(by_branch_.begin(), by_branch_.end(), holds))
    return false;
  return to_all_(x) - half - slack_ < enriched_ * largest_beside_;
}

bool Reach::is_hidden(const Vector3& centre, const Vector3& half, const Eye& eye, bool by_new) const {
  thread_local std::vector<int> walls;
  const std::size_t most = by_new ? std::numeric_limits<std::size_t>::max() : 0;
  if (!known_.incision->walls_between(centre, half, eye.position, most, walls))
    return true;
  return std::any_of(walls.begin(), walls.end(), [&](const int wall) {
    const auto [sheet, triangle] = known_.incision->triangle_of(wall);
    return sheet >= std::ssize(known_.triangles) || triangle >= known_.triangles[static_cast<std::size_t>(sheet)];
  });
}

bool Reach::passes(const std::vector<Vector3>& places, const std::vector<Eye>& eyes, bool by_new, double nearest,
                   const Vector3& centre, const Vector3& half) const {
  std::vector<double> to_places; // from the box; found when some eye is near
  bool box_at_face = false;
  for (const Eye& eye : eyes) {
    if (eye.spare <= nearest)
      return false;
    if (distance_to_box(eye.position, centre, half) >= eye.radius)
      continue;
    if (to_places.empty()) {
      for (const Vector3& place : places)
        to_places.push_back(distance_to_box(place, centre, half));
      box_at_face =
          known_.incision == nullptr || known_.incision->near(centre, half.norm() + lifted_below * eye.radius);
    }
    // Eyes at a face look from off it: what hides them then may be new, whatever stands between them as they are.
    const bool at_face = eye.at_face || box_at_face;
    const double longest = (at_face ? looking_around : 1) * eye.radius + 2 * slack_;
    const auto leads = [&](std::size_t k) {
      const double left = longest - to_places[k];
      return left > 0 && (places[k] - eye.position).squaredNorm() < left * left;
    };
    std::size_t k = 0;
    while (k < places.size() && !leads(k))
      ++k;
    if (k < places.size() && (known_.incision == nullptr || is_hidden(centre, half, eye, by_new && !at_face)))
      return true;
  }
  return false;
}

bool Reach::sees(const Vector3& centre, const Vector3& half) const {
  const auto holds = [&](const Eye& eye) { return distance_to_box(eye.position, centre, half) < eye.radius; };
  return passes(faces_, by_faces_, true, distance_between(around_faces_, centre, half) - slack_, centre, half) ||
         passes(front_, by_front_, false, distance_between(around_front_, centre, half) - slack_, centre, half) ||
         (std::any_of(by_branch_.begin(), by_branch_.end(), holds) &&
          is_enriched(all_front_, around_all_, centre, half));
}

bool Reach::at_front(const Vector3& centre, const Vector3& half) const {
  return is_enriched(front_, around_front_, centre, half);
}

bool Reach::moves_points(const Vector3& centre, const Vector3& half) const {
  // Whether a box is parted goes by the faces in the ball about it.
  const double size = half.norm();
  return (distance_between(around_faces_, centre) - 2 * slack_ < size &&
          std::any_of(faces_.begin(), faces_.end(),
                      [&](const Vector3& face) { return (face - centre).norm() - 2 * slack_ < size; })) ||
         comes_near(front_, around_front_, size, centre, half);
}

bool Reach::is_enriched(const std::vector<Vector3>& places, const BoundingBox& around, const Vector3& centre,
                        const Vector3& half) const {
  if (!(enriched_ > 0) || distance_between(around, centre, half) - slack_ >= enriched_ * largest_beside_)
    return false;
  // Between the ends of a segment the reach goes from that of one to that of the other: the longest of all will do
  // where they differ.
  return comes_near(places, around, enriched_ * largest_beside_, centre, half);
}

bool Reach::comes_near(const std::vector<Vector3>& places, const BoundingBox& around, double reach,
                       const Vector3& centre, const Vector3& half) const {
  return distance_between(around, centre, half) - slack_ <= reach &&
         std::any_of(places.begin(), places.end(),
                     [&](const Vector3& place) { return distance_to_box(place, centre, half) - slack_ <= reach; });
}

ReachAlong::ReachAlong(const topology::SurfaceMesh& way, const topology::Incision* before, const NodeCloud& nodes,
                       const std::vector<char>& removed, const std::vector<double>& radii, double enriched,
                       double front_growth, bool nodes_may_coarsen)
    : margin_(front_growth + node_margin), front_(std::max(1.0, enriched)) {
  const double slack = 0.5 * *std::min_element(nodes.spacings.begin(), nodes.spacings.end());
  const std::vector<Vector3> places = sample_points(way, 0, slack);
  // The front of today near it: nodes that are exchanged there change the reach of its enrichment.
  std::vector<Vector3> front = places;
  if (before != nullptr && nodes_may_coarsen) {
    const Nearness to_way(places);
    const SpacingAt spacing_at(nodes, removed);
    const auto may_change = [&](const Vector3& x) { return to_way(x) < exchange_reach * spacing_at(x); };
    for (const topology::FrontSegment& segment : before->front())
      if (may_change(segment.from) || may_change(segment.to))
        for (const Vector3& x : {segment.from, Vector3(0.5 * (segment.from + segment.to)), segment.to})
          front.push_back(x);
  }
  std::vector<Vector3> all_front = front;
  add_front(before, slack, all_front);
  reach_.emplace(places, front, all_front, enriched, nodes.positions, radii, slack);
}

} // namespace spherecut::solvers
