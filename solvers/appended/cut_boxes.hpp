// Small boxes that the sheets of an incision divide, and which parts of them hang together.
#pragma once

#include "solvers/appended/small_boxes.hpp"
#include "topology/incision/incision.hpp"

#include <cstdint>
#include <optional>
#include <unordered_map>

namespace spherecut::solvers {

/// Part of a small box on one side of the cut. A box without a cut is one part.
struct CutPart {
  double share = 1;                   // of the box's volume inside the body
  Vector3 centroid = Vector3::Zero(); // m
  Vector3 eye = Vector3::Zero();      // m, a place in it
  std::uint8_t joins = 0;             // bit k: it hangs together with part k of the same box
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
  CutBoxes(const SmallBoxes& boxes, const topology::Domain& domain)
      : boxes_(boxes), domain_(domain), divided_(boxes.size()) {}

  /// Divides the boxes that meet the region anew. Returns the boxes whose parts or their connections are others than
  /// before, ascending.
  std::vector<int> update(const topology::Incision& incision, const BoundingBox& region);

  [[nodiscard]] int part_count(int box) const {
    return !divided_[box] ? 1 : static_cast<int>(divided_[box]->parts.size());
  }
  [[nodiscard]] CutPart part(PartId id) const {
    const int box = box_of(id);
    if (divided_[box])
      return divided_[box]->parts[id % most_parts];
    const Vector3& middle = boxes_.boxes()[box].middle;
    return {1, middle, middle};
  }
  /// Whether the cut divides the box, or parts it from a neighbour.
  [[nodiscard]] bool is_divided(int box) const { return divided_[box].has_value(); }
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
    std::vector<std::uint64_t> links; // of every neighbour: bit 8 k + j, its part j is linked to part k here
    [[nodiscard]] bool operator==(const Divided& other) const;
  };
  [[nodiscard]] std::vector<CutPart> divide(int box, const topology::Incision& incision) const;
  [[nodiscard]] std::vector<CutPart> divide_by_samples(const SmallBox& box, const topology::Incision& incision) const;
  [[nodiscard]] bool lies_at_sheet(int box, const topology::Incision& incision) const;
  [[nodiscard]] int nearest_part(int box, const Vector3& x, const topology::Incision& incision) const;

  const SmallBoxes& boxes_;
  const topology::Domain& domain_;
  std::vector<std::optional<Divided>> divided_; // by box; of no value: one part
};

template <class Visit>
void CutBoxes::for_each_linked(PartId id, Visit&& visit) const {
  const int box = box_of(id), k = id % most_parts;
  const std::span<const int> neighbours = boxes_.neighbours(box);
  if (const std::optional<Divided>& own = divided_[box]) {
    for (unsigned bits = own->parts[k].joins, other = 0; bits != 0; bits >>= 1, ++other)
      if ((bits & 1) != 0)
        visit(part_id(box, static_cast<int>(other)));
    for (std::size_t n = 0; n < neighbours.size(); ++n)
      for (std::uint64_t bits = own->links[n] >> most_parts * k & 0xff, j = 0; bits != 0; bits >>= 1, ++j)
        if ((bits & 1) != 0)
          visit(part_id(neighbours[n], static_cast<int>(j)));
    return;
  }
  for (const int neighbour : neighbours) {
    const std::optional<Divided>& other = divided_[neighbour];
    if (!other) {
      visit(part_id(neighbour, 0));
      continue;
    }
    const std::span<const int> back = boxes_.neighbours(neighbour);
    const auto slot = std::lower_bound(back.begin(), back.end(), box) - back.begin();
    for (int j = 0; j < std::ssize(other->parts); ++j)
      if ((other->links[slot] >> most_parts * j & 1) != 0)
        visit(part_id(neighbour, j));
  }
}

} // namespace spherecut::solvers
