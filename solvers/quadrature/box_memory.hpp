// What background cells at the surface of an organ cost is finding out how far points are from that surface. A box that
// no sheet passes has the same points in every body of the organ: while a cut grows, and when a session begins anew,
// they are remembered from the body before.
#pragma once

#include "solvers/quadrature/background_cells.hpp"

#include <array>
#include <memory>
#include <mutex>
#include <unordered_map>

namespace spherecut::solvers {

/// Boxes that may meet the surface of one domain, as the last body that was made of it had them. What is kept follows
/// from box and domain alone, whatever the BackgroundOptions. Safe to share among threads: what is looked up does not
/// change while a body is made.
class BoxMemory {
 public:
  struct Box {
    bool inside = false; // all eight corners are
    bool is_cut = false; // `points` are known: where it is not inside and no sheet passed it
    std::vector<QuadraturePoint> points;
  };
  using Key = std::array<double, 6>; // centre and half, m
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  using Boxes = std::unordered_map<Key, Box, Hash>;

  [[nodiscard]] std::shared_ptr<const Boxes> known() const;
  /// In place of those before.
  void keep(Boxes boxes);

  /// That of the domain; it goes with it.
  static std::shared_ptr<BoxMemory> of(const std::shared_ptr<const topology::Domain>& domain);

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Boxes> boxes_ = std::make_shared<const Boxes>();
};

/// background_cells(), to the last bit, with what the memory has; it then has this body's boxes.
BackgroundCells background_cells(const topology::Domain& domain, const NodeCloud& nodes,
                                 const BackgroundOptions& options, const topology::Incision* incision,
                                 BoxMemory& memory);

} // namespace spherecut::solvers
