#include "solvers/appended/cut_boxes.hpp"

#include "solvers/quadrature/split_box.hpp"
#include "topology/search/disjoint_sets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace spherecut::solvers {

namespace {

constexpr double least_share = 1e-6; // of a box: a smaller part is given to the largest one
constexpr int samples_along = 4;     // of a box where one plane is not the whole cut

Vector3 corner_of(const SmallBox& box, int k, double factor) {
  return box.centre + factor * box.half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
}

bool sees(const topology::Incision& incision, const CutPart& a, const CutPart& b) {
  return !incision.blocks(a.centroid, b.centroid) || !incision.blocks(a.eye, b.eye);
}

void join(std::vector<CutPart>& parts, std::size_t a, std::size_t b) {
  parts[a].joins |= static_cast<std::uint8_t>(1U << b);
  parts[b].joins |= static_cast<std::uint8_t>(1U << a);
}

/// The largest part takes over those too small to stand alone; shares add up to one. Parts that are in one of `sides`,
/// also by one that is taken over, hang together.
void tidy(std::vector<CutPart>& parts, topology::DisjointSets& sides) {
  std::vector<int> order(parts.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return parts[a].share > parts[b].share; });
  const std::vector<CutPart> before = std::exchange(parts, {});
  double kept = 0;
  for (const int k : order)
    if (parts.size() < most_parts && before[k].share >= least_share) {
      kept += before[k].share;
      parts.push_back(before[k]);
    }
  for (std::size_t a = 0; a < parts.size(); ++a)
    for (std::size_t b = a + 1; b < parts.size(); ++b)
      if (sides.find(order[a]) == sides.find(order[b]))
        join(parts, a, b);
  parts.front().share += 1 - kept;
}

} // namespace

bool CutBoxes::Divided::operator==(const Divided& other) const {
  return links == other.links && std::equal(parts.begin(), parts.end(), other.parts.begin(), other.parts.end(),
                                            [](const CutPart& a, const CutPart& b) {
                                              return a.share == b.share && a.centroid == b.centroid &&
                                                     a.joins == b.joins;
                                            });
}

// Samples that see the first one of a part are in it. In a box where the sheet bends, places of one side need not see
// one another: parts hang together where neighbouring samples of them do.
std::vector<CutPart> CutBoxes::divide_by_samples(const SmallBox& box, const topology::Incision& incision) const {
  struct Sample {
    Vector3 place;
    int part;
  };
  std::vector<CutPart> parts;
  std::array<std::vector<Sample>, samples_along * samples_along * samples_along> samples;
  const Vector3 half = box.half / samples_along;
  double whole = 0;
  for (int a = 0; a < samples_along; ++a)
    for (int b = 0; b < samples_along; ++b)
      for (int c = 0; c < samples_along; ++c) {
        const Vector3 x = box.centre - box.half + half.cwiseProduct(Vector3(2 * a + 1, 2 * b + 1, 2 * c + 1));
        const auto [fraction, shift] =
            box.whole ? std::pair(1.0, Vector3(Vector3::Zero())) : part_inside(domain_, x, half);
        if (!(fraction > 0))
          continue;
        const auto plane = incision.closest(x, half.norm());
        const auto sides = plane ? split_box(x, half, plane->point, plane->normal)
                                 : std::array<BoxPart, 2>{BoxPart{8 * half.prod(), x}, BoxPart{}};
        for (const BoxPart& side : sides) {
          if (side.volume == 0)
            continue;
          const Vector3 moved = side.centroid + shift;
          const Vector3 place = incision.blocks(side.centroid, moved) ? side.centroid : moved;
          const double volume = fraction * side.volume;
          auto part = std::find_if(parts.begin(), parts.end(),
                                   [&](const CutPart& p) { return !incision.blocks(p.eye, place); });
          if (part == parts.end())
            part = parts.insert(parts.end(), {0, Vector3::Zero(), place});
          samples[(a * samples_along + b) * samples_along + c].push_back(
              {place, static_cast<int>(part - parts.begin())});
          part->share += volume;
          part->centroid += volume * place;
          whole += volume;
        }
      }
  topology::DisjointSets sides(static_cast<int>(parts.size()));
  const auto look = [&](const std::vector<Sample>& from, const std::vector<Sample>& to) {
    for (const Sample& x : from)
      for (const Sample& y : to)
        if (x.part != y.part && !incision.blocks(x.place, y.place))
          sides.join(x.part, y.part);
  };
  if (parts.size() > 1)
    for (int a = 0; a < samples_along; ++a)
      for (int b = 0; b < samples_along; ++b)
        for (int c = 0; c < samples_along; ++c) {
          const int at = (a * samples_along + b) * samples_along + c;
          look(samples[at], samples[at]);
          if (a + 1 < samples_along)
            look(samples[at], samples[at + samples_along * samples_along]);
          if (b + 1 < samples_along)
            look(samples[at], samples[at + samples_along]);
          if (c + 1 < samples_along)
            look(samples[at], samples[at + 1]);
        }
  for (CutPart& part : parts) {
    part.centroid /= part.share;
    if (incision.blocks(part.eye, part.centroid))
      part.centroid = part.eye;
    part.share /= whole;
  }
  if (!parts.empty())
    tidy(parts, sides);
  return parts;
}

// Parts of a box, at least one. One plane divides most boxes; a box at the end of the body, or one in which the plane
// is not the whole cut, is divided by samples that see one another.
std::vector<CutPart> CutBoxes::divide(int index, const topology::Incision& incision) const {
  const SmallBox& box = boxes_.boxes()[index];
  const CutPart all{1, box.middle, box.middle};
  const double radius = box.half.norm();
  if (!incision.near(box.centre, radius))
    return {all};
  const auto sheet = incision.closest(box.centre, radius);
  if (!sheet)
    return {all};
  std::vector<CutPart> parts;
  if (box.whole) {
    bool is_plane = true;
    const auto sides = split_box(box.centre, box.half, sheet->point, sheet->normal);
    for (int k = 0; k < 8 && is_plane; ++k) {
      const Vector3 corner = corner_of(box, k, 0.999);
      const BoxPart& side = sheet->normal.dot(corner - sheet->point) >= 0 ? sides[0] : sides[1];
      is_plane = side.volume == 0 || !incision.blocks(side.centroid, corner);
    }
    if (is_plane) {
      for (const BoxPart& side : sides)
        if (side.volume > 0)
          parts.push_back({side.volume / box.volume, side.centroid, side.centroid});
      topology::DisjointSets apart(static_cast<int>(parts.size()));
      tidy(parts, apart);
    }
  }
  if (parts.empty())
    parts = divide_by_samples(box, incision);
  return parts.empty() ? std::vector<CutPart>{all} : parts;
}

// A sheet in the plane of a face divides no box, and parts the boxes on both sides of it.
bool CutBoxes::lies_at_sheet(int box, const topology::Incision& incision) const {
  const SmallBox& at = boxes_.boxes()[box];
  // near() alone depends on how far the cut has grown elsewhere.
  if (!incision.near(at.centre, at.half.norm()) || !incision.closest(at.centre, at.half.norm()))
    return false;
  const std::span<const int> neighbours = boxes_.neighbours(box);
  return std::any_of(neighbours.begin(), neighbours.end(),
                     [&](int other) { return incision.blocks(at.middle, boxes_.boxes()[other].middle); });
}

std::vector<int> CutBoxes::update(const topology::Incision& incision, const BoundingBox& region) {
  std::vector<int> concerned, fresh;
  boxes_.within(region, concerned);
  std::unordered_map<int, Divided> before;
  for (const int box : concerned) {
    if (divided_[box]) {
      before.emplace(box, std::move(*divided_[box]));
      divided_[box].reset();
      fresh.push_back(box);
    }
    std::vector<CutPart> parts = divide(box, incision);
    if (parts.size() > 1 || parts.front().share != 1 || parts.front().centroid != boxes_.boxes()[box].middle ||
        lies_at_sheet(box, incision)) {
      if (fresh.empty() || fresh.back() != box)
        fresh.push_back(box);
      divided_[box].emplace().parts = std::move(parts);
    }
  }
  // Links of what has been divided anew, and of what lies beside it.
  std::vector<int> relinked = fresh;
  for (const int box : fresh)
    for (const int neighbour : boxes_.neighbours(box))
      if (is_divided(neighbour))
        relinked.push_back(neighbour);
  std::sort(relinked.begin(), relinked.end());
  relinked.erase(std::unique(relinked.begin(), relinked.end()), relinked.end());
  std::vector<int> changed;
  for (const int box : relinked) {
    const auto old = before.find(box);
    if (!divided_[box]) {
      changed.push_back(box);
      continue;
    }
    Divided& divided = *divided_[box];
    const bool is_new = old == before.end() && std::binary_search(fresh.begin(), fresh.end(), box);
    const Divided was = old != before.end() ? old->second : divided;
    const SmallBox& at = boxes_.boxes()[box];
    const auto front = incision.front_frame(at.centre, at.half.norm());
    const bool holds_front = front && ((front->point - at.centre).cwiseAbs().array() <= at.half.array()).all();
    for (std::size_t a = 0; a < divided.parts.size(); ++a)
      for (std::size_t b = a + 1; b < divided.parts.size(); ++b)
        if (holds_front || sees(incision, divided.parts[a], divided.parts[b]))
          join(divided.parts, a, b);
    const std::span<const int> neighbours = boxes_.neighbours(box);
    divided.links.assign(neighbours.size(), 0);
    for (std::size_t n = 0; n < neighbours.size(); ++n)
      for (int k = 0; k < std::ssize(divided.parts); ++k)
        for (int j = 0; j < part_count(neighbours[n]); ++j) {
          const CutPart other = part(part_id(neighbours[n], j));
          const bool first = box < neighbours[n]; // the same answer from either box
          if (first ? sees(incision, divided.parts[k], other) : sees(incision, other, divided.parts[k]))
            divided.links[n] |= std::uint64_t{1} << (most_parts * k + j);
        }
    if (is_new || !(divided == was))
      changed.push_back(box);
  }
  return changed;
}

int CutBoxes::nearest_part(int box, const Vector3& x, const topology::Incision& incision) const {
  const int count = part_count(box);
  int best = -1;
  double least = 0;
  for (int k = 0; k < count; ++k) {
    const CutPart at = part(part_id(box, k));
    if (incision.blocks(x, at.centroid))
      continue;
    if (const double distance = (x - at.centroid).squaredNorm(); best < 0 || distance < least) {
      best = k;
      least = distance;
    }
  }
  return best;
}

PartId CutBoxes::part_at(const Vector3& x, const topology::Incision& incision) const {
  const int box = boxes_.locate(x);
  const SmallBox& at = boxes_.boxes()[box];
  const bool holds = ((x - at.centre).cwiseAbs().array() <= 1.001 * at.half.array()).all();
  if (holds && !is_divided(box) && !incision.near(at.centre, at.half.norm()))
    return part_id(box, 0);
  if (const int k = nearest_part(box, x, incision); k >= 0)
    return part_id(box, k);
  // A sliver that was given to the other side, or a place beside the boxes: the nearest part about it that x sees.
  PartId seen = -1;
  double nearest = 0;
  for (const int neighbour : boxes_.neighbours(box))
    if (const int k = nearest_part(neighbour, x, incision); k >= 0)
      if (const double distance = (x - part(part_id(neighbour, k)).centroid).squaredNorm();
          seen < 0 || distance < nearest) {
        seen = part_id(neighbour, k);
        nearest = distance;
      }
  if (seen >= 0)
    return seen;
  // Just off a face that bulges: the part on the same side of the face.
  const auto face = incision.closest(x, 4 * at.half.norm());
  if (!face)
    return part_id(box, 0);
  const double side = face->normal.dot(x - face->point);
  int best = 0;
  double farthest = -1e300;
  for (int k = 0; k < part_count(box); ++k)
    if (const double over = face->normal.dot(part(part_id(box, k)).centroid - face->point) * (side >= 0 ? 1 : -1);
        over > farthest) {
      farthest = over;
      best = k;
    }
  return part_id(box, best);
}

CutBoxes::Components CutBoxes::components() const {
  Components result;
  result.of_box.assign(boxes_.size(), -1);
  for (int box = 0; box < boxes_.size(); ++box)
    for (int k = 1; k < part_count(box); ++k)
      result.other[part_id(box, k)] = -1;
  std::vector<PartId> pending;
  const auto number = [&](PartId id) -> int& {
    return id % most_parts == 0 ? result.of_box[box_of(id)] : result.other.at(id);
  };
  const auto flood = [&](PartId start) {
    if (number(start) >= 0)
      return;
    number(start) = result.count;
    pending.assign(1, start);
    while (!pending.empty()) {
      const PartId id = pending.back();
      pending.pop_back();
      for_each_linked(id, [&](PartId next) {
        if (int& at = number(next); at < 0) {
          at = result.count;
          pending.push_back(next);
        }
      });
    }
    ++result.count;
  };
  for (int box = 0; box < boxes_.size(); ++box)
    for (int k = 0; k < part_count(box); ++k)
      flood(part_id(box, k));
  return result;
}

} // namespace spherecut::solvers
