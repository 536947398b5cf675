// Static search tree over points (k-d tree in an implicit median layout).
#pragma once

#include "topology/base/types.hpp"

namespace spherecut::topology {

class PointTree {
 public:
  explicit PointTree(const std::vector<Vector3>& points);

  struct Found {
    double squared_distance;
    int index;
    bool operator<(const Found& other) const {
      return squared_distance != other.squared_distance ? squared_distance < other.squared_distance
                                                        : index < other.index;
    }
  };
  /// Appends every point with |p - x| < radius to `found`, in no particular order.
  void within(const Vector3& x, double radius, std::vector<Found>& found) const;

  /// Nearest point; index -1 when the tree is empty.
  [[nodiscard]] Found nearest(const Vector3& x) const;

  /// The same, found sooner where `guess`, the index of a point or -1, is near.
  [[nodiscard]] Found nearest(const Vector3& x, int guess) const;

 private:
  void build(int begin, int end, int axis);
  void within(int begin, int end, int axis, const Vector3& x, double squared_radius, std::vector<Found>& found) const;
  void nearest(int begin, int end, int axis, const Vector3& x, Found& best) const;
  std::vector<Vector3> points_; // in tree order
  std::vector<int> index_;      // original index of points_[k]
  std::vector<int> place_;      // of a point by its original index
};

} // namespace spherecut::topology
