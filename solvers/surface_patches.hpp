// Shares of the surface: which part of the skin belongs to which node, and the mean displacement over it.
#pragma once

#include "solvers/background_cells.hpp"
#include "solvers/discretisation.hpp"
#include "solvers/shape_functions.hpp"

#include <optional>

namespace spherecut::solvers {

/// A linear functional of the displacement with unit total weight: sum_k weight[k] alpha_{node[k]}.
struct DisplacementMean {
  std::vector<int> nodes; // ascending
  std::vector<double> weights;
  Vector3 centroid = Vector3::Zero(); // m, of the share
  double area = 0;                    // m2, 0 when the mean is the value at a point
  std::vector<QuadraturePoint> share; // the points it is taken over; weights add up to one
  double growth = 1;                  // of the radii for a point of it that the spheres as they are do not support
  [[nodiscard]] Vector3 of(const VectorX& coefficients) const;
  /// The same mean of a field given point by point.
  [[nodiscard]] Vector3 of(const std::function<Vector3(const Vector3& x)>& field) const;
};

/// The mean over the same share with the shape functions of `spheres`. Throws NumericalError.
DisplacementMean reweighed(const DisplacementMean& mean, const Spheres& spheres);

/// Value at one point. Throws NumericalError when no sound support covers it.
DisplacementMean value_at(const Spheres& spheres, const Vector3& x);

/// The surface and the faces of the incision, point by point, with the node that each point belongs to: the nearest
/// surface node or, on a face, lip node that it sees.
class SurfacePatches {
 public:
  enum class Of { skin_and_faces, faces };

  /// Part of a surface: the points that some nodes may own, and all nodes that those points may belong to.
  struct Part {
    BoundingBox points, nodes; // m
  };

  /// Of a `part` the shares of those nodes alone are meant to be asked for; of `faces` only those of lip nodes.
  SurfacePatches(const topology::Domain& domain, const NodeCloud& nodes,
                 std::shared_ptr<const topology::Incision> incision = nullptr,
                 const std::optional<Part>& part = std::nullopt, Of of = Of::skin_and_faces);

  /// Mean over the share of `node` of the surface outside `held` (null: all of it) or, for a lip node, of its face; the
  /// node itself when it has no share.
  [[nodiscard]] DisplacementMean mean(int node, const Spheres& spheres,
                                      const std::function<bool(const Vector3&, const Vector3&)>& held = nullptr) const;

  /// Means over the parts of `held` that belong to each of `nodes`; a point of `held` nearest to none of them goes to
  /// the nearest of them, so that the whole of `held` is shared out.
  [[nodiscard]] std::vector<DisplacementMean>
  means(const std::vector<int>& nodes, const Spheres& spheres,
        const std::function<bool(const Vector3&, const Vector3&)>& held) const;

 private:
  const NodeCloud& nodes_;
  std::shared_ptr<const topology::Incision> incision_;
  std::vector<SurfacePoint> points_; // of the surface, then from faces_begin_ on of the faces
  int faces_begin_ = 0;
  std::vector<std::vector<int>> points_of_node_;
  std::vector<int> owners_; // node of every point of the surface; -1: the cloud has no surface nodes
};

} // namespace spherecut::solvers
