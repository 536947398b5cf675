// Small boxes that the sheets of an incision divide, and which parts of them hang together.
#pragma once

#include "solvers/appended/small_boxes.hpp"
#include "topology/incision.hpp"

#include <unordered_map>

namespace spherecut::solvers {

/// Part of a small box on one side of the cut. A box without a cut is one part.
struct CutPart {
  double share = 1;                   // of the box's volume inside the body
  Vector3 centroid = Vector3::Zero(); // m
  Vector3 eye = Vector3::Zero();      // m, a place in it
};

/// Number of the k-th part of a box.
using PartId = int;
inline constexpr int most_parts = 8;
[[nodiscard]] inline constexpr PartId part_id(int box, int k) {
  return most_parts * box + k;
}
[[nodiscard]] inline constexpr int box_of(PartId part) {
  return part / most_parts;
}

class CutBoxes {
 public:
  CutBoxes(const SmallBoxes& boxes, const topology::Domain& domain) : boxes_(boxes), domain_(domain) {}

  /// Divides the boxes that meet the region anew. Returns the boxes whose parts or their connections are others than
  /// before, ascending.
  std::vector<int> update(const topology::Incision& incision, const BoundingBox& region);

  [[nodiscard]] int part_count(int box) const {
    const auto found = divided_.find(box);
    return found == divided_.end() ? 1 : static_cast<int>(found->second.parts.size());
  }
  [[nodiscard]] CutPart part(PartId id) const {
    const auto found = divided_.find(box_of(id));
    return found == divided_.end() ? CutPart{1, boxes_.boxes()[box_of(id)].middle, boxes_.boxes()[box_of(id)].middle}
                                   : found->second.parts[id % most_parts];
  }
  [[nodiscard]] bool is_divided(int box) const { return divided_.contains(box); }
  /// Calls visit(part) for the parts that hang together with this one across a face of its box, or around a front
  /// within it.
  template <class Visit>
  void for_each_linked(PartId id, Visit&& visit) const;

  /// The part that x lies in, or next to.
  [[nodiscard]] PartId part_at(const Vector3& x, const topology::Incision& incision) const;

  /// Connected component of every part: entry part_count offsets. Components are numbered by their first part.
  struct Components {
    std::vector<int> of_box;               // of the first part of every box
    std::unordered_map<PartId, int> other; // of the further parts
    int count = 0;
    [[nodiscard]] int of(PartId id) const { return id % most_parts == 0 ? of_box[box_of(id)] : other.at(id); }
  };
  [[nodiscard]] Components components() const;

  [[nodiscard]] const SmallBoxes& boxes() const { return boxes_; }

 private:
  struct Divided {
    std::vector<CutPart> parts;
    bool joined = false;              // a front lies in the box: its parts hang together
    std::vector<std::uint64_t> links; // of every neighbour: bit 8 k + j, its part j is linked to part k here
    [[nodiscard]] bool operator==(const Divided& other) const;
  };
  [[nodiscard]] std::vector<CutPart> divide(int box, const topology::Incision& incision) const;
  [[nodiscard]] std::vector<CutPart> divide_by_samples(const SmallBox& box, const topology::Incision& incision) const;
  [[nodiscard]] int nearest_part(int box, const Vector3& x, const topology::Incision& incision) const;

  const SmallBoxes& boxes_;
  const topology::Domain& domain_;
  std::unordered_map<int, Divided> divided_;
};

template <class Visit>
void CutBoxes::for_each_linked(PartId id, Visit&& visit) const {
  const int box = box_of(id), k = id % most_parts;
  const std::span<const int> neighbours = boxes_.neighbours(box);
  const auto own = divided_.find(box);
  if (own != divided_.end()) {
    if (own->second.joined)
      for (int other = 0; other < std::ssize(own->second.parts); ++other)
        if (other != k)
          visit(part_id(box, other));
    for (std::size_t n = 0; n < neighbours.size(); ++n)
      for (std::uint64_t bits = own->second.links[n] >> most_parts * k & 0xff, j = 0; bits != 0; bits >>= 1, ++j)
        if ((bits & 1) != 0)
          visit(part_id(neighbours[n], static_cast<int>(j)));
    return;
  }
  for (const int neighbour : neighbours) {
    const auto other = divided_.find(neighbour);
    if (other == divided_.end()) {
      visit(part_id(neighbour, 0));
      continue;
    }
    const std::span<const int> back = boxes_.neighbours(neighbour);
    const auto slot = std::lower_bound(back.begin(), back.end(), box) - back.begin();
    for (int j = 0; j < std::ssize(other->second.parts); ++j)
      if ((other->second.links[slot] >> most_parts * j & 1) != 0)
        visit(part_id(neighbour, j));
  }
}

} // namespace spherecut::solvers
